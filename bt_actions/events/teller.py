"""The teller of one runner: the numbers of its nodes, and their events and writes, to the stream.

`current_teller` is that of the run that ticks on this thread. A node of the tree tells it, and
needs no knowledge of runs or readers.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

from bt_actions.events.kinds import Event, VariableWritten
from bt_actions.events.snapshot import HIDDEN, Value, snapshot
from bt_actions.events.stream import Stream

_OF_LOAD = re.compile(r"^/bt/\w+/\d+/")
"""The beginning of the blackboard's key of a tree's variable, which each load has anew."""
OFTEN = 0.2
"""Seconds between two events of one goal's feedback, and of one variable."""


class Teller:
    """The events of a runner's tree, from nodes to the stream."""

    def __init__(self, stream: Stream, steady: Callable[[], float]) -> None:
        """Make a teller; `steady` gives the seconds by which the rates of events are bounded."""
        self.stream = stream
        self.run_id = ""
        """32 hexadecimal digits, new in each run."""
        self.reads_secret = False
        """Whether a secret was read since the last claim of a node: later values are told as
        hidden."""
        self.numbers: dict[object, int] = {}
        """The number of each node, for look-ups on all threads."""
        self._steady = steady
        self._written: dict[str, Value] = {}
        """Values written since the last claim."""
        self._waiting: dict[str, tuple[Value, int | None]] = {}
        """Values that came too soon after the one before."""
        self._told: dict[str, tuple[float, Value]] = {}

    @property
    def is_heard(self) -> bool:
        """Whether the stream has a reader."""
        return self.stream.is_read

    def tell(self, kind: Callable[..., Event], node: object, *args: Any, **fields: Any) -> None:
        """Tell an event of a node, if the node is one of the tree."""
        if not self.numbers and self.is_heard:
            self.began()  # the first reader has come since then
        number = self.numbers.get(node)
        if number is not None:
            self.stream.add(kind, number, *args, **fields)

    def began(self) -> None:
        """Tell that a run has begun, with all its nodes."""

    # Variables; on the ticking thread

    def wrote(self, key: str, value: object) -> None:
        """Take note of a variable's new value; `claim` names the writer."""
        if self.stream.is_read:
            self._written[_OF_LOAD.sub("", key)] = self.shown(value)

    def shown(self, value: object) -> Value:
        """Return a snapshot of a value that a node has just computed, or HIDDEN."""
        return HIDDEN if self.reads_secret else snapshot(value)

    @property
    def has_news(self) -> bool:
        """Whether a node has written, or read a secret, since the last claim."""
        return self.reads_secret or bool(self._written) or bool(self._waiting)

    def claim(self, node: object) -> None:
        """Attribute all that was written since the last claim to `node`."""
        self.reads_secret = False
        if not self._written and not self._waiting:
            return
        number = self.numbers.get(node)
        self._waiting |= {key: (value, number) for key, value in self._written.items()}
        self._written.clear()
        now = self._steady()
        for key in list(self._waiting):
            if now - self._told.get(key, (-OFTEN, None))[0] >= OFTEN:
                self._tell_of(key, now)

    def all_written(self) -> None:
        """Tell the waiting values: a node fails, or the run ends."""
        for key in list(self._waiting):
            self._tell_of(key, self._steady())

    def _tell_of(self, key: str, now: float) -> None:
        value, node = self._waiting.pop(key)
        if key in self._told and _same(self._told[key][1], value):
            return
        self._told[key] = now, value
        self.stream.add(VariableWritten, key, value, node)

    def forget(self) -> None:
        """Begin anew: nodes get numbers again, and every variable is told."""
        self.numbers = {}
        self._written.clear()
        self._waiting.clear()
        self._told.clear()


def _same(one: Value, other: Value) -> bool:
    return type(one) is type(other) and (one == other or (one != one and other != other))


current_teller: ContextVar[Teller | None] = ContextVar("current_teller", default=None)
"""The teller of the run that sets up, or ticks, a tree on this thread; None in a loop of the
user's."""
