"""Does a server that is in sight hear what one client asks, and does the client hear its answers?

Discovery may tell one side only: a server may have dropped a process that was stopped, or cut off,
for longer than its lease, and never take it in again (ros/rediscovery.py). It is shown then, and
what it is asked gets lost. Told of questions and answers; what takes a server long (a busy
executor) shows in the same way, so silence is no proof. Nor may it be filled with questions: a
server keeps the last ten requests of all its clients together, and answers no other. No ROS, no
thread, no clock of its own.
"""

from __future__ import annotations

import math

from bt_actions.goals.terms import NEVER

AT_ONCE, TWICE = (0.0,), (0.0, 3.0)
"""Seconds after which to ask. A new participant is asked in twice: it may be known to all only when
Fast DDS announces it the next time, after 3 s."""
UNRESPONSIVE_AFTER = 2.0
"""Seconds without an answer to any question until the server may not hear them;"""
TRIES = 2
"""so often is another way looked for while it is silent,"""
TRY_LASTS = 5.5
"""each for so many seconds;"""
TRY_AGAIN = 60.0
"""and then only after so many since the last."""
DOUBT_LASTS = 10.0
"""Seconds after a stall within which a way to be heard is found, if there is one."""


class Reachability:
    """The questions of one client that any server answers at once (seconds, steady clock)."""

    def __init__(self) -> None:
        self.heard = False
        """Whether any question was ever answered."""
        self._unanswered_since = math.inf
        self._ask_at: list[float] = []
        """When to ask just in order to be answered."""
        self._in_doubt_until = NEVER
        self._tries, self._tried_at = 0, NEVER

    def asked(self, now: float) -> None:
        """Take note of a question."""
        self._unanswered_since = min(now, self._unanswered_since)

    def answer_came(self, asked: float) -> None:
        """Take note of an answer to a question that was asked at this moment."""
        self.heard = True
        if asked >= self._unanswered_since:
            self._unanswered_since, self._ask_at, self._tries = math.inf, [], 0
            self._in_doubt_until = NEVER
        elif self._in_doubt_until > NEVER and not self._ask_at:
            self._ask_at = [asked]  # who answers what was asked before is not busy

    def doubt(self, now: float, ask_after: tuple[float, ...] = AT_ONCE) -> None:
        """Doubt what was heard before, as this process stood still: the server is to be asked.

        Where a doubt is open, the server has been asked already.
        """
        if not self.in_doubt(now):
            self._ask_at, self._tries = [now + seconds for seconds in ask_after], 0
        self._unanswered_since = now
        self._in_doubt_until = now + DOUBT_LASTS

    def in_doubt(self, now: float) -> float:
        """Return for how many seconds silence may mean this more than anything else; or 0."""
        return max(0.0, self._in_doubt_until - now)

    def take_question(self, now: float) -> bool:
        """Return whether to ask just in order to be answered; each question is due once."""
        if not self._ask_at or now < self._ask_at[0]:
            return False
        del self._ask_at[0]
        return True

    def tried(self, now: float) -> None:
        """Take note that another way is looked for from now on."""
        self._tries += 1
        self._tried_at = now

    def is_unresponsive(self, now: float) -> bool:
        """Return whether no question was answered for long, and another way may be looked for.

        Also while that is done.
        """
        if now - self._unanswered_since < UNRESPONSIVE_AFTER:
            return False
        return self._tries < TRIES or not TRY_LASTS <= now - self._tried_at < TRY_AGAIN
