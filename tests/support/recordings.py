"""Recordings of runs as `bt-actions` leaves them, made from events without a thread."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from bt_actions.events import Event, RunBegan
from bt_actions.recording import folders, recorder
from bt_actions.recording.finishing import finish
from bt_actions.recording.folders import FIRST, folder_for, held, home, write_summary
from bt_actions.recording.mcap_records import Attachment, Message, records
from bt_actions.recording.writing import RunWriter


def record(
    events: Iterable[Event],
    where: Path | None = None,
    *,
    killed: float | None = None,
    tick: float = 0.0,
    **options: int,
) -> Path:
    """Record a run below a folder, the user's own if not given; return its first file.

    With `killed`, its process was: so many seconds after its last event, in a tick that had taken
    `tick` seconds by then.
    """
    events = [_numbered(event) for event in events]
    began = next(each for each in events if isinstance(each, RunBegan))
    where = folders.home() if where is None else where
    first = folder_for(began.run_id, began.tree, began.at.wall, where) / FIRST
    writer = RunWriter(first, began, **options)  # type: ignore[arg-type]
    for event in events:
        writer.add(event)
        writer.flush()
    at = events[-1].at
    if killed is not None:
        writer.beat(at.steady + killed, at.wall + killed, at.ros, tick)
    writer.close()
    write_summary(first, recorder.begun(began))
    if killed is None:
        write_summary(first, recorder.summary(writer.state))
        finish(first)
    return first


class Going:
    """A run that is being written."""

    def __init__(self, events: list[Event], **options: int) -> None:
        began = next(each for each in events if isinstance(each, RunBegan))
        self.first = folder_for(began.run_id, began.tree, began.at.wall, home()) / FIRST
        self.writer = RunWriter(self.first, began, **options)  # type: ignore[arg-type]
        self._lock = held(self.first, alone=True)
        self._lock.__enter__()
        self._goes_on = True
        write_summary(self.first, recorder.begun(began))

    def write(self, events: list[Event]) -> None:
        for event in events:
            self.writer.add(event)
        self.writer.flush()

    def end(self) -> None:
        if self._goes_on:
            self._goes_on = False
            self.writer.close()
            self._lock.__exit__(None, None, None)

    def beat(self, seconds: float, tick: float = 0.0) -> None:
        """Tell that the process lives, so many seconds after its latest event."""
        assert self.writer.state.now is not None
        at = self.writer.state.now
        self.writer.beat(at.steady + seconds, at.wall + seconds, at.ros, tick)
        self.writer.flush()


def _numbered(event: Event) -> Event:
    """Give a goal the id of 16 bytes that goals have, where a test gave it a name."""
    name = getattr(event, "goal_id", "")
    if not name or re.fullmatch("[0-9a-f]{32}", name):
        return event
    return replace(event, goal_id=hashlib.md5(name.encode()).hexdigest())  # type: ignore[call-arg]


def bytes_of(folder: Path) -> Iterator[bytes]:
    """Yield all that the files of a recording hold: as they are, and unpacked."""
    for path in folder.rglob("*"):
        if path.is_file():
            yield path.read_bytes()
        if path.suffix == ".mcap":
            with path.open("rb") as file:
                yield from (
                    each.data for each in records(file) if isinstance(each, Message | Attachment)
                )
