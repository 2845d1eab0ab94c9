"""The drive of one run from the main thread: wait for events and signals, feed state and view.

The tree ticks on its own threads. This file decides which outside cause ends a run (a signal, the
--timeout, a closed standard output), and which exit code follows. It never touches a behaviour.
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import threading
import time
from collections.abc import Callable
from signal import Signals as Signal
from typing import Protocol

from py_trees.common import Status

from bt_actions.cli.driving.feed import Feed
from bt_actions.cli.driving.signals import SAME_WISH, Signals
from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.patient_output import PatientOutput
from bt_actions.cli.streams.results import results
from bt_actions.cli.streams.writing import discard_stdout, note
from bt_actions.cli.views.lines import QuietView
from bt_actions.cli.views.view import View
from bt_actions.events import RunEnded, StopWanted
from bt_actions.events.stream import Stream
from bt_actions.running.telling import where_raised
from bt_actions.story.state import State
from bt_actions.utilities.batches import BATCH, LONGEST

GATHER = 0.02
"""Seconds in which events gather before they are taken: each take needs Python's lock."""
FRAME = 0.1
"""Seconds between two drawings where nothing happens."""
PATIENCE_WHEN_LEFT = 1.0
"""Seconds for the writing of output after a user who did not wait for the goals."""
NEARLY_OVER = 1.0
"""Seconds for a run without open goals to end, after a user who will not wait."""
_LOOK = 0.02
"""Seconds between two looks for signals while only the output is open."""

Judge = Callable[[Exit], tuple[Exit, str]]
"""A command's judgement: another exit code, and what is wrong with the request."""


class Runner(Protocol):
    """The runner of a tree, as far as a drive needs one."""

    @property
    def stream(self) -> Stream:
        """The events of the run."""

    def interrupt(self, *, abandon: bool = False) -> None:
        """Make the run drain and return; with `abandon`, drain no longer."""


