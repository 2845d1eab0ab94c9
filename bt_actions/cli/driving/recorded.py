"""Recorded runs for the commands that read them: the choice of a run, the progress of reading."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from bt_actions.cli.exits import BadInput
from bt_actions.utilities.plain_text import clean

if TYPE_CHECKING:
    from pathlib import Path

    from bt_actions.recording.reading import Recording

RUN = "first letters of an id, name of a tree, .mcap file, or folder of a run or a bag"
"""The forms of RUN, for help."""
_SOON = 0.5
"""Seconds that a user does not notice."""


@contextlib.contextmanager
def reading(run: str) -> Iterator[Recording]:
    """Yield the recording that `run` means, the last of all for "", kept from removal meanwhile.

    Raises BadInput, also for errors of reading within.
    """
    from bt_actions.recording.folders import NoRun, find, held
    from bt_actions.recording.reading import Recording, RecordingError

    try:
        first = find(run)
        _finish(first)
        with held(first.parent, waits=True):
            yield Recording(first)
    except (NoRun, RecordingError) as error:
        raise BadInput(clean(str(error))) from error
    except RecursionError as error:
        raise BadInput(clean(f"{first} holds values within values without an end")) from error


def _finish(first: Path) -> None:
    """Finish a recording of ours that a killed process left; leave others' bags alone."""
    from bt_actions.recording.finishing import finish
    from bt_actions.recording.folders import read_summary

    with contextlib.suppress(OSError):  # a folder that cannot be written
        if read_summary(first) is not None:
            finish(first)


@contextlib.contextmanager
def progress(what: str) -> Iterator[Callable[[int], None]]:
    """Yield a function that shows a count on standard error, where that is a terminal.

    Nothing is shown before half a second has passed, and nothing stays.
    """
    is_shown, shown = sys.stderr.isatty(), time.monotonic()
    drawn = ""

    def count(done: int) -> None:
        nonlocal shown, drawn
        if is_shown and time.monotonic() - shown >= _SOON:
            shown, drawn = time.monotonic(), f"\r{done} {what}"
            sys.stderr.write(drawn)
            sys.stderr.flush()

    try:
        yield count
    finally:
        if drawn:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
