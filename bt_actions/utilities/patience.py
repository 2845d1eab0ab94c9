"""Work that may hang, as a read from a stuck mount does: such work is left behind."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from functools import partial
from typing import Any, Self, TypeVar

T = TypeVar("T")
_LEAST = 0.1
"""Seconds for the read of a file from a sound disk."""
_Jobs = queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None]


class Patience:
    """A thread that does one piece of work after another, with a bounded wait for each.

    The wait is `seconds`, and half as long for each further piece that hangs, as many files may lie
    on one stuck mount. A context manager, at whose end the thread goes; for one user at a time.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._hanging: dict[Hashable, Future[Any]] = {}
        self._jobs: _Jobs | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._leave_thread()

    def __call__(self, key: Hashable, work: Callable[[], T]) -> T:
        """Return what `work` returns, or raise what it raises.

        Raises TimeoutError for work that takes too long. The work goes on, and is not begun again
        meanwhile: a later call for `key` gets its result.
        """
        future: Future[T] | None = self._hanging.get(key)
        if future is None:
            future = self._submit(work)
            try:
                return future.result(max(self.seconds / 2 ** len(self._hanging), _LEAST))
            except TimeoutError:
                if future.done():
                    raise
                self._hanging[key] = future
                self._leave_thread()
                raise
        if not future.done():
            raise TimeoutError
        del self._hanging[key]
        return future.result()

    def _submit(self, work: Callable[[], T]) -> Future[T]:
        future = Future[T]()
        if self._jobs is None:
            self._jobs = _Jobs()
            work_on = partial(_work, self._jobs)
            threading.Thread(target=work_on, name="bt_actions-reads", daemon=True).start()
        self._jobs.put((future, work))
        return future

    def _leave_thread(self) -> None:
        """Let the thread end with its present work."""
        if self._jobs is not None:
            self._jobs.put(None)
            self._jobs = None


def _work(jobs: _Jobs) -> None:
    while (job := jobs.get()) is not None:
        future, work = job
        try:
            future.set_result(work())
        except BaseException as error:  # noqa: BLE001 - raised where it is asked for
            future.set_exception(error)
