"""The one timer of a node's simulated servers: steps what moves, and rings when a time has come.

Everything it calls runs under `lock`, one at a time. The timer is off while nothing moves and
nothing is due. It never blocks, and nothing that it calls can end the executor's spin: what raises
is logged and stepped no more.
"""

from __future__ import annotations

import contextlib
import heapq
import itertools
import math
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

from bt_actions.utilities.plain_text import raised

CATCH_UP = 0.25
"""Wall seconds a late timer makes up for. A process that was stopped for longer does not make its
robots jump: they go on where they were."""
SHORTEST_RING = 0.008
"""Wall seconds between two rings for steps: a higher speed makes more steps at once. Each ring has
the executor rebuild its wait set, which for 100 servers takes milliseconds."""
SHORTEST_WAIT = 0.0001


class Stepped(Protocol):
    """Something that moves."""

    def step(self, now: float) -> bool:
        """Move for one step of simulated time; return whether it still moves."""


class Stepper:
    """Calls `step` of everything that moves each `step_period` of simulated time."""

    def __init__(self, node: Node, *, speed: float = 1.0, step_period: float = 0.1) -> None:
        """Use one timer on `node`. `speed` is simulated seconds in one wall second."""
        for name, value in (("speed", speed), ("step_period", step_period)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be more than zero and finite, not {value!r}")
        self.node = node
        self.lock = threading.RLock()
        self.step_period = step_period
        self.group: CallbackGroup = MutuallyExclusiveCallbackGroup()
        """The servers' callbacks belong here too: a second thread would only wait for the lock."""
        self._wall_period = step_period / speed
        self._most_steps = max(1, math.ceil(CATCH_UP / self._wall_period))
        self._moving: dict[Stepped, None] = {}
        self._next_step = math.inf
        self._alarms: list[tuple[float, int, Callable[[float], None]]] = []
        self._counter = itertools.count()
        self._armed_for = math.inf
        self._last_ring = -math.inf
        self._closed = False
        self._timer = node.create_timer(
            self._wall_period,
            self._ring,
            callback_group=self.group,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
            autostart=False,
        )

    def now(self) -> float:
        """Return the steady clock's seconds, the clock of the journal."""
        return time.monotonic()

    def start(self, stepped: Stepped) -> None:
        """Step `stepped` from now on, until its `step` returns False."""
        with self.lock:
            if not self._moving:
                self._next_step = self.now() + self._wall_period
            self._moving[stepped] = None
            self._arm()

    def stop(self, stepped: Stepped) -> None:
        """Step it no more."""
        with self.lock:
            self._moving.pop(stepped, None)

    def call_at(self, when: float, callback: Callable[[float], None]) -> None:
        """Call `callback` with the time once the steady clock has reached `when`."""
        with self.lock:
            heapq.heappush(self._alarms, (when, next(self._counter), callback))
            self._arm()

    def close(self) -> None:
        """Stop for good. Safe while the executor spins and after it has stopped."""
        with self.lock:
            if self._closed:
                return
            self._closed = True
            self._moving.clear()
            self._alarms.clear()
            with contextlib.suppress(InvalidHandle):  # the node was destroyed before
                self._timer.cancel()
                self.node.destroy_timer(self._timer)

    def _ring(self) -> None:
        with self.lock:
            self._armed_for = math.inf
            if self._closed:
                return
            self._timer.cancel()
            now = self.now()
            while self._alarms and self._alarms[0][0] <= now:
                callback = heapq.heappop(self._alarms)[2]
                self._guarded(callback, now)
            steps = self._due_steps(now)
            if steps:
                self._last_ring = now
            for _ in range(steps):
                for stepped in list(self._moving):
                    if stepped in self._moving and not self._guarded(stepped.step, now):
                        self._moving.pop(stepped, None)
            self._arm()

    def _due_steps(self, now: float) -> int:
        if not self._moving or now < self._next_step:
            return 0
        steps = 1 + int((now - self._next_step) / self._wall_period)
        if steps > self._most_steps:
            self._next_step = now + self._wall_period
            return self._most_steps
        self._next_step += steps * self._wall_period
        return steps

    def _arm(self) -> None:
        """Set the timer to the next time something is due, or switch it off."""
        if self._closed:
            return
        due = math.inf
        if self._moving:
            due = max(self._next_step, self._last_ring + SHORTEST_RING)
        if self._alarms:
            due = min(due, self._alarms[0][0])
        if due == self._armed_for:
            return
        self._armed_for = due
        if due == math.inf:
            self._timer.cancel()
            return
        wait = max(due - self.now(), SHORTEST_WAIT)
        self._timer.timer_period_ns = int(wait * 1e9)
        self._timer.reset()

    def _guarded(self, function: Callable[[float], Any], now: float) -> Any:
        try:
            return function(now)
        except Exception as error:  # noqa: BLE001 - an exception in a timer callback ends spin()
            self.node.get_logger().error(
                f"simulation: {function.__qualname__} raised {raised(error)}"
            )
            return False
