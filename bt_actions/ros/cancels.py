"""The cancel requests of one line, of which only so many are under way at a time.

A server keeps the last ten requests of all its clients together and drops the others silently:
sixty goals that are interrupted in one moment would go on for a second, until they are canceled
again. So what is over waits here for an answer, or until one is not expected any more. It decides
nothing: who is to be canceled, and when again, is goal.py's. All under the one lock.
"""

from __future__ import annotations

from collections.abc import Callable

AT_MOST = 8
"""Requests of this process without an answer at one server: two places are left to others."""
ANSWERED_WITHIN = 1.0
"""Seconds until a request counts as lost, or its server as busy, and the next one is sent."""


class Cancels:
    """Whom to ask a server to cancel, first come first served."""

    def __init__(self, send: Callable[[bytes], None], under_way: Callable[[float], int]) -> None:
        """`send` sends one request; `under_way` counts those of all lines to the same server."""
        self._send = send
        self._all_under_way = under_way
        self._waiting: dict[bytes, None] = {}
        self._asked: dict[bytes, float] = {}  # when, without an answer since

    def ask(self, goal_id: bytes, now: float) -> None:
        """Ask to cancel this goal as soon as there is room (seconds, steady clock)."""
        self._waiting[goal_id] = None
        self.go_on(now)

    def answered(self, goal_id: bytes, now: float) -> None:
        """Take note of an answer."""
        self._asked.pop(goal_id, None)
        self.go_on(now)

    def forget(self, goal_id: bytes) -> None:
        """Ask no more for this goal."""
        self._waiting.pop(goal_id, None)
        self._asked.pop(goal_id, None)

    def forget_answers(self) -> None:
        """There will be none to what was asked so far."""
        self._asked.clear()

    def under_way(self, now: float) -> int:
        """Count the requests that may lie in the server's queue."""
        for goal_id in [each for each, at in self._asked.items() if now - at >= ANSWERED_WITHIN]:
            del self._asked[goal_id]
        return len(self._asked)

    def go_on(self, now: float) -> None:
        """Send what there is room for."""
        while self._waiting and self._all_under_way(now) < AT_MOST:
            goal_id = next(iter(self._waiting))
            del self._waiting[goal_id]
            self._asked[goal_id] = now
            self._send(goal_id)
