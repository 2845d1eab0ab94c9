"""The recorder of runs, on a thread of its own: one thread for all runs of a process.

The thread takes the events of each run twenty times a second, lets go of Python's lock after each
one, and writes them as one batch: no tick waits for it. The events of a burst wait for its end,
half a second at most: a chain of quick goals is not disturbed. A run that is killed loses its
events since the last batch.
"""

from __future__ import annotations

import contextlib
import shutil
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from py_trees.common import Status

from bt_actions.events import Event, RunBegan, RunEnded
from bt_actions.events.bare import bare
from bt_actions.events.stream import Reader, Stream
from bt_actions.recording.finishing import finish_beside
from bt_actions.recording.folders import (
    FIRST,
    Summary,
    folder_for,
    held,
    home,
    prune,
    write_summary,
)
from bt_actions.recording.unrecorded import since_text, told
from bt_actions.recording.writing import RunWriter, said_of
from bt_actions.story.state import State
from bt_actions.story.why import attempt_text
from bt_actions.story.words import judged
from bt_actions.utilities.batches import Batches
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import fit

BEAT = 1.0
"""Seconds between two heartbeats of a run."""
PATIENCE_FOR_PLACE = 0.5
"""Seconds in which a run that has begun gets its folder: a disk may hang."""
PATIENCE = 5.0
"""Seconds for the last events to be written, at most: a disk may hang."""


@dataclass(frozen=True, slots=True)
class Wish:
    """The wishes for a recording: its place and its content."""

    where: Path | None = None
    """The folder of the runs' folders; the user's state directory if not given."""
    first: Path | None = None
    """The first file itself, for one run."""
    values: bool = True
    """Whether goals, results, feedback, variables and inputs are kept."""
    why_not: str = ""
    """The reason against a recording, or ""; such a run is told all the same while it goes on."""


class Recorder:
    """The writer of this process's runs, until it is closed."""

    def __init__(self, wish: Wish, say: Callable[[str], None]) -> None:
        """Make a recorder; `say` gets, on the recorder's thread, news for the user."""
        self._wish, self._say = wish, say
        self._runs: list[_Run] = []
        self._lock = threading.Lock()
        self._batches = Batches("recorder", self._step, self._is_burst)

    def record(self, stream: Stream, tick: Callable[[], float | None]) -> _Run:
        """Record a run from now on, until its RunEnded.

        `tick` returns the beginning of the present tick, on the steady clock; None between two
        ticks.
        """
        run = _Run(stream, stream.reader(self._batches.poke), tick, self._wish, self._tell)
        with self._lock:
            self._runs.append(run)
            self._batches.start()
        self._batches.poke()
        return run

    def close(self) -> None:
        """Write the rest of all runs, ended or not."""
        self._batches.close(PATIENCE)

    # On the recorder's thread

    def _step(self, last: bool) -> None:
        for run in list(self._runs):
            if run.step(time.monotonic(), last=last):
                self._let_go(run)

    def _is_burst(self) -> bool:
        runs = list(self._runs)  # a new one gets its folder at once: `place` waits for that
        return all(run.is_begun.is_set() for run in runs) and any(
            run.reader.is_burst for run in runs
        )

    def _let_go(self, run: _Run) -> None:
        with self._lock:
            self._runs.remove(run)
        run.end()
        if run.first is not None:
            with contextlib.suppress(OSError):
                finish_beside(run.first, may_wait=not self._runs)
            if self._wish.first is None and self._wish.where is None:  # else it is kept
                prune()

    def _tell(self, text: str) -> None:
        with contextlib.suppress(Exception):  # a log that is closed
            self._say(text)


