"""A gripper whose fingers open and close step by step. No ROS, no clock, no idea what it holds."""

from __future__ import annotations

import math

CLOSED = 0.0
OPEN = 100.0
STEP = 10.0
"""How far the fingers go in one step, percent of the whole stroke."""


def refusal(position: float, max_effort: float = 0.0) -> str | None:
    """Return why the gripper cannot go to `position` (percent) with that effort (N), or None."""
    if not math.isfinite(position):
        return f"the position must be a finite number, not {position}"
    if not CLOSED <= position <= OPEN:
        return f"the position {position!r} is outside {CLOSED:g} (closed) to {OPEN:g} (open)"
    if not math.isfinite(max_effort) or max_effort < 0.0:
        return f"the effort must be zero or more and finite, not {max_effort}"
    return None


class GripperSimulator:
    """How far the fingers are open (percent), where they are going, and whether they are stuck."""

    def __init__(self, position: float = CLOSED) -> None:
        self.position = position
        self.target = position
        self.stalled = False

    def __repr__(self) -> str:
        state = "stalled" if self.stalled else "at" if self.reached else "moving,"
        return f"<GripperSimulator {state} {self.position:g}>"

    @property
    def reached(self) -> bool:
        """The fingers are where they were sent."""
        return self.position == self.target

    @property
    def done(self) -> bool:
        """The fingers will not move any more, either way."""
        return self.reached or self.stalled

    def set_goal(self, position: float) -> None:
        """Begin to move to `position`, 0 closed to 100 open.

        Raises ValueError, and moves nowhere, when it is not finite or out of that range.
        """
        if reason := refusal(position):
            raise ValueError(reason)
        self.target = position
        self.stalled = False

    def move_step(self, share: float = 1.0, between: float | None = None) -> float:
        """Go one step, or `share` (0 to 1) of one, and return the position.

        `between` is how wide the thing between the fingers is: closing, they stall on it.
        """
        way = self.target - self.position
        reach = STEP * share
        wanted = self.target if abs(way) <= reach else self.position + math.copysign(reach, way)
        self.stalled = between is not None and wanted < between <= self.position
        self.position = between if self.stalled and between is not None else wanted
        return self.position

    def stop(self) -> None:
        """Stand still where the fingers are."""
        self.target = self.position
