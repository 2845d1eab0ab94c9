"""What a runner's threads need: the one that a started run has, and what they sleep on."""

from __future__ import annotations

import contextlib
import contextvars
import os
import queue
import threading
from collections.abc import Callable
from concurrent import futures
from functools import partial

from py_trees.common import Status

from bt_actions.utilities.plain_text import raised

LINGER = 5.0
"""Seconds that a thread waits for another run: to start one takes as long as to send a goal."""


_AT_REST = "bt_actions-rest"
_at_rest: list[queue.SimpleQueue[Callable[[], None]]] = []
"""What threads without a run wait at."""
os.register_at_fork(after_in_child=_at_rest.clear)  # they are the parent's


def _work(given: queue.SimpleQueue[Callable[[], None]]) -> None:
    """Do one thing after another, and end after a while in which nobody had any."""
    while True:
        try:
            given.get(timeout=LINGER)()
        except queue.Empty:
            with contextlib.suppress(ValueError):  # somebody has just taken it
                return _at_rest.remove(given)
        else:
            _at_rest.append(given)


class StartedRun:
    """A run on a thread that has no other meanwhile."""

    def __init__(self, work: Callable[[], Status], tell: Callable[[str], None]) -> None:
        """`work` is called on that thread; `future` has what came of it, and `tell` what it raised.

        So that this is known where nobody asks the future.
        """
        self._work, self._tell = work, tell
        self._thread: threading.Thread | None = None
        self._over = threading.Event()
        self.future = futures.Future[Status]()
        self.future.set_running_or_notify_cancel()

    def start(self) -> None:
        """Begin; raises RuntimeError where there can be no more threads."""
        run = partial(contextvars.Context().run, self._run)
        try:
            _at_rest.pop().put(run)
        except IndexError:
            given = queue.SimpleQueue[Callable[[], None]]()
            given.put(run)  # first: SIGINT may break off the wait for the thread
            threading.Thread(target=_work, args=[given], name=_AT_REST, daemon=True).start()

    def join(self) -> None:
        """Wait until all done callbacks have returned; not in one of them."""
        if self._thread is not threading.current_thread():
            self._over.wait()

    def _run(self) -> None:
        self._thread = thread = threading.current_thread()
        thread.name = "bt_actions-tree"
        try:
            status = self._work()
        except BaseException as error:  # noqa: BLE001 - raised again by who waits for it
            self._tell(f"the tree that was started raised {raised(error)}")
            self.future.set_exception(error)
        else:
            self.future.set_result(status)
        finally:
            thread.name = _AT_REST
            self._over.set()


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
