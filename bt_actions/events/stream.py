"""The events of one runner in one order, and their readers.

An event gets its moment and its place in the order together, under the stream's lock, on the thread
on which it happens: the receiving thread for a server's message, the ticking thread for a node
whose tick returns. That thread notes the event's fields, and no more: the first reader that takes
makes the events of the notes, for all readers. Each reader has a queue of its own, so no reader
waits for another, and no producer waits for any. Without a reader, nothing is noted.
"""

from __future__ import annotations

import threading
from bisect import bisect, insort
from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, TypeAlias

from py_trees.common import Status

from bt_actions.events.kinds import (
    ClockJumped,
    Event,
    EventsLost,
    FeedbackCame,
    Logged,
    Moment,
    Node,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    RoundBegan,
    RunBegan,
    StopWanted,
    VariableWritten,
)

ROOM = 20_000
"""Events that wait for one reader, before spared kinds are left out for it."""
BURST = 20
"""Events that come within some 50 ms, as of a chain of goals without work."""
SPARED = (FeedbackCame, VariableWritten, NodeChanged, RoundBegan, Logged)
"""Kinds that are left out for a slow reader; events of goals and of the run never are."""
CHANGES = 100
"""Times that nodes come or go before a late reader gets the changes as one event."""
JUMP = 0.5
"""Seconds by which a clock must differ from the steady one at once to have jumped."""
SLEW = 0.001
"""The share by which the wall clock may run faster or slower without a jump, as NTP lets it."""
Clock = Callable[[], tuple[float, float, float]]
"""The steady, the wall and the ROS clock, in seconds."""
_Note: TypeAlias = tuple[
    Callable[..., Event], tuple[float, float, float], tuple[Any, ...], dict[str, Any]
]
"""The kind of an event, its moment on the clocks, and its fields."""


class Reader:
    """The events for one reader, from `Stream.reader` on; any thread may take them."""

    def __init__(
        self, noted: deque[_Note], make: Callable[[], None], poke: Callable[[], None], room: int
    ) -> None:
        self._noted, self._events = noted, deque[Event]()
        self._make, self.poke, self._room = make, poke, room
        self._lost = 0

    @property
    def is_burst(self) -> bool:
        """Whether so many events wait that the tree is better not disturbed for a moment."""
        return BURST < len(self._events) + len(self._noted) < self._room // 2

    def take(self) -> list[Event]:
        """Return the events since the last call, in order.

        EventsLost for those that were left out.
        """
        self._make()
        events = []
        while self._events:
            events.append(self._events.popleft())
        return events

    def put(self, event: Event) -> None:
        """Add an event; for the stream alone, under its lock."""
        if len(self._events) >= self._room and _is_spared(event):
            self._lost += 1
            return
        if self._lost:
            self._events.append(EventsLost(event.at, self._lost))
            self._lost = 0
        self._events.append(event)


def _is_spared(event: Event) -> bool:
    """Return whether to leave an event out for a slow reader; one with a failure never is."""
    failed = isinstance(event, NodeChanged) and event.status is Status.FAILURE
    return isinstance(event, SPARED) and not failed


