"""What leaves are set up with: the Backend of a node, and time that runs out on its clock."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any, Generic, Protocol, TypeVar

from py_trees.behaviour import Behaviour

from bt_actions.traffic.backend import Backend, Clock
from bt_actions.wiring import backend_of


def backend_in(arguments: Mapping[str, Any], leaf: Behaviour) -> Backend:
    """Return what the node among the arguments of `leaf.setup` gives. Raises TypeError without."""
    node = arguments.get("node")
    if node is None:
        raise TypeError(f"{leaf.name}: setup needs a ROS node: tree.setup(node=node)")
    return backend_of(node)


def limit(seconds: float | None) -> float:
    """Seconds that a countdown begins with; None is never."""
    return math.inf if seconds is None else seconds


class Countdown:
    """Seconds that run out; a clock that jumps back leaves what remained.

    They are seconds of the node's clock where there is a node, of the steady clock elsewhere.
    """

    def __init__(self) -> None:
        self._clock: Clock | None = None
        self._left = 0.0
        self._seen = 0.0

    def setup(self, node: Any) -> None:
        """Read `node`'s clock from now on; None keeps to the steady clock."""
        self._clock = None if node is None else backend_of(node).clock

    def start(self, seconds: float) -> None:
        """Begin anew."""
        self._left, self._seen = seconds, self._now()

    def left(self) -> float:
        """The seconds that remain; zero when they have run out."""
        now = self._now()
        self._left = max(0.0, self._left - max(0.0, now - self._seen))
        self._seen = now
        return self._left

    def _now(self) -> float:
        return time.monotonic() if self._clock is None else self._clock.now().ros


class Thing(Protocol):
    """What a leaf has on a node."""

    def close(self) -> None:
        """Let go of it."""


T = TypeVar("T", bound=Thing)


class Connected(Behaviour, Generic[T]):
    """A leaf that cannot do without a node, and has one thing of its own there."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._countdown = Countdown()
        self._backend: Backend | None = None
        self._own: T | None = None

    def setup(self, **kwargs: Any) -> None:
        """Connect to the node given as ``node=``; again for the same node: fine."""
        backend = backend_in(kwargs, self)
        if backend is not self._backend:
            self.shutdown()
            self._countdown.setup(backend)
            self._own, self._backend = self._make(backend), backend

    def _make(self, backend: Backend) -> T:
        """Make what it needs there."""
        raise NotImplementedError

    def _there(self) -> tuple[Backend, T]:
        """Return the node, and what it has there."""
        if self._backend is None or self._own is None:
            raise RuntimeError(f"{self.name}: not set up; call setup(node=node) before ticking")
        return self._backend, self._own

    def shutdown(self) -> None:
        if self._own is not None:
            self._own.close()
        self._own = self._backend = None
