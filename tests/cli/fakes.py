"""A runner that plays a script of events; no ROS. Stands in where only driving is under test."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Iterable
from dataclasses import dataclass, field

from bt_actions.events import Event
from bt_actions.events.stream import Stream


@dataclass
class FakeRunner:
    """Plays `before`, waits to be interrupted if `waits`, then plays `after`."""

    before: Iterable[Event] = ()
    after: Iterable[Event] = ()
    waits: bool = False
    never_drains: bool = False
    error: Exception | None = None
    interrupted: threading.Event = field(default_factory=threading.Event)
    abandoned: threading.Event = field(default_factory=threading.Event)
    playing: threading.Event = field(default_factory=threading.Event)
    released: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._now = 100.0
        self.stream = Stream(lambda: (self._now, self._now + 1e9, 0.0))

    def interrupt(self, *, abandon: bool = False) -> None:
        self.interrupted.set()
        if abandon:
            self.abandoned.set()

    def tick_to_end(self) -> None:
        self._play(self.before)
        self.playing.set()
        if self.waits:
            self.interrupted.wait()
        if self.never_drains:
            self.released.wait()
        self._play(self.after)
        if self.error is not None:
            raise self.error

    def _play(self, events: Iterable[Event]) -> None:
        for event in events:
            self._now = event.at.steady
            fields = [getattr(event, each.name) for each in dataclasses.fields(event)]
            self.stream.add(type(event), *fields[1:])
