"""A whole recording in memory, packed, for quick access to the state after any of its events.

Events lie in blocks, each behind the state before it. So a step back folds one block at most, and a
recording takes about as much memory as its finished file does on disk.
"""

from __future__ import annotations

import zlib
from array import array
from bisect import bisect_right
from collections.abc import Callable

from py_trees.common import Status

from bt_actions.events import Event, NodeChanged, from_line, to_line
from bt_actions.recording.reading import Recording, RecordingError
from bt_actions.story.keeping import from_json, to_json
from bt_actions.story.state import State

BLOCK = 300_000
"""Bytes of a block's events before they are packed, at least: 30 ms of folding."""


class Tape:
    """The events of a recording. A position is the number of events before it."""

    def __init__(self, recording: Recording, progress: Callable[[int], None] = lambda _: None):
        """Read it all; `progress` gets the number of events so far.

        Raises RecordingError.
        """
        self.times = array("d")
        """The moment of each event, in seconds on the steady clock."""
        self.failures: list[int] = []
        """The positions behind each failure of a leaf, and of a node that failed by itself."""
        self._starts, self._blocks = [0], list[bytes]()
        self._states = [b""]
        """The state before each block; nothing before the first."""
        lines, size, least = list[str](), 0, BLOCK
        state = State()
        for item in recording.items():
            if isinstance(item, State):
                state = item
            else:
                lines.append(to_line(item))
                size += len(lines[-1])
                self.times.append(max(item.at.steady, self.times[-1] if self.times else 0.0))
                if _fails(state, item):
                    self.failures.append(len(self.times))
                state.fold(item)
                progress(len(self.times))
            if item is state or (size >= least and state.began is not None):
                self._blocks.append(_packed(lines))
                told = to_json(state)
                self._starts.append(len(self.times))
                self._states.append(zlib.compress(told.encode("ascii"), 1))
                lines, size, least = [], 0, max(BLOCK, len(told))
        self._blocks.append(_packed(lines))
        if state.began is None:
            raise RecordingError(f"{recording.first} holds no run")
        self.end = state
        """The state behind the last event."""
        self._block, self._lines = -1, list[str]()
        self._position, self._state = 0, State()

    def __len__(self) -> int:
        return len(self.times)

    def seek(self, position: int) -> State:
        """Return the state at a position; the object is the tape's own until the next call."""
        block = bisect_right(self._starts, position) - 1
        start = self._starts[block]
        if block != self._block:
            data = zlib.decompress(self._blocks[block]).decode("ascii")
            self._block, self._lines = block, data.splitlines()
        if not start <= self._position <= position:
            before = zlib.decompress(self._states[block]) if block else b""
            self._state = from_json(before.decode("ascii")) if before else State()
            self._position = start
        for line in self._lines[self._position - start : position - start]:
            self._state.fold(from_line(line))
        self._position = position
        return self._state

    def after(self, moment: float) -> int:
        """Return the position behind all events up to a moment on the steady clock."""
        return bisect_right(self.times, moment)


def _packed(lines: list[str]) -> bytes:
    return zlib.compress("\n".join(lines).encode("ascii"), 1)


def _fails(state: State, event: Event) -> bool:
    """Return whether a node fails by itself; for repeated failures, the first time."""
    if not isinstance(event, NodeChanged) or event.status is not Status.FAILURE:
        return False
    story = state.nodes.get(event.node)
    if story is None or not (story.is_leaf or event.by_itself):
        return False
    parent = state.nodes.get(story.node.parent or 0)
    if parent is not None and parent.node.kind == "invert":  # for it a failure is none
        return False
    return bool(story.node.server) or story.status is not Status.FAILURE
