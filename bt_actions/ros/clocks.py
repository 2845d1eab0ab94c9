"""The two clocks of a node as seconds: the steady one, and the node's own.

Without simulated time the node's own clock is the steady one too, so a change of the wall clock
moves no deadline. Holds no deadline itself.
"""

from __future__ import annotations

import math
import threading
import time
from typing import Any

from bt_actions.goals.terms import Now
from bt_actions.ros.log import log

MOMENT = 2.0
"""Seconds without simulated time after which a warning follows."""


class Clocks:
    """Reads both clocks of one node; a change to simulated time and back leaves no jump."""

    def __init__(self, node: Any) -> None:
        self._clock = node.get_clock()
        self._lock = threading.RLock()  # a signal handler may ask, too
        self._simulated = False
        self._offset = 0.0
        self._last = time.monotonic()
        self._warn_at = 0.0  # of a silent /clock; 0: no wait yet

    def now(self) -> Now:
        """Return this moment."""
        with self._lock:  # two threads that find time simulated must not both make up for it
            steady = time.monotonic()
            simulated, reading = False, steady
            try:
                if self._clock.ros_time_is_active:
                    simulated, reading = True, self._clock.now().nanoseconds * 1e-9
                    if reading == 0.0:  # no /clock message yet: time stands still
                        self._waits(steady)
                        return Now(steady, self._last)
            except Exception:  # noqa: BLE001 - the node was destroyed: InvalidHandle, or worse
                simulated = False
            if simulated != self._simulated:
                self._simulated = simulated
                self._offset = self._last - reading
            self._last = reading + self._offset
            return Now(steady, self._last)

    def stamp(self) -> int:
        """Return the node's own clock in nanoseconds, as the headers of messages have it."""
        with (handle := self._clock.handle):  # `now` makes objects for three times the time
            return int(handle.get_now().nanoseconds)

    def _waits(self, steady: float) -> None:
        self._warn_at = self._warn_at or steady + MOMENT
        if steady > self._warn_at:
            self._warn_at = math.inf
            log.warning(
                f"use_sim_time is set, and no message has come on /clock for {MOMENT:g} s: time "
                "does not pass for waiting nodes before the first one; does the simulator run?"
            )
