"""SIGINT, SIGTERM, SIGHUP and SIGQUIT as bytes in a pipe, which the main thread reads in its time.

A handler that did more than write a byte could run in the middle of anything, with any lock held.
So the main thread only waits, and other threads do all work. A library, whose main thread may work
itself, has ros/signals.py. This file decides only when a second signal counts as the first; the
meaning of a signal is decided elsewhere.
"""

from __future__ import annotations

import atexit
import contextlib
import math
import os
import select
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import Any, Self, TypeVar

Result = TypeVar("Result")

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_MAY_BE_IGNORED = (signal.SIGHUP, signal.SIGQUIT)

SAME_WISH = 0.25
"""Seconds in which a second signal is the first one, passed on by a wrapper (uv, a shell)."""
_to_ignore: set[signal.Signals] = set()


@atexit.register
def _ignore() -> None:
    """Ignore all signals: the exit code stands while Python shuts down without handlers."""
    for number in _to_ignore:
        signal.signal(number, signal.SIG_IGN)


class Signals:
    """The catch of signals that end a program, from `__enter__` to `__exit__`; main thread only.

    SIGHUP and SIGQUIT stay ignored in a program that was started so (nohup, a shell's &).
    """

    def __init__(self) -> None:
        self._read, self._write = os.pipe()
        for end in (self._read, self._write):
            os.set_blocking(end, False)
        self._before: dict[signal.Signals, Any] = {}  # the type of signal.getsignal
        self._wakeup_before = -1
        self._first_at = math.inf
        self._closing = threading.Lock()
        self._closed = False
        self._settled = False

    def __enter__(self) -> Self:
        self._wakeup_before = signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)
        for number in _ENDING:
            if number in _MAY_BE_IGNORED and signal.getsignal(number) is signal.SIG_IGN:
                continue
            self._before[number] = signal.signal(number, _only_the_byte)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items() if not self._settled else ():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup_before)
        with self._closing:
            self._closed = True
            os.close(self._read)
            os.close(self._write)

    def settle(self, code: int) -> None:
        """Fix the exit code: from here on a signal ends the program at once, with that code."""
        self._settled = True
        for number in self._before:
            signal.signal(number, lambda _number, _frame: os._exit(code))
        _to_ignore.update(self._before)

    def poke(self) -> None:
        """Wake the waiting thread; callable from any thread."""
        with self._closing, contextlib.suppress(BlockingIOError):  # full: it will wake anyway
            if not self._closed:
                os.write(self._write, b"\0")

    def during(self, work: Callable[[], Result], heard: Callable[[signal.Signals], None]) -> Result:
        """Return what `work` returns on another thread; call `heard` with signals meanwhile."""
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            future.add_done_callback(lambda _: self.poke())
            while not future.done():
                for number in self.wait(None)[0]:
                    heard(number)
        return future.result()

    def wait(
        self, timeout: float | None, *, readable: int = -1, writable: int = -1
    ) -> tuple[list[signal.Signals], set[int]]:
        """Wait for a signal, for a poke, until `readable` has data or `writable` lost its reader.

        Return the signals since the last call, and which of the two descriptors are ready; -1 is
        none. `timeout` is in seconds; None waits without limit.
        """
        poll = select.poll()
        poll.register(self._read, select.POLLIN)
        if readable >= 0:
            poll.register(readable, select.POLLIN)
        if writable >= 0:
            poll.register(writable, 0)  # errors and hang-ups are always reported
        ready = {fd for fd, _ in poll.poll(None if timeout is None else max(0.0, timeout) * 1000)}
        return self._take(), ready - {self._read}

    def _take(self) -> list[signal.Signals]:
        try:
            numbers = os.read(self._read, 65536)
        except BlockingIOError:
            return []
        taken = [signal.Signals(number) for number in numbers if number in _ENDING]
        now = time.monotonic()
        if taken and self._first_at == math.inf:
            self._first_at = now
            return taken[:1]
        return taken if now - self._first_at > SAME_WISH else []


def _only_the_byte(_number: int, _frame: FrameType | None) -> None:
    """Do nothing: Python's C handler has written the byte to the pipe by now."""
