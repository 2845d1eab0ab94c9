"""Notices that this process stood still: stopped (Ctrl-Z, a debugger, a frozen container), starved.

When it goes on, what was sent to it meanwhile is still on its way in, and a server whose lease has
run out here is out of sight until it announces itself again. So for a moment nobody may conclude
anything from what is missing. No ROS, no thread, no clock of its own, and it decides nothing; where
a machine is never in time, whoever asks must come to an end all the same (`AT_MOST`).
"""

from __future__ import annotations

from collections.abc import Callable

STOOD_STILL = 0.3
"""Seconds without a sign of life,"""
ANSWERS_TAKE = 1.0
"""and seconds, at most, until what was sent meanwhile has come in: twice as long as it stood still,
if that is less."""
ANSWERS_TAKE_IN_ALL = 3.0
"""Seconds for which one deadline waits for that, where stalls follow each other closely."""
OUT_OF_SIGHT = 1.5
"""Seconds without a sign of life from which on a lease may have run out: none that is useful is
shorter than 3 s, and each is renewed long before its end;"""
BACK_IN_SIGHT = 4.0
"""and seconds until all are in sight again: Fast DDS announces a process every 3 s or sooner."""
AT_MOST = 20
"""So many stalls are borne with by whoever has nothing else to go by."""
NEVER = float("-inf")


class Stalls:
    """What is to be borne with, after stalls, at any moment (seconds of the steady clock).

    Who asks lives: a question is a sign of life, too.
    """

    def __init__(
        self,
        take_busy: Callable[[], float] = lambda: 0.0,
        take_asleep: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """`take_busy` returns for how many seconds, since its last call, Python alone stood still.

        The rest of the process ran then, and has taken in what was sent to it. `take_asleep` does
        so for the whole machine: it was suspended, and the steady clock stood still with it.
        """
        self._take_busy, self._take_asleep = take_busy, take_asleep
        self.times = 0
        """How often this process stood still;"""
        self.long_times = 0
        """and how often for so long that who sees it may have lost sight of it, too."""
        self._lived_at: float | None = None
        self._rested_at: float | None = None
        self._answers_by = self._servers_by = NEVER

    def lives(self, now: float) -> None:
        """Take a sign of life; there are to be several a second."""
        busy, asleep = self._take_busy(), self._take_asleep()
        if self._rested_at is not None:
            self.long_times += now - self._rested_at + asleep > OUT_OF_SIGHT
            self._rested_at = None
        still = 0.0 if self._lived_at is None else now - self._lived_at - busy + asleep
        self._lived_at = now
        if still > STOOD_STILL:
            self.times += 1
            self._answers_by = max(self._answers_by, now + min(2 * still, ANSWERS_TAKE))
        if still > OUT_OF_SIGHT:
            self.long_times += 1
            self._servers_by = now + BACK_IN_SIGHT

    def rests(self, now: float) -> None:
        """There will be no sign of life for a while, of which nobody will know why.

        Where it is long enough, it counts as one of the `long_times`: whoever goes on then is to
        ask whether it is still heard. Nothing is held up for it, as nothing is under way.
        """
        self._lived_at, self._rested_at = None, now

    def answers_take(self, now: float) -> float:
        """Return for how many seconds answers may still be coming in that came in time; or 0."""
        self.lives(now)  # it may be the first to run again
        return max(0.0, self._answers_by - now)

    def servers_take(self, now: float) -> float:
        """Return for how many seconds a server may be out of sight that is there; or 0."""
        self.lives(now)
        return max(0.0, self._servers_by - now)


class Leniency:
    """Bears with one thing as long as stalls may be the cause, but with `AT_MOST` in a row."""

    def __init__(self) -> None:
        self._since: int | None = None

    def bears(self, still: Stalls, *, cause: bool) -> bool:
        """Whether to bear with it now; where there is no `cause` to, it begins anew."""
        if not cause:
            self._since = None
            return False
        if self._since is None:
            self._since = still.times
        return still.times - self._since < AT_MOST
