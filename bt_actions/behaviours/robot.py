"""Leaves that move the demo's robot and its gripper. All of their life is ActionBehaviour's."""

from __future__ import annotations

from typing import Any

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.variables import Var


class MoveRobot(ActionBehaviour):
    """A leaf that moves the robot to `distance`, in metres on its axis, or to a Var's value.

    Keyword arguments are those of ActionBehaviour.
    """

    def __init__(
        self, name: str, distance: float | Var, *, action_name: str = "move_robot", **kwargs: Any
    ) -> None:
        super().__init__(
            name,
            "robot_control_interfaces/action/MoveRobot",
            action_name,
            {"distance": distance},
            **kwargs,
        )


class Gripper(ActionBehaviour):
    """A leaf that moves the gripper to `position`, from 0 (closed) to 100 (open).

    `max_effort` is in N, 0 for the gripper's own. Both may be a Var. The result shows whether the
    gripper holds something: ``expect="result.stalled"``. Keyword arguments are those of
    ActionBehaviour.
    """

    def __init__(
        self,
        name: str,
        position: float | Var,
        *,
        max_effort: float | Var = 0.0,
        action_name: str = "gripper_control",
        **kwargs: Any,
    ) -> None:
        super().__init__(
            name,
            "robot_control_interfaces/action/Gripper",
            action_name,
            {"position": position, "max_effort": max_effort},
            **kwargs,
        )
