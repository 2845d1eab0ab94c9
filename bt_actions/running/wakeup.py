"""What a thread sleeps on between two steps of a loop."""

from __future__ import annotations

import contextlib
import queue


class WakeUp:
    """Ends one thread's sleep; wake-ups that come before it coalesce."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[None] = queue.SimpleQueue()  # put() is safe in a handler
        self._is_set = False

    def set(self) -> None:
        """Wake it, or keep it from its next sleep; on any thread, and in a signal handler."""
        if not self._is_set:
            self._is_set = True
            self._queue.put(None)

    def sleep(self, seconds: float) -> None:
        """Sleep for so long, unless something wakes this thread."""
        with contextlib.suppress(queue.Empty):
            self._queue.get(seconds > 0.0, seconds)
        self._is_set = False
