"""`MoveRobot` and `Gripper` as tags of py_trees' own XML trees, with ports.

`import bt_actions` imports this file together with `py_trees.parsers`, which then knows the tags.
py_trees marks ports as experimental.
"""

from __future__ import annotations

from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation, PortsMixin

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.utilities.units import parse_duration


class _ActionWithPorts(PortsMixin, ActionBehaviour):
    """An action whose goal's fields are input ports, and its result's fields output ports."""

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
            # A port without data makes the goal INVALID_GOAL
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


class MoveRobotWithPorts(_ActionWithPorts, tag="MoveRobot"):
    """``<MoveRobot name="To the part" distance="2.0" final_pose="{at}" timeout="30"/>``"""

    ACTION_TYPE, SERVER = "robot_control_interfaces/action/MoveRobot", "move_robot"
    INPUT_PORTS = {  # noqa: RUF012 - as PortsMixin declares it
        "distance": PortInformation(float, description="Where to, on the axis, m.")
    }
    OUTPUT_PORTS = {  # noqa: RUF012 - as above
        "final_pose": PortInformation(float, required=False, description="Where it is, m.")
    }


class GripperWithPorts(_ActionWithPorts, tag="Gripper"):
    """``<Gripper name="Close" position="0.0" stalled="{held}" timeout="10"/>``"""

    ACTION_TYPE, SERVER = "robot_control_interfaces/action/Gripper", "gripper_control"
    INPUT_PORTS = {  # noqa: RUF012 - as above
        "position": PortInformation(float, description="0 closed to 100 open."),
        "max_effort": PortInformation(
            float, required=False, default_value=0.0, description="N; 0 is the gripper's own."
        ),
    }
    OUTPUT_PORTS = {  # noqa: RUF012 - as above
        "stalled": PortInformation(bool, required=False, description="Stopped by something."),
        "reached_goal": PortInformation(bool, required=False, description="Came to `position`."),
    }
