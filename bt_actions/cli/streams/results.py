"""The stream for the results of a command: standard output, or a copy of it for results alone.

A tree's own classes run beside some commands. Their prints, and whatever a logger, a C library or a
child process writes to standard output, must not stand between results that a program reads.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import TextIO

STDOUT, STDERR = 1, 2


@dataclass(slots=True)
class _Apart:
    """The state in which standard output is standard error for all but results."""

    results: TextIO
    stdout: TextIO
    """The former sys.stdout."""


_apart: _Apart | None = None


def results() -> TextIO:
    """Return the stream for results."""
    return sys.stdout if _apart is None else _apart.results


def are_apart() -> bool:
    """Return whether standard output is standard error for all but results."""
    return _apart is not None


def send_results(stream: TextIO) -> None:
    """Send the results to `stream` from here on."""
    if _apart is None:
        sys.stdout = stream
    else:
        _apart.results = stream


def keep_results_apart() -> None:
    """Give standard output to results alone; all other output goes to standard error.

    Call this before the import of a class of the user's. The state lasts to the very end of the
    process, exit hooks included. Main thread only.
    """
    global _apart
    stdout = kept = sys.stdout
    stdout.flush()
    if _is_descriptor(stdout):
        descriptor = os.dup(STDOUT)  # no child process inherits it
        kept = os.fdopen(
            descriptor, "w", encoding=stdout.encoding, errors=stdout.errors, closefd=False
        )
        os.dup2(STDERR, STDOUT)
        stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]  # as stderr is
    _apart = _Apart(kept, stdout)
    sys.stdout = sys.stderr


def give_stdout_back() -> None:
    """Undo `keep_results_apart`, for a program that has called a command and goes on."""
    global _apart
    if _apart is None:
        return
    kept, sys.stdout = _apart.results, _apart.stdout
    _apart = None
    if _is_descriptor(sys.stdout):
        os.dup2(kept.fileno(), STDOUT)
        os.close(kept.fileno())


def _is_descriptor(stdout: TextIO) -> bool:
    """Return whether a stream is the process's own, and no test's."""
    try:
        return stdout.fileno() == STDOUT
    except (OSError, ValueError):
        return False
