"""A cleanup as the user sees it: what is found, how it ends, what is not known, and signals."""

from __future__ import annotations

import functools
import os
import signal
import time
from collections.abc import Collection
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

from bt_actions.cli.driving.signals import SAME_WISH, settle
from bt_actions.cli.exits import BadInput, Exit, importing_ros, refuse_domain
from bt_actions.cli.streams.writing import OutputLost, discard_stdout, note, write
from bt_actions.utilities.suggest import listing

if TYPE_CHECKING:
    from bt_actions.recovery.roll_call import LeftBehind
    from bt_actions.recovery.sweep import Swept


def sweep(
    look: float,
    patience: float,
    wanted: Collection[str] | None = None,
    *,
    accept: float = 0.0,
    first: str = "",
) -> Exit:
    """Clean up, saying what is found and how it ended; `first`: another run is to follow,
    and this is what to do where that is not wanted.

    Where not every server of one of the `wanted` actions, which are full names, answers, or none of
    any action is in sight, and nobody says which are wanted, nobody can say: UNKNOWN. Main thread
    only.
    """
    with _Stop() as stop:
        swept = _sweep(stop, look, patience, accept, wanted)
        stop.is_told = stop.signal is not None
        if swept.elsewhere:
            goals = (f"{goal_id.hex()} on {action}" for goal_id, action in swept.elsewhere.items())
            note(
                f"not touched: {listing(goals, 1)}: of bt_actions on another machine, or in "
                "another container, where it cannot be seen whether it is alive (see "
                "BT_ACTIONS_MACHINE)"
            )
        hint = "; start it" if wanted else ""
        hint += f", or {first}" if wanted and first else ""
        code = _tell_what_is_open(swept, stop.signal, hint, any_will_do=wanted is not None)
        tell = functools.partial(note, end="") if first else write  # whose results are to follow
        try:
            for goal in swept.left:
                tell(_line(goal))
            if code is Exit.SUCCESS and not swept.left:
                tell(_nothing(swept))
        except (OutputLost, BrokenPipeError):
            if code is not Exit.UNKNOWN:
                raise
            discard_stdout()
        if not first or code is not Exit.SUCCESS:
            stop.settle(code)
    return code


def _sweep(
    stop: _Stop,
    look: float,
    patience: float,
    accept: float,
    wanted: Collection[str] | None,
) -> Swept:
    """Look, and cancel; return what was seen."""
    with importing_ros():
        from bt_actions.recovery.sweep import Cleanup
        from bt_actions.ros.onlooker import CannotStart

    refuse_domain()

    def found(left: LeftBehind) -> None:
        stop.leaves_a_goal = True
        if left.awaited:
            note(
                f"dead process {left.pid} sent a goal to {left.call.action} that was not answered: "
                f"waiting for {left.takes:g} s or more, to cancel it should it be accepted: "
                f"{left.goal_id.hex()}"
            )
        else:
            note(
                f"canceling a goal of dead process {left.pid} on {left.call.action}: "
                f"{left.goal_id.hex()}"
            )

    def waits(names: list[str]) -> None:
        note(f"waiting for {listing(names)}, where something may have been left")

    try:
        return Cleanup(
            look=look,
            patience=patience,
            accept=accept,
            found=found,
            wanted=wanted,
            waits=waits,
            stopped=lambda: stop.signal is not None,
        ).run()
    except CannotStart as error:
        raise BadInput(f"ROS 2 cannot start: {error}") from error


def _tell_what_is_open(
    swept: Swept, stopped_by: signal.Signals | None, hint: str, any_will_do: bool
) -> Exit:
    """Say what is not known, which may be something to wait for; return the exit code."""
    code = Exit.SUCCESS
    if stopped_by is not None:
        note(f"stopped by {stopped_by.name} before all was seen")
        code = Exit(128 + stopped_by)
    elif not swept.known and not swept.unknown and not any_will_do:
        note(
            f"no action is in sight in ROS domain {swept.domain}: nobody can see what was left; "
            "start its server, or --look longer"
        )
        code = Exit.UNKNOWN
    else:
        others = set(swept.unknown).difference(swept.missing)
        for held_against, names in ((True, swept.missing), (False, others)):
            for trouble in sorted({swept.unknown[name] for name in names}):
                who = [name for name in sorted(names) if swept.unknown[name] == trouble]
                nobody = f"{trouble.format(listing(who))}: nobody can see what was left there"
                note(nobody + (hint if held_against else ""))
        code = Exit.UNKNOWN if swept.missing else code
    if swept.trouble is not None:
        note(f"nobody can see what was sent and not answered: {swept.trouble}")
        code = code or Exit.UNKNOWN
    if not all(goal.is_over for goal in swept.left):
        note("not all of them have ended; they may still be running")
        code = Exit.UNKNOWN
    return code


def _line(goal: LeftBehind) -> str:
    servers = len(goal.call.servers)
    told = f": {servers} servers of this name, and each may run it" if servers > 1 else ""
    end = goal.nothing_left or f"{goal.end}{told}"
    return f"{goal.call.action}  {goal.goal_id.hex()}  {end}\n"


def _nothing(swept: Swept) -> str:
    nothing = "nothing of this machine" if swept.elsewhere else "nothing"
    seen = len(swept.known)
    where = "1 action" if seen == 1 else f"{seen} actions"
    if swept.unknown:
        where = f"{where} of {seen + len(swept.unknown)}"
    return f"{nothing} is left to cancel on the {where} in sight in ROS domain {swept.domain}\n"


class _Stop:
    """The first signal is noted, for the sweep to end in good order; a second one does not wait.

    Of those that are at their default, from `__enter__` to `__exit__`; main thread only.
    """

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None
        self.is_told = False
        """Whether the user is told of it; one that came too late for that takes effect at the end,
        unless that is settled."""
        self.leaves_a_goal = False
        self._at = 0.0
        self._settled = False
        self._before: dict[signal.Signals, Any] = {}  # what signal.getsignal returns

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                self._before[number] = signal.signal(number, self._came)
        return self

    def __exit__(self, *_: object) -> None:
        if self._settled:
            return
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self.signal is not None and not self.is_told:
            signal.raise_signal(self.signal)

    def settle(self, code: Exit) -> None:
        """The program ends with this code, whatever comes."""
        self._settled = True
        settle(self._before, code)

    def _came(self, number: int, _frame: FrameType | None) -> None:
        if self.signal is None:
            self.signal = signal.Signals(number)
            self._at = time.monotonic()
        elif time.monotonic() - self._at > SAME_WISH:
            os._exit(Exit.UNKNOWN if self.leaves_a_goal else 128 + number)
