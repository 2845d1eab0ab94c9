"""What a runner's threads need: the one that a started run has, and what they sleep on."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable
from concurrent import futures

from py_trees.common import Status


class StartedRun(threading.Thread):
    """A run on a thread of its own."""

    def __init__(self, work: Callable[[], Status]) -> None:
        """`work` is called on that thread; `future` tells what came of it."""
        super().__init__(name="bt_actions-tree", daemon=True)
        self._work = work
        self.future = futures.Future[Status]()
        self.future.set_running_or_notify_cancel()

    def run(self) -> None:
        """Do what is to be done on this thread."""
        try:
            status = self._work()
        except BaseException as error:  # noqa: BLE001 - raised again by who waits for it
            self.future.set_exception(error)
        else:
            self.future.set_result(status)


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
