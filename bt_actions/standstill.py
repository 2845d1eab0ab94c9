"""Notices that this process stood still: stopped (Ctrl-Z, a debugger, a frozen container), starved.

When it goes on, what was sent to it meanwhile is still on its way in, and a server whose lease has
run out here is out of sight until it announces itself again. So for a moment nobody may conclude
anything from what is missing. No ROS, no thread, no clock of its own, and it decides nothing.
"""

from __future__ import annotations

STOOD_STILL = 0.5
"""Seconds without a sign of life,"""
ANSWERS_TAKE = 1.0
"""and seconds until what was sent meanwhile has come in."""
OUT_OF_SIGHT = 1.5
"""Seconds without a sign of life from which on a lease may have run out: none that is useful is
shorter than 3 s, and each is renewed long before its end;"""
BACK_IN_SIGHT = 4.0
"""and seconds until all are in sight again: Fast DDS announces a process every 3 s or sooner."""
IN_A_ROW = 20
"""So many standstills count, with less than `CALM` seconds of life between them: where a machine is
never in time, what is due must take effect all the same."""
CALM = 5.0
NEVER = float("-inf")


class _Grace:
    """How long something is borne with after standstills of a certain length."""

    def __init__(self, longer_than: float, seconds: float) -> None:
        self._longer_than, self._seconds = longer_than, seconds
        self._until = self._last = NEVER
        self._in_a_row = 0

    def stood_still(self, seconds: float, now: float) -> None:
        if seconds <= self._longer_than:
            return
        self._in_a_row = self._in_a_row + 1 if now - seconds - self._last < CALM else 1
        self._last = now
        if self._in_a_row <= IN_A_ROW:
            self._until = now + self._seconds

    def left(self, now: float) -> float:
        return max(0.0, self._until - now)


class Standstill:
    """What is to be borne with, after standstills, at any moment (seconds of the steady clock)."""

    def __init__(self) -> None:
        self._lived_at: float | None = None
        self._answers = _Grace(STOOD_STILL, ANSWERS_TAKE)
        self._servers = _Grace(OUT_OF_SIGHT, BACK_IN_SIGHT)

    def lives(self, now: float) -> None:
        """Take a sign of life; there are to be several a second."""
        still = 0.0 if self._lived_at is None else now - self._lived_at
        self._lived_at = now
        self._answers.stood_still(still, now)
        self._servers.stood_still(still, now)

    def rests(self) -> None:
        """There will be no sign of life for a while, which means nothing."""
        self._lived_at = None

    def answers_take(self, now: float) -> float:
        """Return for how many seconds answers may still be coming in that came in time; or 0."""
        self.lives(now)  # whoever asks may be the first to run again
        return self._answers.left(now)

    def servers_take(self, now: float) -> float:
        """Return for how many seconds a server may be out of sight that is there; or 0."""
        self.lives(now)
        return self._servers.left(now)
