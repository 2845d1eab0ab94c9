"""Work that may hang, as a read from a stuck mount does: it is left behind, others go on."""

from __future__ import annotations

import queue
import threading
import weakref
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from typing import Any, TypeVar

T = TypeVar("T")
_Jobs = queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None]


class Patience:
    """Does one piece of work after another on a thread of its own, and waits so long for each.

    Each is waited for `seconds`; a quarter of that while another hangs, as many files may lie on
    one stuck mount. To be called on one thread at a time.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._hanging: dict[Hashable, Future[Any]] = {}
        self._jobs: _Jobs | None = None
        self._leave_thread: Callable[[], object] = lambda: None
        """Let the thread end with what it does; also done when nobody has this any more."""

    def __call__(self, key: Hashable, work: Callable[[], T]) -> T:
        """Return what `work` returns, or raise what it raises.

        Raises TimeoutError where it takes too long. It goes on, and is not begun again meanwhile:
        who asks for `key` when it is done is given what came of it.
        """
        future: Future[T] | None = self._hanging.get(key)
        if future is None:
            future = self._submit(work)
            try:
                return future.result(self.seconds / 4 if self._hanging else self.seconds)
            except TimeoutError:
                if future.done():
                    raise
                self._hanging[key] = future
                self._leave_thread()
                self._jobs = None
                raise
        if not future.done():
            raise TimeoutError
        del self._hanging[key]
        return future.result()

    def _submit(self, work: Callable[[], T]) -> Future[T]:
        future = Future[T]()
        if self._jobs is None:
            self._jobs = jobs = _Jobs()
            self._leave_thread = weakref.finalize(self, jobs.put, None)
            threading.Thread(
                target=_work, args=(jobs,), name="bt_actions-reads", daemon=True
            ).start()
        self._jobs.put((future, work))
        return future


def _work(jobs: _Jobs) -> None:
    while _did(jobs.get()):
        pass


def _did(job: tuple[Future[Any], Callable[[], Any]] | None) -> bool:
    """Do a piece of work; whether there was one. Nothing of it is kept by the thread."""
    if job is None:
        return False
    future, work = job
    try:
        future.set_result(work())
    except BaseException as error:  # noqa: BLE001 - raised where it is asked for
        future.set_exception(error)
    return True
