"""The keys of the terminal on standard input: one by one, and not shown."""

from __future__ import annotations

import contextlib
import os
import re
import termios
import tty
from typing import Self

_KEY = re.compile(r"\x1b[\[O]([A-D])|([\x20-\x7e])")
_ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left"}


class Keys:
    """The keys from `__enter__` to `__exit__`; Ctrl-C is a signal as ever, Ctrl-Z a key."""

    def __init__(self, fileno: int) -> None:
        """Take the descriptor of a terminal."""
        self.fileno = fileno

    def __enter__(self) -> Self:
        self._before = termios.tcgetattr(self.fileno)
        tty.setcbreak(self.fileno)
        changed = termios.tcgetattr(self.fileno)
        changed[6][termios.VSUSP] = b"\0"  # a shell would draw into what is drawn here
        termios.tcsetattr(self.fileno, termios.TCSAFLUSH, changed)
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(termios.error):  # the terminal may be gone
            termios.tcsetattr(self.fileno, termios.TCSAFLUSH, self._before)

    def read(self) -> list[str]:
        """Return the pressed keys; arrows as `up`, `down`, `left`, `right`.

        Raises OSError or EOFError where the terminal is gone.
        """
        data = os.read(self.fileno, 1000)
        if not data:
            raise EOFError
        return [_ARROWS.get(arrow, key) for arrow, key in _KEY.findall(data.decode("latin-1"))]
