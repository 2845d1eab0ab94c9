"""Words for standard output and standard error, whoever may still be reading there."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TextIO

from bt_actions.cli.streams.results import results
from bt_actions.utilities.shorten import fit


class OutputLost(Exception):
    """Standard output cannot be written, for another reason than that nobody reads it."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"standard output cannot be written: {error.strerror or error}")


def write(text: str) -> None:
    """Write `text` to standard output, at once.

    Raises OutputLost, or BrokenPipeError when nobody reads any more.
    """
    try:
        results().write(text)
        results().flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputLost(error) from error


def discard_stdout() -> None:
    """Write to nowhere from now on, what is left in the buffer too."""
    _discard(results())


def _discard(stream: TextIO) -> None:
    """Without this, Python fails to flush the stream at exit, and makes the exit code 120."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def note(message: str, end: str = "\n") -> None:
    """Write one message for the user to standard error, whoever may still be reading it.

    Each of its lines is one that a user reads: a long one is written without its middle.
    """
    try:
        print("\n".join(map(fit, message.split("\n"))), file=sys.stderr, flush=True, end=end)
    except (OSError, ValueError):
        _discard(sys.stderr)


def columns(stream: TextIO) -> int:
    """Return the width of the terminal behind `stream`; 200 where there is none."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or 200
    except (OSError, ValueError):
        return 200
