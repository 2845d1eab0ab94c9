"""The player of a recording: its moment, its speed, the meaning of each key.

Reads no clock and no key, and draws nothing: callers give passed time and keys.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right

from bt_actions.recording.tape import Tape
from bt_actions.story.state import State

SPEEDS = (1.0, 2.0, 5.0, 10.0, 100.0)
STEPS = {"left": -5.0, "right": 5.0, "down": -60.0, "up": 60.0}
"""The seconds of each key."""


class Player:
    """A tape with a moment, which stops at its end."""

    def __init__(self, tape: Tape, speed: float = 1.0) -> None:
        """Begin with the run; `speed` is in seconds of the run for one of the user's."""
        self._tape = tape
        self.first, self.last = tape.end.started, tape.times[-1]
        """The begin of the run and the end of the recording, on the steady clock."""
        self.speed, self.is_paused = speed, False
        self.said = ""
        """Why the latest key did nothing, or ""."""
        self._go(self.first)

    @property
    def state(self) -> State:
        """The state of the run at this moment; to be read until the next call."""
        return self._tape.seek(self._position)

    def let_pass(self, seconds: float) -> None:
        """Let seconds of the user's time pass."""
        if not self.is_paused:
            self._go(self.now + seconds * self.speed)
            self.is_paused = self.now >= self.last

    def press(self, key: str) -> None:
        """Do what a key means; ignore a key without a meaning."""
        self.said = ""
        if key == " ":
            if self.now >= self.last:  # from the beginning, as players do
                self._go(self.first)
            self.is_paused = not self.is_paused
        elif key in STEPS:
            self._go(self.now + STEPS[key])
        elif key in (",", "."):
            self._stop_at(self._position + (1 if key == "." else -1))
        elif key == "n":
            self._to_failure(bisect_right(self._tape.failures, self._position), "later")
        elif key == "N":
            self._to_failure(bisect_left(self._tape.failures, self._position) - 1, "earlier")
        elif key in ("+", "="):
            self.speed = min((each for each in SPEEDS if each > self.speed), default=self.speed)
        elif key == "-":
            self.speed = max((each for each in SPEEDS if each < self.speed), default=self.speed)

    def _to_failure(self, number: int, which: str) -> None:
        failures = self._tape.failures
        if 0 <= number < len(failures):
            self._stop_at(failures[number])
        else:
            self.said = f"no {which} failure"

    def _go(self, moment: float) -> None:
        self.now = min(max(moment, self.first), self.last)
        self._position = self._tape.after(self.now)

    def _stop_at(self, position: int) -> None:
        """Stop behind an event, where others of the same moment may follow."""
        self._position = min(max(position, self._tape.after(self.first)), len(self._tape))
        self.now, self.is_paused = self._tape.times[self._position - 1], True
