"""Runs that go on without a recording, or with an ended one: each has a file in memory.

A disk may be full, so the file lies where the ledger does. Its process holds it locked, and removes
it when the run is over. No other trace of such a run is readable.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from bt_actions.recording.folders import UNREADABLE, Summary, is_written, locked, read_fields
from bt_actions.recovery.ledger import directory
from bt_actions.story.values import clock
from bt_actions.utilities.plain_text import as_json, clean

_SUFFIX = ".unrecorded"


@dataclass(frozen=True, slots=True)
class Unrecorded:
    """A run that goes on without a full recording."""

    summary: Summary
    since: float
    """Seconds since 1970: the end of the recording, or else the beginning of the run."""
    why: str

    def __str__(self) -> str:
        return since_text(self.since, self.why)


def since_text(since: float, why: str) -> str:
    """Say since when nothing is recorded, and why."""
    return f"{clock(since)}: {why}"


@contextlib.contextmanager
def told(summary: Summary, since: float, why: str) -> Iterator[None]:
    """Have other processes told meanwhile that a run is not recorded. Raises OSError."""
    for left in _files():
        if not is_written(left):  # the file's process was killed
            left.unlink(missing_ok=True)
    path = directory() / f"{summary.run_id}{_SUFFIX}"
    with locked(path, as_json({**asdict(summary), "since": since, "why": why}).encode()):
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def unrecorded() -> list[Unrecorded]:
    """Return the runs of this user that go on without a full recording."""
    found = []
    for path in _files():
        with contextlib.suppress(*UNREADABLE):
            if is_written(path):
                summary, data = read_fields(path)
                found.append(Unrecorded(summary, float(data["since"]), clean(str(data["why"]))))
    return found


def _files() -> list[Path]:
    try:
        return sorted(directory(make=False).glob(f"*{_SUFFIX}"))
    except OSError:  # no run is told
        return []
