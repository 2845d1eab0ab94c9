"""The log of goals, runs and trees: Python's logger `bt_actions`, called on a thread of its own.

Most lines come in under the one lock. A reader of standard error may stop to read: then the log
waits, and nothing else does. rclpy's own loggers would hold up the whole process, so only a tree's
lines go to them, because of `/rosout`. Beyond a bound, newer lines are only counted.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import queue
import select
import threading
from collections.abc import Callable
from functools import partial

from rclpy.logging import get_logger

from bt_actions.traffic.backend import LEVELS
from bt_actions.utilities.plain_text import clean, clean_lines
from bt_actions.utilities.shorten import fit

MOST = 10_000
"""Lines that wait to be written."""
WITHIN = 1.0
"""Seconds of the wait in `flush`."""
LONGEST = 3000
"""Bytes of a tree's line; a pipe with any room has room for 4,096."""
LINE = 250
"""Characters of a line of ours: with the words before it, three lines of a terminal."""
STDERR = 2


class _StandardError(logging.Handler):
    """A handler that writes as rclpy does, but with the interpreter's lock let go."""

    def emit(self, record: logging.LogRecord) -> None:
        level = next((name for name, least in LEVELS.items() if record.levelno <= least), "fatal")
        line = f"[{level.upper()}] [{record.created:.9f}] [{record.name}]: {record.getMessage()}"
        if record.levelno > logging.INFO and os.isatty(STDERR):
            line = f"\x1b[{33 if level == 'warn' else 31}m{line}\x1b[0m"
        left = f"{line}\n".encode(errors="replace")
        while left:
            try:
                left = left[os.write(STDERR, left) :]
            except BlockingIOError:  # another owner of the terminal made it so
                _has_room()
            except OSError:  # nobody will ever read it
                return


class Log:
    """The log, for lines from any thread; never raises and, but for `flush`, never waits."""

    def __init__(self, name: str) -> None:
        self._logger = logging.getLogger(name)
        self._logger.addHandler(_StandardError())
        self._logger.setLevel(logging.INFO)
        self._logger.propagate = False  # others' handlers may be added to this one
        self.info = lambda text: self._put(self._logger.info, clean(fit(text, LINE)))
        self.warning = lambda text: self._put(self._logger.warning, clean(fit(text, LINE)))
        self.error = lambda text: self._put(self._logger.error, clean(fit(text, LINE)))
        self._begin()
        atexit.register(self.flush)
        os.register_at_fork(after_in_child=self._begin)  # waiting lines are the parent's

    def _begin(self) -> None:
        self._lines: queue.Queue[Callable[[], object]] = queue.Queue(MOST)
        self._guard = threading.RLock()
        self._thread: threading.Thread | None = None
        self._dropped = 0
        self._patience = WITHIN

    def by(self, name: str, level: str, text: str) -> None:
        """Log a line of a tree by rclpy's logger of this name; `level` is one of `LEVELS`."""
        self._put(partial(self._write_by, name, LEVELS[level]), text)

    def flush(self) -> None:
        """Wait until all lines are written; not for long, and in vain only once."""
        done = self._lines.all_tasks_done
        with done:
            if not done.wait_for(lambda: not self._lines.unfinished_tasks, self._patience):
                self._patience = 0.0

    def _put(self, write: Callable[[str], object], text: str) -> None:
        with self._guard:
            try:
                line = clean_lines(text[:LONGEST]).encode()[:LONGEST].decode(errors="ignore")
                self._lines.put_nowait(partial(write, line))
            except queue.Full:
                self._dropped += 1
            if self._thread is None:
                thread = threading.Thread(target=self._write, name="bt_actions-log", daemon=True)
                with contextlib.suppress(RuntimeError):  # too many: with the next line, then
                    thread.start()
                    self._thread = thread

    def _write(self) -> None:
        while True:
            write = self._lines.get()
            _has_room()  # rclpy waits for it with the interpreter's lock held
            write()
            with self._guard:
                dropped = self._dropped if self._lines.empty() else 0
                self._dropped -= dropped
            if dropped:
                self._logger.warning("%s lines were not logged", dropped)
            self._patience = WITHIN
            self._lines.task_done()

    def _write_by(self, name: str, level: int, text: str) -> None:
        try:
            get_logger(name).log(text, level)  # a new one, as each line of code keeps to one level
        except Exception:  # noqa: BLE001 - ROS is shut down, say; the line is not lost
            self._logger.log(level, text)


def _has_room() -> None:
    """Wait until standard error takes a line, if it is a pipe."""
    poll = select.poll()
    poll.register(STDERR, select.POLLOUT)
    with contextlib.suppress(OSError):
        poll.poll()


log = Log("bt_actions")
