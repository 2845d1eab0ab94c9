"""Common parts of leaves: the Backend of their node, time that runs out, and failure."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.traffic.backend import Backend
from bt_actions.wiring import backend_of

T = TypeVar("T")


class Connected(Generic[T]):
    """The part of a behaviour that needs a node, with one connection of its own there."""

    name: str
    _backend: Backend | None = None
    _own: Any = None

    def setup(self, **kwargs: Any) -> None:
        """Connect to the node given as ``node=``; a second call for the same node is fine."""
        node = kwargs.get("node")
        if node is None:
            raise TypeError(f"{self.name}: setup needs a ROS node: tree.setup(node=node)")
        backend = backend_of(node)
        if backend is not self._backend:
            self._let_go()
            self._own, self._backend = self._make(backend), backend

    def _make(self, backend: Backend) -> T:
        """Make the connection on the node."""
        raise NotImplementedError

    def _connection(self) -> tuple[Backend, T]:
        """Return the node, and the connection there."""
        if self._backend is None or self._own is None:
            raise RuntimeError(f"{self.name}: not set up; call setup(node=node) before ticking")
        return self._backend, self._own

    def _let_go(self) -> None:
        """Close the connection, and forget the node."""
        if self._own is not None:
            self._own.close()
        self._own = self._backend = None

    def shutdown(self) -> None:
        self._let_go()


class Stopwatch:
    """A measure of the seconds since it was made, which a clock that jumps back does not reduce."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now, self._passed, self._seen = now, 0.0, now()

    def passed(self) -> float:
        """Return the seconds until now."""
        now = self._now()
        self._passed += max(0.0, now - self._seen)
        self._seen = now
        return self._passed


class Timed(Behaviour):
    """A behaviour with a time that runs out.

    The time is in seconds of the node's clock where there is a node, of the steady clock elsewhere.
    """

    _backend: Backend | None = None

    def setup(self, **kwargs: Any) -> None:
        node = kwargs.get("node")
        self._backend = None if node is None else backend_of(node)

    def give(self, seconds: float | None) -> None:
        """Begin anew, with so many seconds; None is for ever."""
        self._seconds = math.inf if seconds is None else seconds
        self._watch = Stopwatch(self._now)

    def left(self) -> float:
        """Return the seconds that remain; zero when they have run out."""
        return self._seconds and max(0.0, self._seconds - self._watch.passed())

    def due_in(self) -> float | None:
        """Return the seconds until the behaviour needs a tick of its own accord."""
        return self.left()

    def left_to_run(self) -> float | None:
        """Return the seconds until its own time runs out; None where it has none."""
        return None

    def _now(self) -> float:
        return time.monotonic() if self._backend is None else self._backend.now().ros


class Leaf(Timed):
    """A leaf with its work in `do`; a ValueError there fails the leaf."""

    _seconds = math.inf

    def left_to_run(self) -> float | None:
        return None if math.isinf(self._seconds) else self.left()

    def do(self) -> Status:
        """Do the work of a tick; may raise ValueError (ExpressionError is one)."""
        raise NotImplementedError

    def update(self) -> Status:
        self.feedback_message = ""
        try:
            return self.do()
        except ValueError as error:
            self.feedback_message = str(error)
            return Status.FAILURE


class Limited(Leaf):
    """A leaf whose time begins with each visit."""

    _timeout: float | None = None

    def initialise(self) -> None:
        self.give(self._timeout)