class Stream:
    """The stream, which takes events from any thread."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        """The lock on the notes."""
        self._making = threading.Lock()
        """The lock on the making of events; a holder of both takes this one first."""
        self._noted: deque[_Note] = deque()
        self._readers: tuple[Reader, ...] = ()
        self._number = 0
        self._nodes: tuple[RunBegan | NodesAdded | NodesRemoved, ...] = ()
        """RunBegan of the latest run, and the nodes that came and went since."""
        self._last: tuple[float, float, float] | None = None
        self.stop_is_told = False
        """Whether StopWanted was told; the run resets it at its end."""

    @property
    def is_read(self) -> bool:
        """Whether the stream has a reader: without one, nothing need be added."""
        return bool(self._readers)

    def reader(self, poke: Callable[[], None] = lambda: None, room: int = ROOM) -> Reader:
        """Return a reader of all events from now on, behind those that tell the tree's nodes.

        `poke` is called, on the thread of an event and under the lock, where an event comes and all
        before it were taken. `poke` must not wait, and a reader whose `poke` raises is removed.
        """
        reader = Reader(self._noted, self._make, poke, room)
        with self._making, self._lock:
            self._make_noted()
            for event in self._nodes:
                reader.put(event)
            self._readers = (*self._readers, reader)
        return reader

    def leave(self, reader: Reader) -> None:
        """Remove a reader."""
        with self._making, self._lock:
            self._make_noted()
            self._readers = tuple(each for each in self._readers if each is not reader)

    def add(self, kind: Callable[..., Event], *args: Any, **fields: Any) -> None:
        """Note an event of `kind`, with the fields that follow its moment, for all readers.

        The fields are not looked at until a reader takes, so they must not change.
        """
        if not self._readers:
            return
        if kind is StopWanted:
            self.stop_is_told = True
        with self._lock:
            self._noted.append((kind, self._clock(), args, fields))
            if len(self._noted) == 1:
                self._poke()
        if len(self._noted) >= ROOM:  # no reader takes: their queues know what to spare
            self._make()

    def now(self) -> tuple[float, float, float]:
        """Return this moment on all clocks; the readers have all events before it."""
        with self._lock:
            return self._clock()

    def _poke(self) -> None:
        for reader in self._readers:
            try:
                reader.poke()
            except Exception:  # noqa: BLE001 - any; no other reader must suffer from it
                self._readers = tuple(each for each in self._readers if each is not reader)

    def _make(self) -> None:
        with self._making:
            self._make_noted()

    def _make_noted(self) -> None:
        while self._noted:
            kind, now, args, fields = self._noted.popleft()
            for jump in self._jumps(now):
                self._give(ClockJumped(self._moment(now), *jump))
            self._give(kind(self._moment(now), *args, **fields))

    def _moment(self, now: tuple[float, float, float]) -> Moment:
        self._number += 1
        return Moment(self._number, *now)

    def _give(self, event: Event) -> None:
        if isinstance(event, RunBegan):
            self._nodes = (event,)
        elif isinstance(event, NodesAdded | NodesRemoved):
            self._nodes += (event,)
            if len(self._nodes) > CHANGES and isinstance(began := self._nodes[0], RunBegan):
                self._nodes = (replace(began, nodes=_nodes_after(self._nodes)),)
        for reader in self._readers:
            reader.put(event)

    def _jumps(self, now: tuple[float, float, float]) -> list[tuple[str, float]]:
        """Return the clocks that have jumped since the last event, and by how much."""
        last, self._last = self._last, now
        if last is None:
            return []
        steady, wall, ros = now[0] - last[0], now[1] - last[1], now[2] - last[2]
        jumps = []
        if abs(wall - steady) > JUMP + SLEW * steady:
            jumps.append(("wall", wall - steady))
        if ros < 0.0:
            jumps.append(("ros", ros))
        return jumps


def _nodes_after(events: Iterable[RunBegan | NodesAdded | NodesRemoved]) -> tuple[Node, ...]:
    """Return the nodes that are there in the end, by number, each with its index.

    The index is a node's place among those siblings that come before it in the result.
    """
    nodes, below = dict[int, Node](), defaultdict[int | None, list[int]](list)
    for event in events:
        if isinstance(event, NodesRemoved):
            for number in event.nodes:
                below[nodes.pop(number).parent].remove(number)
            continue
        for node in event.nodes:
            nodes[node.id], siblings = node, below[node.parent]
            siblings.insert(len(siblings) if node.index is None else node.index, node.id)
    index = dict[int, int]()
    for siblings in below.values():
        before = list[int]()
        for number in siblings:
            index[number] = bisect(before, number)
            insort(before, number)
    return tuple(replace(nodes[number], index=index[number]) for number in sorted(nodes))
