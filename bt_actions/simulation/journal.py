"""The journal: the life of every goal as its server sees it, one JSON object a line.

Each line is one write to a file opened for appending, so that a killed process leaves whole lines,
and a restarted one goes on in the same file. Times are of the monotonic clock, which all processes
of a machine share. No ROS. A journal that cannot be written never stops a server.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any


class Event(StrEnum):
    """The event of a line."""

    OPENED = "opened"
    """The server is there. The line has no goal, as CLOSED."""
    RECEIVED = "received"
    REJECTED = "rejected"
    ACCEPTED = "accepted"
    STEP = "step"
    CANCEL_REQUESTED = "cancel_requested"
    CANCEL_ACCEPTED = "cancel_accepted"
    CANCEL_REJECTED = "cancel_rejected"
    CANCELED = "canceled"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    DIED = "died"
    """The server ended under the goal."""
    CLOSED = "closed"


ENDS = frozenset({Event.CANCELED, Event.SUCCEEDED, Event.ABORTED, Event.DIED})
"""The events after which a goal is no longer live."""


@dataclass(frozen=True, slots=True)
class JournalLine:
    """One line."""

    t: float
    """Seconds of the monotonic clock."""
    server: str
    """The fully qualified action name."""
    goal: str
    """The goal's id in hex; empty for a line about the server."""
    event: Event
    pid: int
    more: Mapping[str, Any] = field(default_factory=dict)
    """The rest of the line: number, pose, position, reason, faults, replaced …"""

    @property
    def pose(self) -> float | None:
        """The position of the robot, m; the opening in percent for a gripper."""
        for key in ("pose", "position"):
            if key in self.more:
                return float(self.more[key])
        return None

    @property
    def reason(self) -> str:
        """The reason, or ""."""
        return str(self.more.get("reason", ""))


class Journal:
    """The writer of the lines, which without a path writes nothing and costs nothing."""

    def __init__(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        on_error: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Append to `path`, which is created; raises OSError when it cannot be opened.

        `on_error` is told, once, that a line cannot be written later (a full disk).
        """
        self._path = None if path is None else Path(path)
        self._clock = clock
        self._on_error = on_error
        self._lock = threading.Lock()
        self._file: int | None = None
        if self._path is not None:
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_CLOEXEC", 0)
            self._file = os.open(self._path, flags, 0o644)

    def __repr__(self) -> str:
        return f"<Journal {self._path or 'off'}>"

    def __bool__(self) -> bool:
        """Return whether lines are written, so that callers need not gather data for nothing."""
        return self._file is not None

    def write(self, server: str, goal: str, event: Event, **more: object) -> None:
        """Add a line; values in `more` that JSON lacks are written as text."""
        if self._file is None:
            return
        line = {"t": self._clock(), "server": server, "goal": goal, "event": event.value}
        text = json.dumps(line | {"pid": os.getpid()} | more, default=str) + "\n"
        left = text.encode()
        with self._lock:
            if self._file is None:
                return
            try:
                while left:
                    left = left[os.write(self._file, left) :]
            except OSError as error:
                self._shut()
                self._on_error(f"journal {self._path}: {error.strerror}; nothing more is written")

    def close(self) -> None:
        """Close the file; lines written later are dropped."""
        with self._lock:
            self._shut()

    def _shut(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None


def read(path: str | os.PathLike[str]) -> list[JournalLine]:
    """Return the lines of a journal in the order of their times; a torn last line is left out."""
    text = Path(path).read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    return sorted((_entry(line) for line in whole.splitlines()), key=lambda entry: entry.t)


def _entry(line: str) -> JournalLine:
    more = json.loads(line)
    return JournalLine(
        t=more.pop("t"),
        server=more.pop("server"),
        goal=more.pop("goal"),
        event=Event(more.pop("event")),
        pid=more.pop("pid"),
        more=more,
    )


@dataclass(frozen=True, slots=True)
class Interval:
    """One execution of a goal: from its acceptance to its end on one server process."""

    server: str
    goal: str
    pid: int
    start: float
    end: float | None
    """The moment of the end; None: still live where the journal stops."""
    how: Event | None
    """The event that ended it."""


def live_intervals(
    entries: Iterable[JournalLine],
    server: str | None = None,
    *,
    killed: Mapping[int, float] | None = None,
) -> list[Interval]:
    """Return the time in which each goal was live, as its server saw it, in order of acceptance.

    `killed` has the moments at which processes (by id) were killed from outside, which no journal
    can hold: their goals ended then.
    """
    killed = killed or {}
    open_: dict[tuple[int, str, str], float] = {}
    intervals = []
    for entry in entries:
        if server is not None and entry.server != server:
            continue
        key = (entry.pid, entry.server, entry.goal)
        if entry.event is Event.ACCEPTED:
            open_.setdefault(key, entry.t)
        elif entry.event in ENDS and (start := open_.pop(key, None)) is not None:
            how = entry.event
            intervals.append(Interval(entry.server, entry.goal, entry.pid, start, entry.t, how))
    for (pid, name, goal), start in open_.items():
        died = Event.DIED if pid in killed else None
        intervals.append(Interval(name, goal, pid, start, killed.get(pid), died))
    return sorted(intervals, key=lambda interval: interval.start)


def max_live(
    entries: Iterable[JournalLine],
    server: str | None = None,
    *,
    killed: Mapping[int, float] | None = None,
) -> int:
    """Return the greatest number of goals live at once on `server` (or on all together).

    The order of the lines counts: in virtual time, many are of one moment.
    """
    killed = killed or {}
    live: set[tuple[int, str, str]] = set()
    most = 0
    for entry in entries:
        if server is not None and entry.server != server:
            continue
        live -= {key for key in live if key[0] in killed and killed[key[0]] <= entry.t}
        key = (entry.pid, entry.server, entry.goal)
        if entry.event is Event.ACCEPTED:
            live.add(key)
        elif entry.event in ENDS:
            live.discard(key)
        most = max(most, len(live))
    return most


def ends(
    entries: Iterable[JournalLine], server: str | None = None
) -> dict[tuple[str, str], Event | None]:
    """Return the end of each goal that was received, by server and goal id, in order of arrival.

    None: the goal is still live, or was never answered.
    """
    found: dict[tuple[str, str], Event | None] = {}
    for entry in entries:
        if not entry.goal or (server is not None and entry.server != server):
            continue
        key = (entry.server, entry.goal)
        if entry.event is Event.CANCEL_REQUESTED and key not in found:
            continue  # the goal is not known here
        found.setdefault(key, None)
        if entry.event in ENDS or entry.event is Event.REJECTED:
            found[key] = entry.event
    return found


def executions(entries: Iterable[JournalLine]) -> dict[tuple[str, str], int]:
    """Return the number of acceptances of each goal, by server and id: two are two executions."""
    return Counter((entry.server, entry.goal) for entry in entries if entry.event is Event.ACCEPTED)