class Drive:
    """One run of one tree, with one view."""

    def __init__(
        self,
        runner: Runner,
        tick_to_end: Callable[[], object],
        state: State,
        view: View,
        signals: Signals,
        *,
        timeout: float | None = None,
        clock: Callable[[], float] = time.monotonic,
        output: PatientOutput | None = None,
    ) -> None:
        """Take the parts of a run.

        `tick_to_end` runs the tree to its end, drains its goals, and closes its nodes. `output` is
        the view's output where that is written later.
        """
        self._runner = runner
        self._tick_to_end = tick_to_end
        self._output = output
        self._feed = Feed(state, view, self._show)
        self._state = state
        self._signals = signals
        self._timeout = timeout
        self._deadline: float | None = None
        self._clock = clock
        self._events = runner.stream.reader(signals.poke)
        self._finished = threading.Event()
        self._error: BaseException | None = None
        self._stopped_at: float | None = None
        """The moment of the first request to end."""
        self.abandoned = False
        """Whether the user did not wait for the ends of goals: threads still run."""
        self._takes = self._lost = False
        """Whether some output was lost."""
        self._watched = pipe_of_stdout()

    def run(self) -> None:
        """Run the tree to its end. Main thread only."""
        thread = threading.Thread(target=self._tree, name="tree", daemon=True)
        began = self._clock()
        deadline = None if self._timeout is None else began + self._timeout
        self._deadline = deadline
        thread.start()
        drawn = taken = began - FRAME
        while not self.abandoned:
            finished, now = self._finished.is_set(), self._clock()  # before the queue is emptied
            is_late = deadline is not None and now >= deadline
            is_soon = now - taken < LONGEST and not (finished or is_late)
            gathers = is_soon and self._events.is_burst
            if not gathers:
                self._take_events()
                taken = now
            if finished:
                thread.join()
                break
            if self._stopped_at is not None or self._state.finished is not None:
                deadline = None  # no goal is left to end
            if deadline is not None and now >= deadline:
                self._end(Exit.TIMEOUT, f"--timeout {self._timeout:g} s expired")
            if now - drawn >= FRAME and not gathers:
                self._feed.frame(now)
                drawn = now
            wait = BATCH if gathers else max(0.0, drawn + FRAME - now)
            if deadline is not None:
                wait = min(wait, max(0.0, deadline - now))
            received, ready = self._signals.wait(
                wait, readable=self._feed.view.fileno, writable=self._watched
            )
            if received:
                self._take_events()  # events from before the signal
            elif not (gathers or self._finished.is_set()):
                time.sleep(GATHER)
            for signal in received:
                self._signalled(signal)
            if self._watched in ready:
                self._nobody_reads()
        if self.abandoned:
            self._await_the_list()

    def _tree(self) -> None:
        try:
            self._tick_to_end()
        except BaseException as error:  # noqa: BLE001 - handed to the main thread
            self._error = error
        finally:
            self._finished.set()
            self._signals.poke()

    def _take_events(self) -> None:
        """Take all events in order, also those that come in meanwhile."""
        if self._takes:
            return
        self._takes = True
        while events := self._events.take():
            for event in events:
                self._feed.event(event)
        self._takes = False

    def _signalled(self, signal: Signal) -> None:
        if self._stopped_at is None:
            self._end(Exit[signal.name], f"interrupted by {signal.name}")
        elif self._clock() - self._stopped_at > SAME_WISH:
            self.abandoned = True

    def _end(self, code: Exit, cause: str) -> None:
        """End the run from outside; the first cause stands."""
        self._stopped_at = self._clock()
        self._runner.stream.add(StopWanted, code.name, cause)
        self._take_events()
        self._runner.interrupt()

    def _show(self, draw: Callable[[], None]) -> None:
        """Let the view draw; give up a view that fails, while the robot goes on."""
        try:
            draw()
        except BrokenPipeError:
            self._nobody_reads()
        except Exception as error:  # noqa: BLE001 - a full disk, a bug: no reason to drop a goal
            with contextlib.suppress(Exception):
                self._feed.view.close()
            self._feed.view = QuietView(self._state, sys.stderr)
            self._lost = True
            if isinstance(error, OSError):
                discard_stdout()
            note(f"bt-actions: the output cannot be written, and the run goes on: {error}")

    def _nobody_reads(self) -> None:
        """End the run after a closed standard output, and write to nowhere."""
        self._watched = -1
        with contextlib.suppress(OSError):
            results().flush()
        discard_stdout()
        if self._stopped_at is None:
            self._end(Exit.SIGPIPE, "standard output was closed")

    def _await_the_list(self) -> None:
        """Wait, not for long, until the runner has said how its goals stand."""
        self._runner.interrupt(abandon=True)
        began = self._clock()
        while self._state.finished is None:
            left = began + (SAME_WISH if self._state.live else NEARLY_OVER) - self._clock()
            if left <= 0.0:
                break
            self._signals.wait(min(left, SAME_WISH))
            self._take_events()
        self._runner.stream.add(StopWanted, "again", "left without waiting", abandons=True)
        self._take_events()

    def _await_readers(self) -> None:
        """Wait for slow readers to get everything; a signal, or the --timeout, ends the wait.

        A --timeout that passed earlier, at the shutdown of the tree, does not count.
        """
        if self._output is None:
            return
        until = self._deadline if self._stopped_at is None else None
        if self.abandoned:
            until = self._clock() + PATIENCE_WHEN_LEFT
        elif until is not None and until <= self._clock():
            until = None
        while not self._all_is_written(self._output):
            now = self._clock()
            again = self._stopped_at is None or now - self._stopped_at > SAME_WISH
            if (self._signals.wait(0.0)[0] and again) or (until is not None and now >= until):
                return

    def _all_is_written(self, output: PatientOutput) -> bool:
        done: list[bool] = []
        self._show(lambda: done.append(output.written(_LOOK)))
        return any(done)

    def finish(
        self, world: str = "", complaint: str = "", judge: Judge = lambda code: (code, "")
    ) -> Exit:
        """Show the end; return the exit code. A success that no reader could get is a failure.

        `world` and `complaint` are the last words of the simulation.
        """
        told = self._state.finished is not None and bool(self._state.finished.error)
        raised = self._error is not None and not told
        code, error = judge(code_of(self._state, raised=raised, complaint=complaint))
        if raised and self._error is not None:
            error = where_raised(self._error)
        self._runner.stream.add(
            RunEnded,
            int(code),
            cause_of(self._state),
            error,
            tuple(self._state.unaccounted),
            world,
            complaint,
        )
        self._take_events()
        self._show(self._feed.view.finish)
        self._await_readers()
        if self._lost and code is Exit.SUCCESS:
            note("bt-actions: exit code 1: the tree has succeeded, but its output is lost")
            code = Exit.FAILURE
        stop = self._state.stop
        if stop is not None and stop.who == Exit.SIGPIPE.name and code is not Exit.UNKNOWN:
            return Exit.SIGPIPE
        return code


def code_of(state: State, *, raised: bool = False, complaint: str = "") -> Exit:
    """Return the exit code of a run; `raised`: the run could not begin, or not drain."""
    if state.unaccounted or (state.abandoned and state.finished is None):
        return Exit.UNKNOWN
    if state.stop is not None:
        return Exit.__members__.get(state.stop.who, Exit.FAILURE)
    if state.finished is not None and state.finished.unusable:
        return Exit.BAD_INPUT
    failed = raised or state.finished is None or bool(state.finished.error) or complaint
    return Exit.FAILURE if failed or state.status is not Status.SUCCESS else Exit.SUCCESS


def cause_of(state: State) -> str:
    """Say why a run did not end by itself, or ""."""
    if state.stop is None:
        return ""
    return f"{state.stop.why}{', left without waiting' if state.abandoned else ''}"


def pipe_of_stdout() -> int:
    """Return standard output's descriptor where a reader could go away, else -1."""
    try:
        descriptor = results().fileno()
        mode = os.fstat(descriptor).st_mode
    except (OSError, ValueError):
        return -1
    return descriptor if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) else -1
