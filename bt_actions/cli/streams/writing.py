"""Words for standard output and standard error, with readers of any kind."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, TextIO

from bt_actions.cli.streams.results import results
from bt_actions.utilities.shorten import fit

if TYPE_CHECKING:
    from rich.console import Console


class OutputLost(Exception):
    """Standard output that cannot be written, though it has a reader."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"standard output cannot be written: {error.strerror or error}")


def write(text: str) -> None:
    """Write `text` to standard output, at once.

    Raises OutputLost, or BrokenPipeError without a reader.
    """
    try:
        results().write(text)
        results().flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputLost(error) from error


def discard_stdout() -> None:
    """Drop all output from now on, with the rest in the buffer."""
    _discard(results())


def _discard(stream: TextIO) -> None:
    """Drop a stream's output: else Python's flush at exit fails, and makes the exit code 120."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def note(message: str, end: str = "\n") -> None:
    """Write one message for the user to standard error, with or without a reader.

    A user reads each of its lines: a long line loses its middle.
    """
    try:
        print("\n".join(map(fit, message.split("\n"))), file=sys.stderr, flush=True, end=end)
    except (OSError, ValueError):
        _discard(sys.stderr)


def terminal() -> Console | None:
    """Return standard output's terminal, where that can be drawn on."""
    if not sys.stdout.isatty():
        return None
    from rich.console import Console

    console = Console(highlight=False, markup=False, emoji=False)
    return None if console.is_dumb_terminal else console


def columns(stream: TextIO) -> int:
    """Return the width of the terminal behind `stream`; 200 where there is none."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or 200
    except (OSError, ValueError):
        return 200
