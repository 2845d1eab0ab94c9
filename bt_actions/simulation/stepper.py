"""The one timer of simulated servers, which steps motions and calls at due times.

Every call runs under `lock`, one at a time. The timer is off while nothing moves and nothing is
due. The stepper never blocks, and no call can end the executor's spin: an error is logged, and its
motion is stepped no more.
"""

from __future__ import annotations

import heapq
import itertools
import math
import threading
from collections.abc import Callable
from typing import Any

from bt_actions.simulation.platform import Platform
from bt_actions.utilities.plain_text import raised

CATCH_UP = 0.25
"""Wall seconds that a late timer makes up for. The robots of a process that was stopped for
longer do not jump: they go on where they were."""
SHORTEST_RING = 0.008
"""Wall seconds between two rings for steps: a higher speed makes more steps at once. At each
ring the executor rebuilds its wait set, which for 100 servers takes milliseconds."""

Step = Callable[[float], bool]


class Stepper:
    """The caller of all motions' steps, once in each `step_period` of simulated time."""

    def __init__(self, platform: Platform, *, speed: float = 1.0, step_period: float = 0.1) -> None:
        """Use one timer of `platform`. `speed` is simulated seconds in one wall second."""
        for name, value in (("speed", speed), ("step_period", step_period)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be more than zero and finite, not {value!r}")
        self.platform = platform
        self.speed = speed
        self.lock = threading.RLock()
        self.step_period = step_period
        self._wall_period = step_period / speed
        self._most_steps = max(1, math.ceil(CATCH_UP / self._wall_period))
        self._moving: dict[Step, None] = {}
        self._since, self._made = 0.0, 0  # when the motion began, and the steps since then
        self._alarms: list[tuple[float, int, Callable[[float], None]]] = []
        self._counter = itertools.count()
        self._armed_for = math.inf
        self._last_ring = -math.inf
        self._closed = False
        self._timer = platform.timer(self._ring)

    def now(self) -> float:
        """Return the seconds of the platform's steady clock."""
        return self.platform.now()

    def start(self, step: Step) -> None:
        """Call `step` from now on with the time, until it returns False: nothing moves any more."""
        with self.lock:
            if not self._moving:
                self._since, self._made = self.now(), 0
            self._moving[step] = None
            self._arm()

    def stop(self, step: Step) -> None:
        """Call this step no more."""
        with self.lock:
            self._moving.pop(step, None)

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
            self._timer.destroy()

    def _ring(self) -> None:
        with self.lock:
            self._armed_for = math.inf
            if self._closed:
                return
            now = self.now()
            while self._alarms and self._alarms[0][0] <= now:
                callback = heapq.heappop(self._alarms)[2]
                self._guarded(callback, now)
            steps = self._due_steps(now)
            if steps:
                self._last_ring = now
            for _ in range(steps):
                for step in list(self._moving):
                    if step in self._moving and not self._guarded(step, now):
                        self._moving.pop(step, None)
            self._arm()

    def _due_steps(self, now: float) -> int:
        if not self._moving or now < self._next_step:
            return 0
        steps = 1 + int((now - self._next_step) / self._wall_period)
        if steps > self._most_steps:
            self._since, self._made = now, 0
            return self._most_steps
        self._made += steps
        return steps

    @property
    def _next_step(self) -> float:
        return self._since + (self._made + 1) * self._wall_period

    def _arm(self) -> None:
        """Set the timer to the next due time, or switch it off."""
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
        self._timer.set(None if due == math.inf else due)

    def _guarded(self, function: Callable[[float], Any], now: float) -> Any:
        try:
            return function(now)
        except Exception as error:  # noqa: BLE001 - an exception in a timer callback ends spin()
            name = getattr(function, "__qualname__", function)
            self.platform.log.error(f"simulation: {name} raised {raised(error)}")
            return False
