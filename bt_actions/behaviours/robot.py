"""Leaves that move the demo's robot and its gripper. All of their life is ActionBehaviour's."""

from __future__ import annotations

import functools
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortsMixin

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.variables import Var
from bt_actions.utilities.units import parse_duration


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


class Gripper(ActionBehaviour):
    """Moves the gripper to `position`, from 0 (closed) to 100 (open).

    `max_effort` is in N, 0 for the gripper's own. Both may be a Var. Whether something is held
    shows in the result: ``expect="result.stalled"``. Keyword arguments are those of
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


class ActionWithPorts(PortsMixin, ActionBehaviour):
    """An action whose goal's fields are input ports, and its result's fields output ports.

    Of py_trees' XML trees; their tags are in ports.py.
    """

    ACTION_TYPE: str
    SERVER: str

    def __init__(
        self,
        name: str,
        action_name: str = "",
        timeout: float | str | None = None,
        attempts: int | str = 1,
        **ports: Any,
    ) -> None:
        super().__init__(
            name,
            self.ACTION_TYPE,
            action_name or self.SERVER,
            # A port without data makes it INVALID_GOAL
            lambda: {port: self.get_input(port) for port in self.input_ports()},
            timeout=None if timeout is None else parse_duration(timeout),
            retry=int(attempts),  # an XML attribute is a text
            **ports,
        )

    def update(self) -> Status:
        status = super().update()
        if status is Status.SUCCESS:
            for port in self.output_ports():
                self._set_output(port, getattr(self.result, port))
        return status


@functools.cache
def leaf_of(tag: Any) -> type[ActionWithPorts]:
    """Return the class of leaves that a tag of ports.py stands for."""
    own = {name: value for name, value in vars(tag).items() if name.isupper()}
    return type(f"{tag.__name__}WithPorts", (ActionWithPorts,), own, register=False)
