"""A program in a pseudo-terminal that an emulator shows and a test types into."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import sys
import termios
import time

import pyte

from tests.support.processes import PATIENCE, ROOT

ROWS, COLUMNS = 30, 100


class Terminal:
    """A program on a pseudo-terminal of its own, in a session of its own."""

    def __init__(self, *arguments: str, **environment: str) -> None:
        self.screen = pyte.HistoryScreen(COLUMNS, ROWS, history=1000)
        self._stream = pyte.ByteStream(self.screen)
        self.raw = b""
        self.most_below = 0
        self.code: int | None = None
        self.pid, self._end = pty.fork()
        if self.pid == 0:
            fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
            os.chdir(ROOT)
            command = [sys.executable, "-m", "bt_actions.cli", *arguments]
            for size in ("COLUMNS", "LINES"):  # of the terminal in which the tests run
                os.environ.pop(size, None)
            own = {"TERM": "xterm-256color", "PYTHONPATH": str(ROOT), **environment}
            os.execve(sys.executable, command, {**os.environ, **own})

    def read(self, within: float) -> bool:
        """Take in what is written; False when it has ended or nothing came in time."""
        ready, _, _ = select.select([self._end], [], [], within)
        if not ready:
            return False
        try:
            data = os.read(self._end, 65536)
        except OSError:
            data = b""
        self.raw += data
        self._stream.feed(data)
        return bool(data)

    @property
    def lines(self) -> list[str]:
        """What stands on the screen, and what has scrolled off it."""
        above = ["".join(line[x].data for x in range(COLUMNS)) for line in self.screen.history.top]
        return [line.rstrip() for line in [*above, *self.screen.display]]

    def until(self, wanted: str) -> None:
        """Wait until `wanted` stands on the screen."""
        deadline = time.monotonic() + PATIENCE
        while not any(wanted in line for line in self.lines):
            if not self.read(max(0.0, deadline - time.monotonic())):
                raise AssertionError(f"no {wanted!r} on the screen:\n" + "\n".join(self.lines))

    def type(self, keys: bytes) -> None:
        """Type, as a user does."""
        os.write(self._end, keys)

    def wait(self) -> int:
        """Read to the end; return the exit code."""
        deadline = time.monotonic() + PATIENCE
        while self.read(max(0.0, deadline - time.monotonic())):
            continue
        _, status = os.waitpid(self.pid, 0)
        self.code = os.waitstatus_to_exitcode(status)
        return self.code

    def close(self) -> None:
        """End it by force where it has not ended."""
        if self.code is None:
            os.kill(self.pid, 9)
            os.waitpid(self.pid, 0)
        os.close(self._end)
