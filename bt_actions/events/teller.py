"""Tells the stream of one runner what its nodes do: who they are by number, what they write.

`current_teller` is that of the run that ticks on this thread. A node of the tree tells it, and
needs to know nothing of runs or readers.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any, Protocol

from bt_actions.events.kinds import Event, VariableWritten
from bt_actions.events.snapshot import HIDDEN, Value, snapshot
from bt_actions.events.stream import Stream

_OF_LOAD = re.compile(r"^/bt/\w+/\d+/")
"""What the blackboard's key of a tree's variable begins with, another at each load."""
OFTEN = 0.2
"""Seconds between two events of one goal's feedback, and of one variable."""


class Named(Protocol):
    """A node: whatever is hashable by identity."""

    name: str


class Teller:
    """What a runner tells of its tree."""

    def __init__(self, stream: Stream, steady: Callable[[], float]) -> None:
        """`steady` gives the seconds by which the rates of events are bounded."""
        self.stream = stream
        self.run_id = ""
        """32 hexadecimal digits, another one in each run."""
        self.reads_secret = False
        """Whether a secret was read since a node was last known to have done something: what is
        written, said or sent since then is told as hidden."""
        self.numbers: dict[object, int] = {}
        """The number of each node, which all threads may look up."""
        self._steady = steady
        self._written: dict[str, Value] = {}
        """Since a node was last known to have written."""
        self._waiting: dict[str, tuple[Value, int | None]] = {}
        """Values that came too soon after the one before."""
        self._told: dict[str, tuple[float, Value]] = {}

    @property
    def is_heard(self) -> bool:
        """Whether anybody reads what is told."""
        return self.stream.is_read

    def tell(self, kind: Callable[..., Event], node: object, *args: Any, **fields: Any) -> None:
        """Tell an event of a node, if that is one of the tree."""
        if not self.numbers and self.is_heard:
            self.began()  # the first reader has come since
        number = self.numbers.get(node)
        if number is not None:
            self.stream.add(kind, number, *args, **fields)

    def began(self) -> None:
        """Tell that a run has begun, with all its nodes."""

    # Variables; on the ticking thread

    def wrote(self, key: str, value: object) -> None:
        """Take note of what a variable holds from now on; `claim` says who wrote it."""
        if self.stream.is_read:
            self._written[_OF_LOAD.sub("", key)] = self.shown(value)

    def shown(self, value: object) -> Value:
        """Return a snapshot of what a node has just computed, if that may be told."""
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
        """Tell what waits for its time: something fails, or the run ends."""
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
