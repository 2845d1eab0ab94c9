"""For how long the whole machine was suspended, in which the steady clock stands still, too.

Servers on other machines go on meanwhile and may drop this process. Judges nothing
(servers/stalls.py).
"""

from __future__ import annotations

import time
from collections.abc import Callable

AT_ONCE = 0.001
"""Seconds within which both clocks are read, or the reading is worth nothing: the thread may be put
to sleep in between."""
SHORTEST = 0.01
"""Seconds; less is not a machine that was suspended."""


def _boot_time() -> float:
    """Return the seconds since the machine was started, also those in which it was suspended."""
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if clock is None else time.clock_gettime(clock)


class Suspended:
    """The time for which the machine was suspended, since it was last taken."""

    def __init__(
        self,
        steady: Callable[[], float] = time.monotonic,
        boot: Callable[[], float] = _boot_time,
    ) -> None:
        """Read these clocks (seconds)."""
        self._steady, self._boot = steady, boot
        self._in_all = self._read()

    def take(self) -> float:
        """Return the seconds since the last call for which the machine was suspended."""
        before, now = self._in_all, self._read()
        if now is None:
            return 0.0
        self._in_all = now
        return now - before if before is not None and now - before > SHORTEST else 0.0

    def _read(self) -> float | None:
        """Return how far the clocks are apart; or None, where the next reading is to tell."""
        first, boot, last = self._steady(), self._boot(), self._steady()
        return None if last - first > AT_ONCE else boot - first
