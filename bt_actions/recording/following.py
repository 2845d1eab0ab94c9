"""The follower of a run while it is written: new records since the last look, whole ones only.

A file that is finished meanwhile becomes another file under the same name, which is read from its
beginning: the recording knows the number of the latest event.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator
from pathlib import Path

from bt_actions.recording.folders import held, is_written, parts_of
from bt_actions.recording.mcap_records import MAGIC, whole_length
from bt_actions.recording.reading import Item, Recording


class Follower:
    """The follower of one run, whose folder no process removes meanwhile.

    Close it, or use `with`.
    """

    def __init__(self, first: Path) -> None:
        """Begin to follow; raises OSError where there is no such run."""
        self._holds = contextlib.ExitStack()
        self._holds.enter_context(held(first.parent, waits=True))
        self.recording = Recording(first)
        """The facts of the run so far beside its events: files, heartbeat, damage."""
        self._part, self._inode = first, 0
        self._at = 0
        """Bytes of the present file that were read."""

    def news(self) -> Iterator[Item]:
        """Yield the news since the last time: events, and a state where some are missing.

        One file at most is held in memory. Raises OSError, and ValueError for a file that is not
        ours.
        """
        while True:
            first = self.recording.first
            parts = parts_of(first)  # first: a file is whole once the next one is there
            later = parts[self._place(parts) + 1 :]
            yield from self._more(is_whole=bool(later) or not is_written(first))
            if not later:
                return
            self._turn_to(later[0])

    def close(self) -> None:
        """Let go of the run."""
        self._holds.close()

    def __enter__(self) -> Follower:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _place(self, parts: list[Path]) -> int:
        """Return the index of the present file; 0 where it was removed."""
        return parts.index(self._part) if self._part in parts else 0

    def _turn_to(self, part: Path) -> None:
        self._part, self._at, self._inode = part, 0, 0

    def _more(self, *, is_whole: bool) -> Iterator[Item]:
        try:
            file = self._part.open("rb")
        except FileNotFoundError:  # the oldest files of a long run are removed
            return
        with file:
            inode = os.fstat(file.fileno()).st_ino
            if inode != self._inode:
                self._inode, self._at = inode, 0
                self.recording.begin_part()
            file.seek(self._at)
            data = file.read()
        length = len(data) if is_whole else whole_length(data)
        if not length:
            return
        head = b"" if self._at == 0 else MAGIC
        self._at += length
        yield from self.recording.items_in(io.BytesIO(head + data[:length]))
