"""The cancel requests to one server, of which only so many are under way at a time.

A server keeps the last ten requests of all its clients together and drops the others silently:
sixty goals that are interrupted in one moment would run for a second more, until they are canceled
again. So what is over waits here for an answer, or until one is not expected any more. Who
is to be canceled, and when again, is for goals/goal.py to decide. All under the one lock.
"""

from __future__ import annotations

from collections.abc import Callable

AT_MOST = 8
"""Requests of this process without an answer at one server: two places are left to others."""
ANSWERED_WITHIN = 1.0
"""Seconds until a request counts as lost, or its server as busy, and the next one is sent."""

Send = Callable[[bytes], bool]
"""Sends one request, and says whether it has left."""


class Cancels:
    """Whom to ask a server to cancel, of all endpoints to it, first come first served."""

    def __init__(self) -> None:
        self._waiting: dict[bytes, Send] = {}
        self._asked: dict[bytes, float] = {}  # when, without an answer since

    def ask(self, goal_id: bytes, send: Send, now: float) -> None:
        """Ask to cancel this goal as soon as there is room (seconds, steady clock)."""
        self._waiting[goal_id] = send
        self.send_more(now)

    def answered(self, goal_id: bytes, now: float) -> None:
        """Take note of an answer."""
        self._asked.pop(goal_id, None)
        self.send_more(now)

    def forget(self, goal_id: bytes) -> None:
        """Ask no more for this goal."""
        self._waiting.pop(goal_id, None)
        self._asked.pop(goal_id, None)

    def has_request(self, goal_id: bytes) -> bool:
        """Whether a request for this goal waits for room."""
        return goal_id in self._waiting

    def send_now(self, goal_id: bytes) -> None:
        """Send what waits for this goal, room or not: there may be no other time."""
        send = self._waiting.pop(goal_id, None)
        if send is not None:
            send(goal_id)

    def send_more(self, now: float) -> None:
        """Send what there is room for."""
        for goal_id in [each for each, at in self._asked.items() if now - at >= ANSWERED_WITHIN]:
            del self._asked[goal_id]
        while self._waiting and len(self._asked) < AT_MOST:
            goal_id = next(iter(self._waiting))
            if self._waiting.pop(goal_id)(goal_id):
                self._asked[goal_id] = now
