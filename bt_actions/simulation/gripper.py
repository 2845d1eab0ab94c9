"""A gripper whose fingers open and close step by step.

No ROS, no clock, no knowledge of the part.
"""

from __future__ import annotations

import math

CLOSED = 0.0
OPEN = 100.0
STEP = 10.0
"""The way of the fingers in one step, in percent of the whole stroke."""


def refusal(position: float, max_effort: float = 0.0) -> str | None:
    """Return the reason against `position` (percent) with that effort (N), or None."""
    if not math.isfinite(position):
        return f"the position must be a finite number, not {position}"
    if not CLOSED <= position <= OPEN:
        return f"the position {position!r} is outside {CLOSED:g} (closed) to {OPEN:g} (open)"
    if not math.isfinite(max_effort) or max_effort < 0.0:
        return f"the effort must be zero or more and finite, not {max_effort}"
    return None


class GripperSimulator:
    """The fingers: their opening (percent), their target, and whether they are stuck."""

    def __init__(self, position: float = CLOSED) -> None:
        self.position = position
        self.target = position
        self.stalled = False

    def __repr__(self) -> str:
        state = "stalled" if self.stalled else "at" if self.reached else "moving,"
        return f"<GripperSimulator {state} {self.position:g}>"

    @property
    def reached(self) -> bool:
        """Whether the fingers are at their target."""
        return self.position == self.target

    @property
    def done(self) -> bool:
        """Whether the fingers move no more, at the target or stuck."""
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

        `between` is the width of the thing between the fingers: closing, they stall on it.
        """
        way = self.target - self.position
        reach = STEP * share
        wanted = self.target if abs(way) <= reach else self.position + math.copysign(reach, way)
        self.stalled = between is not None and wanted < between <= self.position
        self.position = between if self.stalled and between is not None else wanted
        return self.position

    def stop(self) -> None:
        """Stop the fingers where they are."""
        self.target = self.position
