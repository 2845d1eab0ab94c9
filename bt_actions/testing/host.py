"""The Host of traffic/state.py in virtual time, for the goals of one played process.

All happens on one thread, so nothing has to be guarded; ids come from a seed, and a bug of ours
raises where it happens.
"""

from __future__ import annotations

import random
from contextlib import nullcontext

from bt_actions.testing.network import Lines
from bt_actions.testing.timeline import Alarm, Timeline
from bt_actions.traffic.scheduler import Scheduled, Scheduler
from bt_actions.traffic.stalls import Stalls
from bt_actions.traffic.state import Domain, Record, Trace


class VirtualHost:
    """The host of one played process."""

    def __init__(self, timeline: Timeline, log: Lines, seed: int = 0) -> None:
        self.lock = nullcontext()
        self.log = log
        self.record = Record()
        self.stalls = Stalls()
        self.scheduler = Scheduler(self.steady, self.stalls, self._wake, self._failed)
        self.trace = Trace()
        self.forks = 0
        self.closing = False
        self.randomness = random.Random(seed)
        self._timeline = timeline
        self._domains: dict[int, Domain] = {}
        self._alarm: Alarm | None = None
        self._due = 0.0
        self._runs = False

    def domain(self, number: int) -> Domain:
        return self._domains.setdefault(number, Domain())

    def steady(self) -> float:
        return self._timeline.now

    wall = steady

    def new_goal_id(self) -> bytes:
        return self.randomness.randbytes(16)

    def wait(self, timeout: float) -> bool:
        """Let the next event happen that is due within `timeout` seconds."""
        return self._timeline.advance(self._timeline.now + timeout)

    def notify_all(self) -> None:
        """Do nothing: a waiting drain looks again after each event."""

    # The alarm

    def _wake(self) -> None:
        if self._runs:
            return
        due = self._timeline.now
        if self._alarm is None:
            self.stalls.lives(due)
        elif self.scheduler.wakes_at < self._due:
            due = max(due, self.scheduler.wakes_at)
        self._set(due)

    def _run(self) -> None:
        self._runs = True
        self.scheduler.run()
        self._runs = False
        if self.scheduler.scheduled:
            self._set(self.scheduler.wakes_at)
        else:
            self._alarm = None
            self.stalls.rests(self._timeline.now)

    def _set(self, due: float) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
        self._due = due
        self._alarm = self._timeline.call_at(due, self._run)

    def _failed(self, endpoint: Scheduled, error: Exception) -> None:
        raise error
