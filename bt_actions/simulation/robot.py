"""A robot on one axis, moving step by step. No ROS, no clock: its owner calls `move_step`.

The robot moves as in the article this project starts from: each step covers a tenth of the rest of
the way, and the robot has arrived when less than a centimetre is left.
"""

from __future__ import annotations

import math
from enum import IntEnum

STEP_FRACTION = 0.1
"""Part of the rest of the way that one step covers."""
TOLERANCE = 0.01
"""Distance from the target within which the robot has arrived, m."""
LIMIT = 10.0
"""The length of the axis on either side of zero, m."""


class RobotStatus(IntEnum):
    """The status of the robot, with the values of MoveRobot's feedback constants."""

    READY = 0
    MOVING = 1
    COMPLETED = 2


def refusal(distance: float) -> str | None:
    """Return the reason against `distance` (m), or None."""
    if not math.isfinite(distance):
        return f"the distance must be a finite number, not {distance}"
    if abs(distance) > LIMIT:
        return f"{distance!r} m is beyond the end of the axis, ±{LIMIT:g} m"
    return None


class RobotSimulator:
    """The robot: its pose, its target, and its steps."""

    def __init__(self, pose: float = 0.0) -> None:
        self.current_pose = pose
        self.target_pose = pose
        self._status = RobotStatus.READY

    def __repr__(self) -> str:
        return f"<RobotSimulator {self._status.name} {self.current_pose:.3f} m>"

    def set_goal(self, distance: float) -> None:
        """Begin to move to `distance`, a position on the axis in metres.

        Raises ValueError, and moves nowhere, when it is not finite or beyond the axis.
        """
        if reason := refusal(distance):
            raise ValueError(reason)
        self.target_pose = distance
        self._status = RobotStatus.MOVING

    def move_step(self, share: float = 1.0) -> float:
        """Cover a tenth of the rest of the way, or `share` (0 to 1) of that tenth.

        Return the pose.
        """
        if self._status is RobotStatus.MOVING:
            self.current_pose += STEP_FRACTION * share * (self.target_pose - self.current_pose)
        return self.current_pose

    def get_status(self) -> RobotStatus:
        """Return the status of the robot, which has COMPLETED within TOLERANCE of its target."""
        near = abs(self.current_pose - self.target_pose) < TOLERANCE
        if self._status is RobotStatus.MOVING and near:
            self._status = RobotStatus.COMPLETED
        return self._status

    def stop(self) -> None:
        """Stop the robot where it is, and forget the rest of the way."""
        self.target_pose = self.current_pose
        self._status = RobotStatus.READY
