"""The writing of one run's events into its files, as they come. No error of a disk is raised.

A file is MCAP without chunks: each batch of records is one `write`, so that a killed process leaves
whole records. A run that grows gets a new file every 10 MB, which begins with the state of the run;
of a run beyond 100 MB the oldest files go, the first excepted.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import Attachment, Channel, Header, Schema
from py_trees.common import Status

from bt_actions.events import (
    Event,
    FeedbackCame,
    GoalChanged,
    Logged,
    Moment,
    NodeChanged,
    RunBegan,
    to_line,
)
from bt_actions.events.bare import bare
from bt_actions.events.wire import to_plain
from bt_actions.recording.layout import (
    CHANNELS,
    EVENTS,
    GOALS,
    HEARTBEAT,
    LAYOUTS,
    LOG,
    QOS,
    STATE,
    TRANSITIONS,
    encode,
    nanoseconds,
    schema_of,
    stamp,
)
from bt_actions.recording.mcap_records import MAGIC, message_record
from bt_actions.story.keeping import to_json
from bt_actions.story.state import State
from bt_actions.utilities.plain_text import as_json

FILE = 10_000_000
"""Bytes from which on the next event begins a new file."""
FILES = 10
"""Files of one run, at most."""
THIN_FROM = 5
"""The file from which on feedback is thinned: so long a run shall keep its goals."""
THINNED = 1.0
"""Seconds between two feedback events of one goal in a long run."""
STATUSES = {Status.INVALID: 1, Status.RUNNING: 2, Status.SUCCESS: 3, Status.FAILURE: 4}
_STATES = ("QUEUED", "WAITING_FOR_SERVER", "SENDING", "EXECUTING", "CANCELING", "DONE")
_LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}


class RunWriter:
    """The files of one run, from its first event to its last."""

    def __init__(
        self,
        first: Path,
        began: RunBegan,
        *,
        values: bool = True,
        size: int = FILE,
        files: int = FILES,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Make the first file, which must not exist; raises OSError.

        `values` tells whether goals, results and the like are kept; `size` is in bytes; `say` gets
        news for the user, in words.
        """
        self.state = State()
        self.first, self._values, self._size, self._files = first, values, size, files
        self._say = say
        self._run_id = bytes.fromhex(began.run_id)
        self._base = nanoseconds(began.at.wall) - nanoseconds(began.at.steady)
        """Nanoseconds from the steady clock to the log's time, which so never goes back."""
        self._number = 0
        self._feedback: dict[str, float] = {}
        """The moment of the latest kept feedback of each goal, in a long run."""
        self.failed = ""
        """The reason why nothing is written any more, or ""."""
        self._buffer = io.BytesIO()
        self._written = self._head = 0
        """Bytes of the present file, and of the state with which it begins."""
        self._part = 0
        self._descriptor = _create(first)
        self._open()

    # Taking in

    def add(self, event: Event) -> None:
        """Take in an event; `flush` writes it."""
        told: Event | None = event
        if isinstance(event, FeedbackCame) and self._part >= THIN_FROM and self._is_spared(event):
            return
        if isinstance(event, RunBegan):
            told = self._attach(event)
        if not self._values and told is not None:
            told = bare(told)
        if told is None:
            return
        self.state.fold(told)
        if self.failed:
            return
        self._number = told.at.number
        self._put(told)
        if self._written + self._buffer.tell() >= max(self._size, 2 * self._head):
            self._begin_part()

    def beat(self, steady: float, wall: float, ros: float, tick: float) -> None:
        """Record a sign of life of the process; `tick` is the seconds of the present tick."""
        at = Moment(self._number, steady, wall, ros)
        self._message(HEARTBEAT, at, encode(LAYOUTS[HEARTBEAT], (at.number, *stamp(ros), tick)))

    def flush(self) -> None:
        """Write the taken events to the kernel; events without room are taken back."""
        data = self._buffer.getvalue()
        self._buffer.seek(0)
        self._buffer.truncate()
        if not data or self.failed:
            return
        try:
            _write_all(self._descriptor, data)
        except OSError as error:
            self._give_up(error)
        else:
            self._written += len(data)

    def close(self) -> None:
        """Write the rest, and close the file."""
        self.flush()
        self._close()

    # Within

    def _open(self) -> None:
        """Begin a file: its header, and its topics."""
        self._buffer.write(MAGIC)
        self._record(Header("ros2", "bt_actions"))
        self._sequences = dict.fromkeys(LAYOUTS, 0)
        for topic, layout in LAYOUTS.items():
            number = CHANNELS[topic]
            data = schema_of(topic)
            self._record(Schema(id=number, name=layout.type, encoding="ros2msg", data=data))
            self._record(Channel(number, topic, "cdr", QOS, number))

    def _begin_part(self) -> None:
        """Go on in another file, which begins with the state of the run."""
        self.flush()
        if self.failed:
            return
        self._part += 1
        try:
            descriptor = _create(part_of(self.first, self._part))
        except OSError as error:
            self._give_up(error)
            return
        self._close()
        self._descriptor, self._written = descriptor, 0
        if self._part == THIN_FROM:
            self._say("this run is long: from now on its feedback is kept once a second")
        if self._part >= self._files:
            with contextlib.suppress(OSError):
                part_of(self.first, self._part - self._files + 1).unlink(missing_ok=True)
        self._open()
        state = self.state
        assert state.now is not None
        at = state.now
        head = (self._run_id, at.number, *stamp(at.ros))
        self._message(STATE, at, encode(LAYOUTS[STATE], head, (state.tree, to_json(state))))
        self._head = self._buffer.tell()

    def _close(self) -> None:
        with contextlib.suppress(OSError):  # the disk is gone, which was told at the writing
            os.close(self._descriptor)

    def _attach(self, event: RunBegan) -> RunBegan:
        """Keep the tree's files beside the events."""
        if self._values:
            at = self._log_time(event.at)
            for path, text in event.sources.items():
                name = f"trees/{path}".encode(errors="backslashreplace").decode()
                data = text.encode("utf-8", "replace")
                self._record(Attachment(at, at, name, "application/yaml", data))
            plain = to_plain(replace(event, sources={}))
            for name in ("inputs", "versions"):
                data = as_json(plain[name]).encode()
                self._record(Attachment(at, at, f"{name}.json", "application/json", data))
        return replace(event, sources={})

    def _is_spared(self, event: FeedbackCame) -> bool:
        last = self._feedback.get(event.goal_id, -THINNED)
        if event.at.steady - last < THINNED:
            return True
        if len(self._feedback) > 1000:  # most are of ended goals
            self._feedback.clear()
        self._feedback[event.goal_id] = event.at.steady
        return False

    def _put(self, event: Event) -> None:
        at, node = event.at, getattr(event, "node", None) or 0
        time, status, is_all = stamp(at.ros), 0, False
        if isinstance(event, NodeChanged):
            status = STATUSES[event.status]
            is_all = not event.message and not event.warning and event.due_in is None
        elif isinstance(event, GoalChanged):
            self._put_goal(event)
        elif isinstance(event, Logged):
            texts = (self._name_of(node), event.text, "", "")
            head = (*time, _LEVELS.get(event.level, 20))
            self._message(LOG, at, encode(LAYOUTS[LOG], head, texts))
        if not is_all:
            told = (self._run_id, at.number, *time, node, status)
            data = encode(LAYOUTS[EVENTS], told, (type(event).__name__, to_line(event)))
            self._message(EVENTS, at, data)
        if isinstance(event, NodeChanged):  # behind its event, which has more
            short = (at.number, *time, node, status, event.by_itself)
            self._message(TRANSITIONS, at, encode(LAYOUTS[TRANSITIONS], short))

    def _put_goal(self, event: GoalChanged) -> None:
        at = event.at
        state = _STATES.index(event.state) + 1 if event.state in _STATES else 0
        goal_id = bytes.fromhex(event.goal_id)
        head = (at.number, *stamp(at.ros), event.node, event.attempt, goal_id, state)
        texts = (event.server, event.outcome or "", event.end or "", event.reason)
        self._message(GOALS, at, encode(LAYOUTS[GOALS], head, texts))

    def _name_of(self, node: int) -> str:
        story = self.state.nodes.get(node)
        return story.node.name if story is not None else ""

    def _record(self, record: Header | Schema | Channel | Attachment) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._buffer.write(builder.end())

    def _message(self, topic: str, at: Moment, data: bytes) -> None:
        self._sequences[topic] += 1
        head = CHANNELS[topic], self._sequences[topic] % 2**32, self._log_time(at)
        self._buffer.write(message_record(*head, nanoseconds(at.wall), data))

    def _log_time(self, at: Moment) -> int:
        return max(0, nanoseconds(at.steady) + self._base)

    def _give_up(self, error: OSError) -> None:
        """Leave a file of whole records, and write no more."""
        self.failed = said_of(error)
        with contextlib.suppress(OSError):  # a disk that is gone
            os.ftruncate(self._descriptor, self._written)
        self._say(f"this run is not recorded any further: {self.failed} ({self.first.parent})")


def said_of(error: OSError) -> str:
    """Say why nothing can be written."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "the disk is full"
    return os.strerror(error.errno) if error.errno else str(error)


def part_of(first: Path, number: int) -> Path:
    """Return the file of a run that follows the first: ``run.1.mcap``."""
    return first.with_name(f"{first.stem}.{number}.mcap") if number else first


def _create(path: Path) -> int:
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)


def _write_all(descriptor: int, data: bytes) -> None:
    """Write all of it: a full disk takes a part first, and only then reports an error."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]
