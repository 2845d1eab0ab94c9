"""Virtual time: events in one queue of (time, order).

Time passes only from one entry to the next; entries of one moment happen in the order in which they
were made. No thread and no real clock, so a run is the same each time.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable


class Alarm:
    """An entry that may be called off."""

    __slots__ = ("work",)

    def __init__(self, work: Callable[[], object]) -> None:
        self.work: Callable[[], object] | None = work

    def cancel(self) -> None:
        """Call the entry off."""
        self.work = None


class Timeline:
    """A clock and its queue."""

    def __init__(self) -> None:
        self.now = 0.0
        """Seconds since the beginning."""
        self._queue: list[tuple[float, int, Alarm]] = []
        self._order = itertools.count()

    def __repr__(self) -> str:
        return f"<Timeline at {self.now:g} s, {len(self._queue)} to come>"

    def call_at(self, when: float, work: Callable[[], object]) -> Alarm:
        """Have `work` called at `when`, or at once where that is past."""
        alarm = Alarm(work)
        heapq.heappush(self._queue, (max(when, self.now), next(self._order), alarm))
        return alarm

    def call_in(self, seconds: float, work: Callable[[], object]) -> Alarm:
        """Have `work` called in so many seconds."""
        return self.call_at(self.now + seconds, work)

    def advance(self, until: float) -> bool:
        """Let the next event happen if it is due by `until`; otherwise set the time to `until`.

        Returns whether an event was due.
        """
        while self._queue and self._queue[0][0] <= until:
            when, _, alarm = heapq.heappop(self._queue)
            if alarm.work is not None:
                self.now = when
                alarm.work()
                return True
        self.now = max(self.now, until)
        return False
