"""A cleanup on the terminal: the found goals, their ends, open questions, and signals."""

from __future__ import annotations

import functools
import os
import signal
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from bt_actions.cli.driving.signals import Signals
from bt_actions.cli.exits import Exit, importing_ros, starting_ros
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
    """Clean up, and tell the found goals and their ends.

    `first` says that another run is to follow, and what to do where that is not wanted. UNKNOWN is
    the code where a server of one of the `wanted` actions (full names) does not answer; without
    `wanted`, where no server of any action is in sight. Main thread only. The first signal ends the
    cleanup in good order, and a second one does not wait.
    """
    heard: list[signal.Signals] = []
    found: list[LeftBehind] = []

    def hear(number: signal.Signals) -> None:
        if heard:
            os._exit(Exit.UNKNOWN if found else 128 + number)
        heard.append(number)

    def clean_up() -> Exit:
        swept = _sweep(look, patience, accept, wanted, found, lambda: bool(heard))
        stopped_by = heard[0] if heard else None
        hint = "; start it" if wanted else ""
        hint += f", or {first}" if wanted and first else ""
        code = _tell_what_is_open(swept, stopped_by, hint, any_will_do=wanted is not None)
        # On standard output are the results of what is to follow
        _tell(swept, code, functools.partial(note, end="") if first else write)
        return code

    with Signals() as signals:
        code = signals.during(clean_up, hear)
        if is_last := not first or code is not Exit.SUCCESS:
            signals.settle(code)
    if heard and not is_last:  # too late to be told
        signal.raise_signal(heard[0])
    return code


def _sweep(
    look: float,
    patience: float,
    accept: float,
    wanted: Collection[str] | None,
    found: list[LeftBehind],
    stopped: Callable[[], bool],
) -> Swept:
    """Look for goals, and cancel them; tell those in `found`, and return what was seen."""
    with importing_ros():
        from bt_actions.recovery.sweep import Cleanup

    def tell(left: LeftBehind) -> None:
        found.append(left)
        if left.awaited:
            note(
                f"dead process {left.pid} sent a goal to {left.call.action}, without an answer: "
                f"waiting for {left.takes:g} s or more, to cancel the goal if the server accepts "
                f"it: {left.goal_id.hex()}"
            )
        else:
            note(
                f"canceling a goal of dead process {left.pid} on {left.call.action}: "
                f"{left.goal_id.hex()}"
            )

    def waits(names: list[str]) -> None:
        note(f"waiting for {listing(names)}, which may have goals of a dead process")

    with starting_ros():
        return Cleanup(
            look=look,
            patience=patience,
            accept=accept,
            found=tell,
            wanted=wanted,
            waits=waits,
            stopped=stopped,
        ).run()


def _tell(swept: Swept, code: Exit, say: Callable[[str], object]) -> None:
    """Tell the end of each goal, or that no goal was left."""
    try:
        for goal in swept.left:
            say(_line(goal))
        if code is Exit.SUCCESS and not swept.left:
            say(_nothing(swept))
    except (OutputLost, BrokenPipeError):
        if code is not Exit.UNKNOWN:
            raise
        discard_stdout()


def _tell_what_is_open(
    swept: Swept, stopped_by: signal.Signals | None, hint: str, any_will_do: bool
) -> Exit:
    """Tell the open questions, which may be worth a wait; return the exit code."""
    code = Exit.SUCCESS
    if swept.elsewhere:
        goals = (f"{goal_id.hex()} on {action}" for goal_id, action in swept.elsewhere.items())
        note(
            f"not touched: {listing(goals, 1)}: their process is on another machine, or in "
            "another container, and nobody can see from here whether the process is alive (see "
            "BT_ACTIONS_MACHINE)"
        )
    if stopped_by is not None:
        note(f"stopped by {stopped_by.name} before all servers had answered")
        code = Exit(128 + stopped_by)
    elif not swept.known and not swept.unknown and not any_will_do:
        note(
            f"no action server is in sight in ROS domain {swept.domain}: nobody can see its goals; "
            "start the server, or --look longer"
        )
        code = Exit.UNKNOWN
    else:
        others = set(swept.unknown).difference(swept.missing)
        for held_against, names in ((True, swept.missing), (False, others)):
            for trouble in sorted({swept.unknown[name] for name in names}):
                who = [name for name in sorted(names) if swept.unknown[name] == trouble]
                nobody = f"{trouble.format(listing(who))}: nobody can see the goals there"
                note(nobody + (hint if held_against else ""))
        code = Exit.UNKNOWN if swept.missing else code
    if swept.trouble is not None:
        note(f"nobody can see the goals without an answer: {swept.trouble}")
        code = code or Exit.UNKNOWN
    if not all(goal.is_over for goal in swept.left):
        note("not all of these goals have ended; they may still run")
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
