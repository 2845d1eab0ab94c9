"""The stalls of this process: Ctrl-Z, a debugger, a frozen container, a starved machine.

The problem: a deadline passes while the process stands still, and the answer lies in a socket that
nobody has read. A server's lease may run out here at the same time, though the server lives. At the
first moment after a stall, silence therefore proves nothing.

The rule: every sleep announces its end (`sleeps`), and every step is a sign of life (`lives`). A
sign of life that comes more than 0.3 s late is the end of a stall. A grace follows, in which nobody
draws a conclusion from silence: 1 s for answers, and, after a stall in which a lease may have run
out, 4 s for servers. Three stalls in a row get a grace, and the fourth gets none.

Why that is enough: answers of the stall's time wait on this machine, and are read within the grace.
A server that discovery has dropped announces itself every 3 s. The bound on stalls in a row lets
deadlines pass even in a process that is never in time. `long_times` counts the long stalls: after
one, other processes may have dropped this one, and reachability.py asks whether they hear it.

No ROS, no thread, no clock of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from bt_actions.servers.reachability import DOUBT_LASTS

STOOD_STILL = 0.3
"""Seconds of lateness from which on a late sign of life ends a stall,"""
ANSWERS_TAKE = 1.0
"""and seconds, at most, until the answers of that time have come in."""
OUT_OF_SIGHT = 1.5
"""Seconds of lateness from which on a lease may have run out: no useful lease is shorter than 3 s,
and each is renewed long before its end;"""
BACK_IN_SIGHT = 4.0
"""and seconds until all servers are in sight again: Fast DDS announces a process every 3 s or
sooner."""
IN_A_ROW = 3
"""Stalls that follow each other closely and get a grace each; the next one gets none."""


class _Grace:
    """Some seconds after a stall; stalls less than `calm` seconds apart are in a row."""

    def __init__(self, seconds: float, calm: float) -> None:
        self._seconds, self._calm = seconds, calm
        self._row, self._stalled_until, self._ends_at = 0, -math.inf, -math.inf

    def begin(self, since: float, now: float) -> bool:
        """Begin after a stall from `since` until `now`; return False after too many in a row."""
        self._row = self._row + 1 if since - self._stalled_until < self._calm else 1
        self._stalled_until = now
        if self._row > IN_A_ROW:
            return False
        self._ends_at = now + self._seconds
        return True

    def left(self, now: float) -> float:
        return max(0.0, self._ends_at - now)


class Stalls:
    """The graces after stalls, at any moment (seconds of the steady clock)."""

    def __init__(
        self,
        idle: Callable[[float], float] = lambda now: now,
        clock: Callable[[float], float] = lambda now: now,
    ) -> None:
        """Make the record of a process that has not stood still.

        `idle` returns the seconds in which this process did nothing, asleep or stopped. `clock`
        returns the present moment: a caller may have read the clock before a stall. A garbage
        collection is work and no stall: the middleware's own threads go on.
        """
        self.long_times = 0
        """The number of stalls so long that other processes may have lost sight of this one."""
        self._idle, self._clock = idle, clock
        self._due = math.inf  # the end of the announced sleep, on the idle clock
        self._rests_since = math.inf
        self._answers = _Grace(ANSWERS_TAKE, calm=ANSWERS_TAKE)
        self._servers = _Grace(BACK_IN_SIGHT, calm=DOUBT_LASTS)

    def lives(self, now: float) -> float:
        """Take a sign of life; return the seconds of the stall that ends, if it gets a grace."""
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

        A long rest counts as one of the `long_times`: the next user is to ask whether servers hear
        this process. A rest gets no grace, as nothing is under way.
        """
        self._due, self._rests_since = math.inf, now

    def answers_take(self, now: float) -> float:
        """Return the seconds in which answers that came in time may still be read; or 0."""
        self.lives(now)  # this call may be the first sign of life after a stall
        return self._answers.left(now)

    def servers_take(self, now: float) -> float:
        """Return the seconds in which a living server may be out of sight; or 0."""
        self.lives(now)
        return self._servers.left(now)
