"""The log of goals, runs and trees, written by a thread of its own.

Most of it is told under the one lock. Whoever reads standard error may stop to read: then the log
waits, and nothing else does; rclpy's own loggers would hold up the whole process, so no other part
of this package calls them, but for the simulation, which has no real robot behind it. They are
called here where a line is sure to have room: not on a terminal, of which nobody can tell, and not
where they write to a buffer (RCUTILS_LOGGING_USE_STDOUT). There what is said of goals is written by
hand. Decides nothing and keeps nothing that was written.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import queue
import select
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy.logging
from rclpy.logging import LoggingSeverity

from bt_actions.utilities.plain_text import clean_lines

MOST = 1000
"""Lines that wait to be written; of a reader that has stopped, newer ones are only counted.
Half of them is for what is said of goals."""
PACE = 0.1
"""Seconds, at most, that a tree which logs faster than it is written waits for room."""
NAP, LONGEST_NAP = 0.001, 0.05
"""Seconds between two looks at how much has been written, and those on a machine that is busy."""
LINGER = 5.0
"""Seconds without a line until the thread ends."""
AT_EXIT = 1.0
"""Seconds that a process which ends gives the log to be written."""
LONGEST = 3000
"""Bytes of a line; a pipe that has room at all has room for 4,096."""
STDERR = 2
THREAD = "bt_actions-log"
WRITE: dict[str, Callable[[Any, str], object]] = {
    "debug": lambda logger, text: logger.debug(text),
    "info": lambda logger, text: logger.info(text),
    "warn": lambda logger, text: logger.warning(text),
    "error": lambda logger, text: logger.error(text),
    "fatal": lambda logger, text: logger.fatal(text),
}
"""How a line of each level is written. rclpy keeps to one level for each line of code that logs."""
COLOURS = {"warn": "33", "error": "31", "fatal": "31"}
"""As rclpy's loggers have them on a terminal."""


