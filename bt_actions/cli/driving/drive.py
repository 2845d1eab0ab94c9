"""Drives one run from the main thread: waits for events and signals, feeds report and view.

The tree ticks on its own threads. Here is decided what ends a run from outside (a signal, the
--timeout, a closed standard output), and what exit code it all makes. Never touches a behaviour.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import queue
import stat
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from signal import Signals as Signal
from typing import Protocol

from py_trees.common import Status

from bt_actions.cli.driving.signals import SAME_WISH, Signals
from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.patient_output import PatientOutput
from bt_actions.cli.streams.results import results
from bt_actions.cli.streams.writing import discard_stdout, note
from bt_actions.cli.views.lines import QuietView
from bt_actions.cli.views.view import View
from bt_actions.cli.views.words import Closing, waiting_text
from bt_actions.events import Event
from bt_actions.goals.unaccounted import GoalReport
from bt_actions.running.loop import UnusableTree
from bt_actions.running.report import Report

FRAME = 0.1
"""Seconds between two drawings where nothing happens."""
PATIENCE_WHEN_LEFT = 1.0
"""Seconds for the output to be written where the user did not wait for the goals."""
NEARLY_OVER = 1.0
"""Seconds for a run with no goal left to wait for to be over, where the user will not wait."""
SOON = 1.0
"""Seconds after the end of the tree for which nothing is said of goals that have not ended."""
_LOOK = 0.02
"""Seconds between two looks for signals while only the output is waited for."""

_EXITS = {
    Signal.SIGHUP: Exit.SIGHUP,
    Signal.SIGINT: Exit.SIGINT,
    Signal.SIGQUIT: Exit.SIGQUIT,
    Signal.SIGTERM: Exit.SIGTERM,
}


class Runner(Protocol):
    """What this file needs of whoever runs the tree."""

    def observe(self, callback: Callable[[Event], None]) -> object:
        """Call `callback` with each event, on the ticking thread."""

    def interrupt(self, *, abandon: bool = False) -> None:
        """Make the run drain and return; with `abandon`, drain no longer."""

    def catch_up(self) -> None:
        """Tell what became of goals while a behaviour does not return from its tick."""

    @property
    def unaccounted(self) -> list[GoalReport]:
        """The goals whose end is not known."""


@dataclass(slots=True)
class _Stop:
    """Why the run was ended from outside."""

    code: Exit
    cause: str
    at: float


@dataclass(slots=True)
class Ended:
    """How a run ended."""

    code: Exit
    cause: str
    abandoned: bool
    """The user did not wait for the goals to end: threads are still running."""
    error: BaseException | None


class Drive:
    """One run of one tree, watched by one view."""

    def __init__(
        self,
        runner: Runner,
        tick_to_end: Callable[[], object],
        report: Report,
        view: View,
        signals: Signals,
        *,
        timeout: float | None = None,
        clock: Callable[[], float] = time.monotonic,
        output: PatientOutput | None = None,
    ) -> None:
        """`tick_to_end` runs the tree to its end, drains its goals, and closes what belongs to it;
        `output` is what the view writes to, where that is written later."""
        self._runner = runner
        self._tick_to_end = tick_to_end
        self._output = output
        self._report = report
        self._view = view
        self._signals = signals
        self._timeout = timeout
        self._deadline: float | None = None
        self._clock = clock
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._finished = threading.Event()
        self._error: BaseException | None = None
        self._stop: _Stop | None = None
        self._abandoned = False
        self._waits_since: float | None = None
        """When the tree was first seen to have ended; NaN once it is said what is waited for."""
        self._lost = False
        """Whether something could not be shown."""
        self._watched = _pipe_of_stdout()
        runner.observe(self._observe)

    def run(self) -> Ended:
        """Run the tree to its end; return how it ended. Main thread only."""
        thread = threading.Thread(target=self._tree, name="tree", daemon=True)
        began = self._clock()
        deadline = None if self._timeout is None else began + self._timeout
        self._deadline = deadline
        thread.start()
        drawn = began - FRAME
        while not self._abandoned:
            finished = self._finished.is_set()  # asked before the queue is emptied
            self._take_events()
            if finished:
                thread.join()
                break
            now = self._clock()
            if self._stop is not None or self._report.finished:
                deadline = None  # there is nothing left to end
            if deadline is not None and now >= deadline:
                self._end(Exit.TIMEOUT, f"--timeout {self._timeout:g} s expired", now)
            self._say_what_is_waited_for(now)
            if now - drawn >= FRAME:
                self._show(self._view.frame)
                drawn = now
            wait = max(0.0, drawn + FRAME - now)
            if deadline is not None:
                wait = min(wait, max(0.0, deadline - now))
            received, ready = self._signals.wait(
                wait, readable=self._view.fileno, writable=self._watched
            )
            self._take_events()  # what happened before the signal
            for signal in received:
                self._signalled(signal)
            if self._watched in ready:
                self._nobody_reads()
        if self._abandoned:
            self._await_the_list()
        self._settle()
        return Ended(self._code(), self._cause(), self._abandoned, self._error)

    def _tree(self) -> None:
        try:
            self._tick_to_end()
        except BaseException as error:  # noqa: BLE001 - handed to the main thread
            self._error = error
        finally:
            self._finished.set()
            self._signals.poke()

    def _observe(self, event: Event) -> None:
        self._events.put(event)
        self._signals.poke()

    def _take_events(self) -> None:
        while True:
            try:
                event = self._events.get_nowait()
            except queue.Empty:
                return
            self._report.observe(event)
            self._show(functools.partial(self._view.event, event))

    def _signalled(self, signal: Signal) -> None:
        now = self._clock()
        if self._stop is None:
            self._end(_EXITS[signal], f"interrupted by {signal.name}", now)
        elif now - self._stop.at > SAME_WISH:
            self._abandoned = True

    def _say_what_is_waited_for(self, now: float) -> None:
        """Say once why a tree that has ended is not over."""
        if not self._report.decided or self._report.finished or self._stop is not None:
            return
        if self._waits_since is None:
            self._waits_since = now
        if now - self._waits_since >= SOON and (text := waiting_text(self._report)):
            self._waits_since = math.nan
            self._show(lambda: self._view.say(f"{text}; Ctrl-C twice leaves without waiting"))

    def _end(self, code: Exit, cause: str, now: float) -> None:
        """End the run from outside; the first reason stands."""
        self._stop = _Stop(code, cause, now)
        self._runner.interrupt()
        live = len(self._report.live)
        goals = "1 goal" if live == 1 else f"{live} goals"
        again = "Ctrl-C again leaves without waiting"
        more = f": canceling {goals}; {again}" if live else ""
        if not live and (waiting := waiting_text(self._report)):
            more = f": {waiting}; {again}"
        self._show(lambda: self._view.say(f"{cause}{more}"))

    def _show(self, draw: Callable[[], None]) -> None:
        """Let the view draw; a view that fails is given up, and the robot goes on."""
        try:
            draw()
        except BrokenPipeError:
            self._nobody_reads()
        except Exception as error:  # noqa: BLE001 - a full disk, a bug: no reason to drop a goal
            with contextlib.suppress(Exception):
                self._view.close()
            self._view = QuietView(self._report, sys.stderr)
            self._lost = True
            if isinstance(error, OSError):
                discard_stdout()
            note(f"bt-actions: nothing more can be shown, and the run goes on: {error}")

    def _nobody_reads(self) -> None:
        """Standard output is closed: end the run, and write to nowhere from now on."""
        self._watched = -1
        with contextlib.suppress(OSError):
            results().flush()
        discard_stdout()
        if self._stop is None:
            self._end(Exit.SIGPIPE, "standard output was closed", self._clock())

    def _await_the_list(self) -> None:
        """Let the runner say how its goals stand, which takes a moment, but not for long."""
        self._runner.interrupt(abandon=True)
        began = self._clock()
        while not self._report.finished:
            left = began + (SAME_WISH if self._report.live else NEARLY_OVER) - self._clock()
            if left <= 0.0:
                break
            self._signals.wait(min(left, SAME_WISH))
            self._take_events()
        if not self._report.finished:
            self._runner.catch_up()
            self._take_events()

    def _await_readers(self) -> None:
        """Let who reads slowly get everything; a signal, or the --timeout, ends the wait.

        Not a --timeout that has passed before, while the tree was shut down.
        """
        if self._output is None:
            return
        until = self._deadline if self._stop is None else None
        if self._abandoned:
            until = self._clock() + PATIENCE_WHEN_LEFT
        elif until is not None and until <= self._clock():
            until = None
        while not self._all_is_written(self._output):
            now = self._clock()
            again = self._stop is None or now - self._stop.at > SAME_WISH
            if (self._signals.wait(0.0)[0] and again) or (until is not None and now >= until):
                return

    def _all_is_written(self, output: PatientOutput) -> bool:
        done: list[bool] = []
        self._show(lambda: done.append(output.written(_LOOK)))
        return any(done)

    def _settle(self) -> None:
        """Ask which goals have no known end."""
        goals = {goal.goal_id: goal for goal in self._runner.unaccounted}
        if self._abandoned:
            for row in self._report.live:
                name = self._report.called(row.behaviour)
                for goal_id, state in row.live.items():
                    why = f"{state.lower()} when left"
                    report = GoalReport(name, row.server, goal_id, row.outcome, why)
                    goals.setdefault(goal_id, report)
                row.leave(self._report.now)
        self._report.unaccounted = [str(goal) for goal in goals.values()]

    def _code(self) -> Exit:
        if self._report.unaccounted or (self._abandoned and not self._report.finished):
            return Exit.UNKNOWN
        if self._stop is not None:
            return self._stop.code
        if isinstance(self._error, UnusableTree):
            return Exit.BAD_INPUT
        if self._error is not None or self._report.status is not Status.SUCCESS:
            return Exit.FAILURE
        return Exit.SUCCESS

    def _cause(self) -> str:
        left = ", left without waiting" if self._abandoned else ""
        return f"{self._stop.cause}{left}" if self._stop else ""

    def finish(self, closing: Closing) -> Exit:
        """Show the end; return the exit code. A success that nobody could be told is none."""
        code = closing.exit_code
        self._show(lambda: self._view.finish(closing))
        self._await_readers()
        if self._lost and code is Exit.SUCCESS:
            note("bt-actions: the tree has succeeded; exit code 1, as that could not be shown")
            code = Exit.FAILURE
        if self._stop is not None and self._stop.code is Exit.SIGPIPE and code is not Exit.UNKNOWN:
            return Exit.SIGPIPE
        return code


def _pipe_of_stdout() -> int:
    """Return standard output's descriptor where a reader could go away, else -1."""
    try:
        descriptor = results().fileno()
        mode = os.fstat(descriptor).st_mode
    except (OSError, ValueError):
        return -1
    return descriptor if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) else -1
