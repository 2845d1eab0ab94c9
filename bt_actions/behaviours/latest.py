"""The latest message of a topic, for who reads or waits for one. Touches nothing of the tree."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

from bt_actions.messages.interfaces import interface
from bt_actions.traffic.backend import Backend

KEPT = 100
"""Messages kept for who waits for one of them; older ones are dropped."""


class Latest:
    """The latest message, and how old it is on the node's clock.

    A clock that jumps back makes no message younger, and none older.
    """

    def __init__(self, backend: Backend, message_type: type | str, topic: str, qos: str) -> None:
        self.backend = backend
        self._lock = threading.Lock()
        self._message: Any = None
        self._age = 0.0
        self._aged_at = 0.0
        self._kept: deque[Any] | None = None
        self.came = 0
        """How many messages have come."""
        kind = interface(message_type, "msg")
        self._subscription = backend.subscription(kind, topic, qos, self._take)
        self.topic = self._subscription.topic
        self.why_silent = self._subscription.why_silent
        self.close = self._subscription.close

    def get(self) -> tuple[Any, float]:
        """The message (None before the first), and its age in seconds."""
        now = self.backend.clock.now().ros
        with self._lock:
            self._age += max(0.0, now - self._aged_at)
            self._aged_at = now
            return self._message, self._age

    def first_may_come(self) -> float:
        """Seconds for which a message may be on its way though none has come; 0 afterwards."""
        return 0.0 if self.came else self._subscription.first_may_come()

    def keep(self, *, with_latest: bool = False) -> None:
        """From now on keep each message for `take`, the newest hundred."""
        with self._lock:
            self._kept = deque(maxlen=KEPT)
            if with_latest and self._message is not None:
                self._kept.append(self._message)

    def take(self) -> list[Any]:
        """What came since `keep`, or the last `take`, in its order."""
        with self._lock:
            taken = list(self._kept or ())
            if self._kept is not None:
                self._kept.clear()
            return taken

    def keep_no_more(self) -> None:
        """Nobody waits any longer."""
        with self._lock:
            self._kept = None

    def _take(self, message: Any) -> None:
        now = self.backend.clock.now().ros
        with self._lock:
            self._message = message
            self._age, self._aged_at = 0.0, now
            self.came += 1
            if self._kept is not None:
                self._kept.append(message)
        self.backend.wake()