class _Run:
    """One run under recording."""

    def __init__(
        self,
        stream: Stream,
        reader: Reader,
        tick: Callable[[], float | None],
        wish: Wish,
        say: Callable[[str], None],
    ) -> None:
        self._stream, self.reader, self._tick = stream, reader, tick
        self._wish, self._say = wish, say
        self._began: RunBegan | None = None
        self._early: list[Event] = []
        """Events from before RunBegan."""
        self._unrecorded = ""
        """The time and the reason of the end of recording, or ""."""
        self._is_over = self._is_broken = False
        self._later: list[Event] = []
        """Events that came during the step before: a heartbeat stands before them."""
        self._writer: RunWriter | None = None
        self._locks = contextlib.ExitStack()
        self._beat = 0.0
        self.first: Path | None = None
        """The first file, once the run has begun."""
        self.is_begun = threading.Event()
        """Whether the place of the recording is known, or that there is none."""

    def place(self) -> str:
        """Return ``HOST:PATH`` of the first file, or ""; wait until the recorder has made it."""
        self.is_begun.wait(PATIENCE_FOR_PLACE)
        if self.first is None or self._began is None:
            return ""
        return f"{self._began.where.get('host', '')}:{self.first}"

    # On the recorder's thread

    def step(self, now: float, *, last: bool) -> bool:
        """Write all news until now; return whether the writing is over."""
        try:
            self._write(now, last=last)
        except Exception as error:  # noqa: BLE001 - a bug; no other run may suffer from it
            where = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{where.filename}:{where.lineno}"
            self._say(f"this run is not recorded any further: {error!r} ({place})")
            self._lose(self._stream.now()[1], repr(error))
            self._is_broken = True
        return self._is_over

    def _write(self, now: float, *, last: bool) -> None:
        at = self._stream.now()
        events = [*self._later, *self.reader.take()]
        self._later = [each for each in events if each.at.steady > at[0] and not last]
        taken = events[: len(events) - len(self._later)]
        self._is_over = last or any(isinstance(each, RunEnded) for each in taken)
        for event in taken:
            if isinstance(event, RunBegan) and self._began is None:
                self._began = event
                self._begin(event)
                self.is_begun.set()
            self._take(event)
            time.sleep(0)  # a thread that waits for Python's lock is next
        writer = self._writer
        if writer is not None and not self._unrecorded:
            if now - self._beat >= BEAT and not self._is_over:
                self._beat, began = now, self._tick()
                writer.beat(*at, 0.0 if began is None else max(0.0, at[0] - began))
            writer.flush()
            if writer.failed:
                self._lose(at[1], writer.failed)

    def _take(self, event: Event) -> None:
        if self._is_broken:
            return
        if self._writer is not None:
            self._writer.add(event)
        elif self._began is None:
            self._early.append(event)

    def _lose(self, since: float, why: str) -> None:
        """Have the end of the recording told, until the run is over."""
        if self._began is not None and not self._unrecorded:
            self._unrecorded = since_text(since, why)
            known = begun(self._began, values=self._wish.values)
            with contextlib.suppress(OSError):  # there is no place to tell it
                self._locks.enter_context(told(known, since, why))

    def _begin(self, began: RunBegan) -> None:
        """Make the run's files; say so where that fails."""
        wish, made = self._wish, contextlib.ExitStack()
        if wish.why_not:
            self._lose(began.at.wall, wish.why_not)
            return
        try:
            with made:  # is removed again where the beginning fails
                first = wish.first
                if first is None:
                    where = home() if wish.where is None else wish.where
                    first = folder_for(began.run_id, began.tree, began.at.wall, where) / FIRST
                    made.callback(shutil.rmtree, first.parent, ignore_errors=True)
                self._locks.enter_context(held(first.parent, waits=True))
                writer = RunWriter(first, began, values=wish.values, say=self._say)
                made.callback(first.unlink)
                made.callback(writer.close)
                self._locks.enter_context(held(first, alone=True, waits=True))
                write_summary(first, begun(began, values=wish.values))
                made.pop_all()
        except OSError as error:
            remedy = "set XDG_STATE_HOME to a folder that can be written, or say --no-record"
            folder = f"{error.filename}: {error.strerror}"
            self._say(f"this run is not recorded: {folder}; {remedy}")
            self._lose(began.at.wall, said_of(error))
            return
        self.first, self._writer = first, writer
        for event in self._early:
            self._writer.add(event)
        self._early.clear()

    def end(self) -> None:
        """Close the files, and release all locks."""
        self._stream.leave(self.reader)
        with self._locks:
            if self._writer is not None and self.first is not None:
                with contextlib.suppress(OSError):  # a failure was told at the events
                    self._writer.close()
                    if self._writer.state.began is not None:
                        ended = summary(self._writer.state)
                        write_summary(self.first, replace(ended, unrecorded=self._unrecorded))


def begun(began: RunBegan, *, values: bool = True) -> Summary:
    """Return the summary of a run that has just begun."""
    kept = began if values else bare(began)
    assert isinstance(kept, RunBegan)
    asked_by = kept.request, kept.caller
    return Summary(kept.run_id, kept.tree, kept.at.wall, *asked_by, dict(kept.where))


def summary(state: State) -> Summary:
    """Return the summary of a run as it stands; `state` knows its beginning."""
    began, finished, ended = state.began, state.finished, state.ended
    assert began is not None
    over = finished is not None or ended is not None
    return Summary(
        began.run_id,
        began.tree,
        began.at.wall,
        began.request,
        began.caller,
        dict(began.where),
        status=judged(state).value if over else "",
        stopped_by=state.stop.who if state.stop is not None else "",
        exit_code=ended.exit_code if ended is not None else None,
        seconds=state.elapsed,
        cause=clean(fit(_cause(state))) if over and state.status is not Status.SUCCESS else "",
    )


def _cause(state: State) -> str:
    """Return the cause of a failure, on one line that begins with a node's name."""
    if state.finished is not None and state.finished.error:
        return state.finished.error
    for failure in (*state.failures, *state.stopped):
        said, action = failure.message, failure.action
        if action is not None and failure.attempts:
            said = attempt_text(action, failure.attempts[-1])
        return f"{failure.path[-1]}: {said}" if said else failure.path[-1]
    return state.ended.error if state.ended is not None else ""
