"""Notices that this process stood still: stopped (Ctrl-Z, a debugger, a frozen container), starved.

Whoever sleeps knows when it meant to wake; more than 0.3 s late is a stall. What was sent meanwhile
is still on its way in then, and a server whose lease has run out here is out of sight until it
announces itself again. So for a moment nobody may conclude anything from what is missing; and not
for ever, where a process is never in time. No ROS, no thread, no clock of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from bt_actions.servers.reachability import DOUBT_LASTS

STOOD_STILL = 0.3
"""Seconds of being late from which on it is a stall,"""
ANSWERS_TAKE = 1.0
"""and seconds, at most, until what was sent meanwhile has come in."""
OUT_OF_SIGHT = 1.5
"""Seconds of being late from which on a lease may have run out: none that is useful is shorter than
3 s, and each is renewed long before its end;"""
BACK_IN_SIGHT = 4.0
"""and seconds until all are in sight again: Fast DDS announces a process every 3 s or sooner."""
IN_A_ROW = 3
"""So many stalls that follow each other closely are borne with, and no more."""


class _Grace:
    """Some seconds after a stall; with less than `calm` seconds between them they are in a row."""

    def __init__(self, seconds: float, calm: float) -> None:
        self._seconds, self._calm = seconds, calm
        self._row, self._stalled_until, self._ends_at = 0, -math.inf, -math.inf

    def begin(self, since: float, now: float) -> bool:
        """Begin after a stall from `since` until `now`; not if there were too many in a row."""
        self._row = self._row + 1 if since - self._stalled_until < self._calm else 1
        self._stalled_until = now
        if self._row > IN_A_ROW:
            return False
        self._ends_at = now + self._seconds
        return True

    def left(self, now: float) -> float:
        return max(0.0, self._ends_at - now)


class Stalls:
    """The time to wait for, after stalls, at any moment (seconds of the steady clock)."""

    def __init__(
        self,
        idle: Callable[[float], float] = lambda now: now,
        clock: Callable[[float], float] = lambda now: now,
    ) -> None:
        """`idle` returns the seconds in which this process did nothing, asleep or stopped.

        `clock` returns the moment that it is: a caller may have looked at it before a stall.
        A garbage collection is no stall, as it is work: the middleware's own threads go on.
        """
        self.long_times = 0
        """How often this process stood still for so long that others may have lost sight of it."""
        self._idle, self._clock = idle, clock
        self._due = math.inf  # by when, on the idle clock, it means to live again
        self._rests_since = math.inf
        self._answers = _Grace(ANSWERS_TAKE, calm=ANSWERS_TAKE)
        self._servers = _Grace(BACK_IN_SIGHT, calm=DOUBT_LASTS)

    def lives(self, now: float) -> float:
        """Take a sign of life; return for how many seconds it stood still, if it is borne with."""
        now = self._clock(now)
        idle, borne = self._idle(now), 0.0
        if self._due == math.inf:
            self.long_times += now - self._rests_since > OUT_OF_SIGHT
            self._due = idle
        late = idle - self._due
        if late > STOOD_STILL and self._answers.begin(now - late, now):
            borne = late
        if late > OUT_OF_SIGHT and self._servers.begin(now - late, now):
            borne = late
            self.long_times += 1
        self._due = max(self._due, idle)
        return borne

    def sleeps(self, now: float, until: float) -> None:
        """Expect the next sign of life by `until`."""
        self._due = self._idle(now) + until - now

    def rests(self, now: float) -> None:
        """Expect no sign of life for a while.

        A rest that is long enough counts as one of the `long_times`: whoever goes on then is to ask
        whether it is still heard. Nothing is held up for it, as nothing is under way.
        """
        self._due, self._rests_since = math.inf, now

    def answers_take(self, now: float) -> float:
        """Return for how many seconds answers may still be coming in that came in time; or 0."""
        self.lives(now)  # whoever asks may be the first to run again
        return self._answers.left(now)

    def servers_take(self, now: float) -> float:
        """Return for how many seconds a server may be out of sight that is there; or 0."""
        self.lives(now)
        return self._servers.left(now)
