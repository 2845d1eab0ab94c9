"""Whether a server in sight hears one client, and the client hears the server.

Discovery may work in one direction only: a server may have dropped a process that was stopped, or
cut off, for longer than its lease, and never take that process in again (ros/rediscovery.py). Such
a server is shown, and requests to it are lost. The evidence is questions and answers. A server with
a busy executor is silent, too, so silence is no proof. Many questions would do harm: a server keeps
the last ten requests of all its clients together, and drops older ones. No ROS, no thread, no clock
of its own.
"""

from __future__ import annotations

import math

from bt_actions.goals.terms import NEVER

AT_ONCE, TWICE = (0.0,), (0.0, 3.0)
"""Seconds after which to ask. A new participant asks twice: all processes may know it only when
Fast DDS announces it the next time, after 3 s."""
UNRESPONSIVE_AFTER = 2.0
"""Seconds without an answer to any question until the server may not hear the client;"""
TRIES = 2
"""the number of searches for another way while the server is silent,"""
TRY_LASTS = 5.5
"""the seconds that each takes,"""
TRY_AGAIN = 60.0
"""and the seconds after the last one until the next begins all the same."""
DOUBT_LASTS = 10.0
"""Seconds after a stall within which a way to be heard is found, if one exists."""


class Reachability:
    """The questions of one client that any server answers at once (seconds, steady clock)."""

    def __init__(self) -> None:
        self.heard = False
        """Whether any question was ever answered."""
        self._unanswered_since = math.inf
        self._ask_at: list[float] = []
        """The moments of questions that are asked for an answer alone."""
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
            self._ask_at = [asked]  # a server that answers old questions is not busy

    def doubt(self, now: float, ask_after: tuple[float, ...] = AT_ONCE) -> None:
        """Doubt that the server still hears the client, as this process stood still.

        Ask the server.

        Where a doubt is open, the server has been asked already.
        """
        if not self.in_doubt(now):
            self._ask_at, self._tries = [now + seconds for seconds in ask_after], 0
        self._unanswered_since = now
        self._in_doubt_until = now + DOUBT_LASTS

    def in_doubt(self, now: float) -> float:
        """Return the seconds for which silence most likely means that no server hears us; or 0."""
        return max(0.0, self._in_doubt_until - now)

    def take_question(self, now: float) -> bool:
        """Return whether to ask a question for its answer alone; each question is due once."""
        if not self._ask_at or now < self._ask_at[0]:
            return False
        del self._ask_at[0]
        return True

    def tried(self, now: float) -> None:
        """Take note that the search for another way begins."""
        self._tries += 1
        self._tried_at = now

    def is_unresponsive(self, now: float) -> bool:
        """Return whether no question was answered for long, and another way may be looked for.

        True also while that search goes on.
        """
        if now - self._unanswered_since < UNRESPONSIVE_AFTER:
            return False
        return self._tries < TRIES or not TRY_LASTS <= now - self._tried_at < TRY_AGAIN
