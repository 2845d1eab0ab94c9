"""Does a server that is in sight hear what one client asks, and does the client hear its answers?

Discovery may tell one side only: a server may have dropped a process that was stopped, or cut off,
for longer than its lease, and never take it in again (ros/lookout.py). It is shown then, and what
it is asked gets lost. Told of questions and answers; what takes a server long (a result, a busy
executor) shows in the same way, so this is no proof. No ROS, no thread, no clock of its own.
"""

from __future__ import annotations

ASK_EVERY = 1.0
"""Seconds without an answer until it is worth another question."""
MUTE_AFTER = 2.0
"""Seconds without an answer to any question until the server may not hear them;"""
DOUBT_LASTS = 10.0
"""and, after a standstill, seconds within which a way to be heard is found, if there is one."""
NEVER = float("-inf")


class Hearing:
    """The questions of one client that any server answers at once (seconds, steady clock)."""

    def __init__(self) -> None:
        self._unanswered_since: float | None = None
        self._asked_at = NEVER
        self._in_doubt_until = NEVER
        self.heard = False
        """Whether any question was ever answered."""

    def asked(self, now: float) -> None:
        """Take note of a question."""
        self._asked_at = now
        if self._unanswered_since is None:
            self._unanswered_since = now

    def answered(self, asked: float) -> None:
        """Take note of an answer to a question that was asked at this moment."""
        self.heard = True
        if self._unanswered_since is not None and asked >= self._unanswered_since:
            self._unanswered_since, self._in_doubt_until = None, NEVER

    def doubt(self, now: float) -> None:
        """This process stood still: what was heard before proves nothing, and is to be asked."""
        self._unanswered_since, self._asked_at = now, NEVER
        self._in_doubt_until = now + DOUBT_LASTS

    def in_doubt(self, now: float) -> float:
        """Return for how many seconds silence may mean this more than anything else; or 0."""
        return max(0.0, self._in_doubt_until - now)

    @property
    def asks(self) -> bool:
        """Whether a question is open."""
        return self._unanswered_since is not None

    def wants_question(self, now: float) -> bool:
        """Whether it is time to ask something, just to be answered."""
        return self._unanswered_since is not None and now - self._asked_at >= ASK_EVERY

    def is_mute(self, now: float) -> bool:
        """Whether there has been a question, and no answer to any, for long."""
        since = self._unanswered_since
        return since is not None and now - since >= MUTE_AFTER
