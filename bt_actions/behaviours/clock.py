"""Time for waiting leaves: the node's clock where there is a node, the steady clock elsewhere."""

from __future__ import annotations

import time
from typing import Any

from bt_actions.traffic.backend import Clock
from bt_actions.wiring import backend_of

__all__ = ["Countdown", "NodeTime"]


class NodeTime:
    """Seconds on the clock of the node that a tree was set up with."""

    def __init__(self) -> None:
        self._clock: Clock | None = None

    def setup(self, node: Any) -> None:
        """Read `node`'s clock from now on; None keeps to the steady clock."""
        self._clock = None if node is None else backend_of(node).clock

    def now(self) -> float:
        return time.monotonic() if self._clock is None else self._clock.now().ros


class Countdown:
    """Seconds that run out; a clock that jumps back leaves what remained."""

    def __init__(self, clock: NodeTime) -> None:
        self._clock = clock
        self._left = 0.0
        self._seen = 0.0

    def start(self, seconds: float) -> None:
        """Begin anew."""
        self._left = seconds
        self._seen = self._clock.now()

    def left(self) -> float:
        """The seconds that remain; zero when they have run out."""
        now = self._clock.now()
        self._left = max(0.0, self._left - max(0.0, now - self._seen))
        self._seen = now
        return self._left
