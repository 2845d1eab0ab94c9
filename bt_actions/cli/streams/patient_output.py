"""Standard output and error for the length of a run: no thread waits, whatever their readers do.

The main thread enforces --timeout and reads the signals, and rclpy logs with the GIL held: a full
pipe would stop all of this, and the robot would move on. This file must not wait for a reader
itself: `written` tells the progress of the readers, and drive.py decides how long to wait.
"""

from __future__ import annotations

import contextlib
import io
import os
import select
import sys
import threading
from collections.abc import Callable
from typing import Self, TextIO

from bt_actions.cli.streams.patient_file import PatientFile, has_reader
from bt_actions.cli.streams.results import STDERR, STDOUT, are_apart, results, send_results
from bt_actions.cli.streams.stderr import roomy_pipe


class PatientOutput:
    """A stand-in for standard output, from `__enter__` to `__exit__`; main thread only."""

    def __init__(self) -> None:
        self._stdout = results()
        self._file: PatientFile | None = None
        self._stderr: _PatientStderr | None = None

    def __enter__(self) -> Self:
        try:
            descriptor = self._stdout.fileno()
        except (OSError, ValueError):  # a test's: nobody has to be waited for
            return self
        self._stdout.flush()
        self._file = PatientFile(descriptor, "stdout")
        send_results(_text(self._file, self._stdout, write_through=True))
        return self

    def __exit__(self, *_: object) -> None:
        send_results(self._stdout)
        if self._stderr is not None:
            self._stderr.close()
        if self._file is not None:
            self._file.end()

    def catch_stderr(self) -> None:
        """Make standard error patient, too, where it has a reader that could pause."""
        if has_reader(STDERR):
            self._stderr = _PatientStderr()

    def tell_gaps(self, gap: Callable[[int], str]) -> None:
        """Let `gap` say in the output how many lines are missing."""
        if self._file is not None:
            self._file.gap = gap

    def written(self, within: float) -> bool:
        """Return whether all is written, now or within so many seconds.

        Raises the error of an earlier write to standard output.
        """
        done = self._file is None or self._file.written(within)
        if self._stderr is not None:
            done = self._stderr.written(within if done else 0.0) and done
        return done


def _text(file: PatientFile, like: TextIO, *, write_through: bool = False) -> TextIO:
    """Return a stream with the encoding of `like`, which writes line by line, or at once."""
    return io.TextIOWrapper(
        file,  # type: ignore[type-var]  # a raw stream has all that is needed
        encoding=like.encoding,
        errors=like.errors,
        newline="",
        line_buffering=not write_through,
        write_through=write_through,
    )


class _PatientStderr:
    """File descriptor 2, led into a pipe that never blocks: C libraries write there, too.

    Descriptor 1 follows where that is standard error for all but results, and a print of any length
    has room.
    """

    def __init__(self) -> None:
        sys.stderr.flush()
        self._descriptors = (STDERR, STDOUT) if are_apart() else (STDERR,)
        self._real = os.dup(STDERR)
        self._file = PatientFile(self._real, "stderr")
        if are_apart():
            sys.stdout = _text(self._file, sys.stderr)  # a part of a line would mix with others
        self._read, write = roomy_pipe()
        self._moving = threading.Lock()
        """Held while text is neither in the pipe nor in the file."""
        for descriptor in self._descriptors:
            os.dup2(write, descriptor)
        os.close(write)
        self._thread = threading.Thread(target=self._pass_on, name="stderr pipe", daemon=True)
        self._thread.start()

    def _pass_on(self) -> None:
        block = b"\n"
        while block:
            self._has_text(wait=True)
            with self._moving:
                block = os.read(self._read, 65536)
                self._file.write(block)
        os.close(self._read)

    def _has_text(self, *, wait: bool = False) -> bool:
        """Return whether the pipe has text, or has lost all its writers."""
        poll = select.poll()  # one for each thread
        poll.register(self._read, select.POLLIN)
        return bool(poll.poll(None if wait else 0))

    def written(self, within: float) -> bool:
        """Return whether all is written, now or within so many seconds; lost text is no error."""
        with self._moving:
            if self._has_text():
                return False
        with contextlib.suppress(OSError):
            return self._file.written(within)
        return True

    def close(self) -> None:
        """Restore descriptor 2; earlier text is on its way."""
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.flush()
        if STDOUT in self._descriptors:
            sys.stdout = sys.stderr
        for descriptor in self._descriptors:
            os.dup2(self._real, descriptor)
        self._thread.join(0.1)  # longer only where a child process has inherited the pipe
        self._file.end()
