"""The threads of a runner: one for a started run, and the object that a thread sleeps on."""

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
"""Seconds that a thread waits for another run: a new thread takes as long as the send of a goal."""


_AT_REST = "bt_actions-rest"
_at_rest: list[queue.SimpleQueue[Callable[[], None]]] = []
"""The queues of threads without a run."""
os.register_at_fork(after_in_child=_at_rest.clear)  # the threads are the parent's


def _work(given: queue.SimpleQueue[Callable[[], None]]) -> None:
    """Do one job after another, and end after a while without one."""
    while True:
        try:
            given.get(timeout=LINGER)()
        except queue.Empty:
            with contextlib.suppress(ValueError):  # a run has just taken the queue
                return _at_rest.remove(given)
        else:
            _at_rest.append(given)


class StartedRun:
    """A run on a thread that has no other run meanwhile."""

    def __init__(self, work: Callable[[], Status], tell: Callable[[str], None]) -> None:
        """Make a run; `work` is called on the thread, `future` has its result.

        `tell` gets the error of `work`, so that an error is known where nobody asks the future.
        """
        self._work, self._tell = work, tell
        self._thread: threading.Thread | None = None
        self._over = threading.Event()
        self.future = futures.Future[Status]()
        self.future.set_running_or_notify_cancel()

    def start(self) -> None:
        """Begin; raises RuntimeError where no more threads are possible."""
        run = partial(contextvars.Context().run, self._run)
        try:
            _at_rest.pop().put(run)
        except IndexError:
            given = queue.SimpleQueue[Callable[[], None]]()
            given.put(run)  # first: SIGINT may break off the wait for the thread
            threading.Thread(target=_work, args=[given], name=_AT_REST, daemon=True).start()

    def join(self) -> None:
        """Wait until all done callbacks have returned; within one of them, return at once."""
        if self._thread is not threading.current_thread():
            self._over.wait()

    def _run(self) -> None:
        self._thread = thread = threading.current_thread()
        thread.name = "bt_actions-tree"
        try:
            status = self._work()
        except BaseException as error:  # noqa: BLE001 - raised again by the future
            self._tell(f"the tree that was started raised {raised(error)}")
            self.future.set_exception(error)
        else:
            self.future.set_result(status)
        finally:
            thread.name = _AT_REST
            self._over.set()


class WakeUp:
    """The end of one thread's sleep; wake-ups before the sleep coalesce."""

    def __init__(self) -> None:
        self._queue = queue.SimpleQueue[None]()  # put() is safe in a handler
        self._is_set = False

    def set(self) -> None:
        """Wake the thread, or keep it from its next sleep.

        On any thread, and in a signal handler.
        """
        if not self._is_set:
            self._is_set = True
            self._queue.put(None)

    def sleep(self, seconds: float) -> None:
        """Sleep for so long, or until a wake-up."""
        with contextlib.suppress(queue.Empty):
            self._queue.get(seconds > 0.0, seconds)
        self._is_set = False
