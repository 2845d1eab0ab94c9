"""The leaf that moves a robot along its axis. All of its life is ActionBehaviour's."""

from __future__ import annotations

from typing import Any

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.variables import Var


class MoveRobot(ActionBehaviour):
    """Moves the robot to `distance`, a position on its axis in metres, or a Var that holds one.

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
