"""The scheduler of endpoints with open goals: it runs them when they are due, ticks or not.

The owner of the scheduler, the alarm thread of ros/ or a loop in virtual time, sleeps until
`wakes_at`. The sleeps are short, so that the owner notices a stall of the process; without open
goals a stall stays unknown. No thread, and no clock of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from bt_actions.traffic.stalls import Stalls

AT_LEAST_EVERY = 0.2
"""Seconds between two runs, at most; a clock other than the steady one may run at any speed."""

SHORTEST = 0.001
"""Seconds of sleep in any case, should a due endpoint stay due."""


class Scheduled(Protocol):
    """An endpoint, or a watchdog, that is run when due."""

    def run_due(self, now: float) -> float:
        """Do what is due and return the seconds until more is due."""


class Scheduler:
    """The endpoints with open goals; the caller holds the lock."""

    def __init__(
        self,
        steady: Callable[[], float],
        stalls: Stalls,
        wake: Callable[[], None],
        failed: Callable[[Scheduled, Exception], None],
    ) -> None:
        """Make a scheduler; `wake` is called when `run` is wanted early, or again after a rest.

        `failed` gets the error of an endpoint, which keeps no other endpoint from its turn.
        """
        self._steady, self._stalls = steady, stalls
        self._wake, self._failed = wake, failed
        self._open: dict[Scheduled, None] = {}  # in the order in which they came
        self.wakes_at = 0.0
        """The moment of the next run (seconds, steady clock)."""

    def add(self, endpoint: Scheduled) -> None:
        """Run this endpoint until it is removed."""
        if not self._open:
            self._wake()
        self._open[endpoint] = None

    def remove(self, endpoint: Scheduled) -> None:
        """Run this endpoint no more."""
        self._open.pop(endpoint, None)

    def clear(self) -> None:
        """Remove all endpoints."""
        self._open.clear()

    @property
    def scheduled(self) -> list[Scheduled]:
        """The endpoints with open goals."""
        return list(self._open)

    def wake_by(self, moment: float) -> None:
        """Have the next run come by `moment` (steady clock)."""
        if moment < self.wakes_at:
            self.wakes_at = moment
            self._wake()

    def run(self) -> None:
        """Run all endpoints, and set the moment of the next run (`wakes_at`)."""
        wait, self.wakes_at = AT_LEAST_EVERY, math.inf  # a `wake_by` meanwhile counts
        for endpoint in self.scheduled:
            self._stalls.lives(self._steady())  # each look takes its time
            try:
                wait = min(wait, endpoint.run_due(self._steady()))
            except Exception as error:  # noqa: BLE001 - the last guard of every deadline
                self._failed(endpoint, error)
        now = self._steady()
        self.wakes_at = max(now + SHORTEST, min(now + wait, self.wakes_at))
        self._stalls.lives(now)
        self._stalls.sleeps(now, self.wakes_at)
