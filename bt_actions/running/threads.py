"""What a runner's threads need: the one that a started run has, and what they sleep on."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable
from concurrent import futures

from py_trees.common import Status

from bt_actions.utilities.plain_text import raised


class StartedRun(threading.Thread):
    """A run on a thread of its own."""

    def __init__(self, work: Callable[[], Status], tell: Callable[[str], None]) -> None:
        """`work` is called on that thread; `future` has what came of it, and `tell` what it raised.

        So that this is known where nobody asks the future.
        """
        super().__init__(name="bt_actions-tree", daemon=True)
        self._work, self._tell = work, tell
        self.future = futures.Future[Status]()
        self.future.set_running_or_notify_cancel()

    def run(self) -> None:
        """Do what is to be done on this thread."""
        try:
            status = self._work()
        except BaseException as error:  # noqa: BLE001 - raised again by who waits for it
            self._tell(f"the tree that was started raised {raised(error)}")
            self.future.set_exception(error)
        else:
            self.future.set_result(status)


class WakeUp:
    """Ends one thread's sleep; wake-ups that come before it coalesce."""

    def __init__(self) -> None:
        self._queue = queue.SimpleQueue[None]()  # put() is safe in a handler
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
