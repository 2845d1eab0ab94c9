"""Standard error, caught while a terminal is drawn on: the lines of C libraries, too.

Drawing and lines from elsewhere on one terminal would overwrite each other.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import sys

_ROOM = 1 << 20
"""Bytes of room before a thread of ours takes them."""


def roomy_pipe() -> tuple[int, int]:
    """Return a pipe whose writers never wait: bytes beyond its room are lost.

    rclpy logs with the GIL held. A full pipe would make it wait for a thread of ours, and that
    thread for the GIL.
    """
    read, write = os.pipe()
    with contextlib.suppress(OSError):  # more than an unprivileged user may have
        fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, _ROOM)
    os.set_blocking(write, False)
    return read, write


class CaughtStderr:
    """File descriptor 2, led into a pipe while the terminal is drawn on, if 2 is that terminal."""

    def __init__(self) -> None:
        self.fileno = -1
        self._saved = -1
        self._rest = b""
        if not os.isatty(2):
            return
        sys.stderr.flush()
        self.fileno, write = roomy_pipe()
        os.set_blocking(self.fileno, False)
        self._saved = os.dup(2)
        os.dup2(write, 2)
        os.close(write)

    def lines(self) -> list[str]:
        """Return the whole lines written since the last call."""
        if self.fileno < 0:
            return []
        try:
            while block := os.read(self.fileno, 65536):
                self._rest += block
        except BlockingIOError:
            pass
        except OSError:
            self.fileno = -1
        *whole, self._rest = self._rest.split(b"\n")
        if self._saved < 0 and self._rest:
            whole, self._rest = [*whole, self._rest], b""
        return [line.decode(errors="replace").rstrip("\r") for line in whole]

    def close(self) -> None:
        """Restore descriptor 2; `lines` still returns earlier lines."""
        if self._saved >= 0:
            sys.stderr.flush()
            os.dup2(self._saved, 2)
            os.close(self._saved)
            self._saved = -1
