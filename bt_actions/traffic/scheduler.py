"""What is to be run, and when: the endpoints with open goals, ticks or not.

Decides when it wants to be run; whoever owns it (the alarm thread of ros/, or a loop in virtual
time) sleeps until then. As it never sleeps for long, it notices when the whole process stood still;
whether it did while no goal was open, nobody knows. No thread, and no clock of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from bt_actions.traffic.stalls import Stalls

AT_LEAST_EVERY = 0.2
"""Seconds; a clock that is not the steady one may run faster than anybody can know."""

SHORTEST = 0.001
"""Seconds of sleep in any case, should what is due stay due."""


class Scheduled(Protocol):
    """What is run when it is due: an endpoint, or a watchdog."""

    def run_due(self, now: float) -> float:
        """Do what is due and return the seconds until there is more."""


class Scheduler:
    """The endpoints with open goals; the caller holds the lock."""

    def __init__(
        self,
        steady: Callable[[], float],
        stalls: Stalls,
        wake: Callable[[], None],
        failed: Callable[[Scheduled, Exception], None],
    ) -> None:
        """`wake` is called when `run` is wanted earlier than it has said, or again after a rest.

        `failed` is told what an endpoint raised, which keeps no other from its turn.
        """
        self._steady, self._stalls = steady, stalls
        self._wake, self._failed = wake, failed
        self._open: dict[Scheduled, None] = {}  # in the order in which they came
        self.wakes_at = 0.0
        """When it wants to be run again (seconds, steady clock)."""

    def add(self, endpoint: Scheduled) -> None:
        """Run this one until it is removed."""
        if not self._open:
            self._wake()
        self._open[endpoint] = None

    def remove(self, endpoint: Scheduled) -> None:
        """Run it no more."""
        self._open.pop(endpoint, None)

    def clear(self) -> None:
        """Run nothing."""
        self._open.clear()

    @property
    def scheduled(self) -> list[Scheduled]:
        """Return the endpoints with open goals."""
        return list(self._open)

    def wake_by(self, moment: float) -> None:
        """See to it that it is run by `moment` (steady clock)."""
        if moment < self.wakes_at:
            self.wakes_at = moment
            self._wake()

    def run(self) -> None:
        """Run all, and say when to do so again (`wakes_at`)."""
        wait, self.wakes_at = AT_LEAST_EVERY, math.inf  # who asks meanwhile is heard
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
