"""A file that takes text at once, while a thread of its own writes in the reader's time.

A reader may pause (`less`, Ctrl-S, a stuck collector of logs): the text then waits here, in order
and bounded. A file on a disk has no reader, and gets everything. This file must not decide what a
failed write means: the main thread's next write or flush raises the error. The thread must not
hold a lock of Python's own streams while it writes: the interpreter could not exit then.
"""

from __future__ import annotations

import io
import os
import select
import stat
import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

MOST = 4_000_000
"""Bytes that may wait for a reader; beyond that the oldest are dropped."""
_OF_A_PIECE = 64
"""Bytes of overhead for each piece of text."""
_OF_A_LARGE_ONE = 4
"""Large pieces that may wait, of any size: one alone neither drops others nor is dropped."""


def has_reader(descriptor: int) -> bool:
    """Return whether a descriptor has a reader, which may pause."""
    mode = os.fstat(descriptor).st_mode
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(descriptor)


def _cost(piece: bytes) -> int:
    return min(len(piece), MOST // _OF_A_LARGE_ONE) + _OF_A_PIECE


def gap_text(lines: int) -> str:
    """Say in a line that some lines are missing."""
    return f"... {lines} lines are missing here: they were not read in time\n"


class PatientFile(io.RawIOBase):
    """A file that takes bytes without ever waiting; a thread writes them to a descriptor."""

    def __init__(self, descriptor: int, name: str) -> None:
        self._descriptor = descriptor
        self._bounded = has_reader(descriptor)
        self._pid = os.getpid()
        self._changed = threading.Condition()
        self._waiting: deque[bytes] = deque()
        self._size = 0
        self._missing = 0
        self._writing = False
        self._ended = False
        self._error: OSError | None = None
        self.gap: Callable[[int], str] = gap_text
        self._thread = threading.Thread(target=self._write_all, name=name, daemon=True)
        self._thread.start()

    def writable(self) -> bool:
        """Return True: the file takes text."""
        return True

    def fileno(self) -> int:
        """Return the descriptor that the thread writes to."""
        return self._descriptor

    def isatty(self) -> bool:
        """Return whether the descriptor is a terminal's."""
        return os.isatty(self._descriptor)

    def write(self, data: ReadableBuffer, /) -> int:
        """Queue `data`; raises as `flush` does."""
        self.flush()
        if not (piece := bytes(data)):
            return 0
        if self._forked:
            return os.write(self._descriptor, piece)
        with self._changed:
            self._waiting.append(piece)
            self._size += _cost(piece)
            while self._bounded and self._size > MOST:
                oldest = self._waiting.popleft()
                self._size -= _cost(oldest)
                self._missing += oldest.count(b"\n")
            self._changed.notify_all()
        return len(piece)

    def flush(self) -> None:
        """Raise, once, the error of an earlier write; wait for nothing.

        The main thread alone gets the error: a leaf that prints must not fail for it.
        """
        if self._forked or threading.current_thread() is not threading.main_thread():
            return
        with self._changed:
            error, self._error = self._error, None
        if error is not None:
            raise error

    @property
    def _forked(self) -> bool:
        """Whether this is a copy in a child process, without the writing thread."""
        return os.getpid() != self._pid

    def written(self, within: float) -> bool:
        """Return whether all is written, now or within so many seconds; raises as `flush` does."""
        with self._changed:
            done = self._changed.wait_for(
                lambda: self._error or not (self._waiting or self._writing), within
            )
        self.flush()
        return bool(done)

    def end(self) -> None:
        """Let the thread end once all is written; unread text is lost with the process."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._thread.join(0.1)

    def _write_all(self) -> None:
        while piece := self._next():
            try:
                self._put(piece)
            except OSError as error:
                with self._changed:
                    self._error = error
                    self._waiting.clear()
                    self._size = self._missing = 0
            with self._changed:
                self._writing = False
                self._changed.notify_all()

    def _next(self) -> bytes:
        """Wait for a piece, and take it; b"" at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._ended)
            if not self._waiting:
                return b""
            self._writing = True
            if self._missing:
                missing, self._missing = self._missing, 0
                return self.gap(missing).encode("ascii", "backslashreplace")
            piece = self._waiting.popleft()
            self._size -= _cost(piece)
            return piece

    def _put(self, piece: bytes) -> None:
        left = memoryview(piece)
        while left:
            try:
                left = left[os.write(self._descriptor, left) :]
            except BlockingIOError:  # another owner made the file so
                poll = select.poll()
                poll.register(self._descriptor, select.POLLOUT)
                poll.poll()