class Log:
    """Takes lines from any thread; never raises and, but for `by` and `flush`, never waits."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._logger = rclpy.logging.get_logger(name)
        self._begin()
        atexit.register(self.flush)
        os.register_at_fork(after_in_child=self._begin)  # what waits is the parent's to write

    def _begin(self) -> None:
        self._lines: queue.Queue[tuple[Any, str, str]] = queue.Queue()
        self._guard = threading.RLock()
        self._thread: threading.Thread | None = None
        self._dropped = 0
        self._taken = 0
        self._written = 0
        self._slow_at = -1  # lines written when `by` last waited in vain
        self._stuck_at = -1  # and `flush`
        self._pen = threading.Lock()  # of who writes

    def info(self, text: str) -> None:
        """Log something worth knowing."""
        self._put("info", text)

    def warning(self, text: str) -> None:
        """Log something that may need attention."""
        self._put("warn", text)

    def error(self, text: str) -> None:
        """Log something that needs attention."""
        self._put("error", text)

    def by(self, logger: Any, level: str, text: str) -> None:
        """Log a line of a tree by another of rclpy's loggers; `level` is one of `WRITE`.

        In a loop it keeps the pace of who reads, as long as somebody does; else it is dropped.
        """
        room_at = self._taken - MOST // 2 + 1
        if self._written != self._slow_at and not self._wait_for(room_at, PACE):
            self._slow_at = self._written
        self._put(level, text, logger, MOST // 2)

    def flush(self, seconds: float = AT_EXIT) -> None:
        """Wait until all that was said by now has been written, but not for long.

        Where that was in vain, write here what there is room for, and do not wait again before
        something has been written.
        """
        if self._written != self._stuck_at and not self._wait_for(self._taken, seconds):
            self._stuck_at = self._written
            if not os.isatty(STDERR):  # which may have room, but not for a line
                self._write_here()

    def _wait_for(self, lines: int, seconds: float) -> bool:
        """Wait until so many lines have been written; return whether they were in time.

        No nap counts for more than `LONGEST_NAP`: who was stopped meanwhile has not had the time.
        """
        before = time.monotonic()
        while self._written < lines and seconds > 0.0:
            time.sleep(NAP)
            now = time.monotonic()
            seconds -= min(now - before, LONGEST_NAP)
            before = now
        return self._written >= lines

    def _put(self, level: str, text: str, logger: Any = None, most: int = MOST) -> None:
        with self._guard:
            if self._lines.qsize() >= most:
                self._dropped += 1
                return
            self._tell_dropped()
            self._take(logger, level, _fit(text))
            if sys.is_finalizing():  # where no thread runs any more, and a new one never would
                self._write_here()
            elif self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._write, name=THREAD, daemon=True)
                try:
                    self._thread.start()
                except RuntimeError:  # there are too many, or the process ends (Python 3.12.1)
                    self._thread = None
                    self._write_here()

    def _take(self, logger: Any, level: str, text: str) -> None:
        self._taken += 1
        self._lines.put((logger, level, text))

    def _tell_dropped(self) -> None:
        if self._dropped:
            self._take(None, "warn", f"{self._dropped} lines were not logged")
            self._dropped = 0

    def _write(self) -> None:
        while True:
            try:
                logger, level, text = self._lines.get(timeout=LINGER)
            except queue.Empty:
                with self._guard:
                    if self._lines.empty():
                        self._thread = None
                        return
                continue
            written = False
            while not written:
                self._room(None)
                with self._pen:
                    written = self._room(0)
                    if written:
                        self._say(logger, level, text)
            with self._guard:
                if self._lines.empty():
                    self._tell_dropped()

    def _write_here(self) -> None:
        """Write what waits as long as there is room, unless somebody else is at it."""
        if not self._pen.acquire(blocking=False):
            return
        try:
            with contextlib.suppress(queue.Empty):
                while self._room(0):
                    self._say(*self._lines.get_nowait())
        finally:
            self._pen.release()

    def _say(self, logger: Any, level: str, text: str) -> None:
        try:
            if logger is None and (os.isatty(STDERR) or _uses_stdout()):
                if self._logger.is_enabled_for(LoggingSeverity[level.upper()]):
                    _write_by_hand(level, self._name, text)
            else:
                WRITE[level](logger or self._logger, text)
        except Exception:  # noqa: BLE001 - its node is gone, say; the line is not lost
            with contextlib.suppress(OSError):
                _write_by_hand(level, self._name, text)
        with self._guard:
            self._written += 1

    def _room(self, patience: int | None) -> bool:
        """Wait until a pipe takes a line: rclpy writes with the interpreter's lock held."""
        return _wait_for_room(patience)


def _uses_stdout() -> bool:
    """Whether rclpy's loggers write to standard output, of which a signal may leave a part."""
    return os.environ.get("RCUTILS_LOGGING_USE_STDOUT") == "1"


def _write_by_hand(level: str, name: str, text: str) -> None:
    """Write a line to standard error as rclpy's loggers do, but holding up no other thread."""
    seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
    line = f"[{level.upper()}] [{seconds}.{nanoseconds:09}] [{name}]: {text}"
    if level in COLOURS and os.isatty(STDERR) and os.environ.get("RCUTILS_COLORIZED_OUTPUT") != "0":
        line = f"\x1b[{COLOURS[level]}m{line}\x1b[0m"
    left = f"{line}\n".encode(errors="replace")
    while left:
        try:
            left = left[os.write(STDERR, left) :]
        except BlockingIOError:  # whoever shares the terminal has made it so
            _wait_for_room()


def _wait_for_room(patience: int | None = None) -> bool:
    poll = select.poll()
    poll.register(STDERR, select.POLLOUT)
    try:
        return bool(poll.poll(patience))
    except OSError:
        return True


def _fit(text: str) -> str:
    """What a line takes of a text."""
    whole = clean_lines(text[: LONGEST + 1]).encode()
    if len(whole) <= LONGEST:
        return whole.decode()
    return whole[: LONGEST - 3].decode(errors="ignore") + "..."


log = Log("bt_actions")
