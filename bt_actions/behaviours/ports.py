"""MoveRobot and Gripper with py_trees ports, for py_trees' own XML trees.

Importing this module, as `import bt_actions` does, makes the tags `MoveRobot` and `Gripper` known
to `py_trees.parsers.behaviour_tree_xml`. py_trees marks ports as experimental; nothing else here
depends on them.
"""

from __future__ import annotations

from typing import ClassVar

from py_trees.common import Status
from py_trees.ports import PortInformation, PortsMixin

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.utilities.units import parse_duration

Ports = dict[str, PortInformation]


class _ActionWithPorts(PortsMixin, ActionBehaviour):
    """An action whose goal's fields are input ports, and its result's fields output ports."""

    ACTION_TYPE: ClassVar[str]
    SERVER: ClassVar[str]

    def __init__(
        self,
        name: str,
        action_name: str = "",
        timeout: float | str | None = None,
        attempts: int | str = 1,
        behaviour_class_name: str | None = None,
    ) -> None:
        super().__init__(
            name,
            self.ACTION_TYPE,
            action_name or self.SERVER,
            self._read_goal,
            timeout=None if timeout is None else parse_duration(timeout),
            retry=int(attempts),  # an XML attribute is a text
            behaviour_class_name=behaviour_class_name,
        )

    def _read_goal(self) -> dict[str, object]:
        """The goal from the input ports; a port without data makes it INVALID_GOAL."""
        return {port: self.get_input(port) for port in self.input_ports()}

    def update(self) -> Status:
        status: Status = super().update()
        if status is Status.SUCCESS:
            for port in self.output_ports():
                self._set_output(port, getattr(self.result, port))
        return status


class MoveRobotWithPorts(_ActionWithPorts, tag="MoveRobot"):
    """``<MoveRobot name="To the part" distance="2.0" final_pose="{at}" timeout="30"/>``"""

    ACTION_TYPE = "robot_control_interfaces/action/MoveRobot"
    SERVER = "move_robot"
    INPUT_PORTS: Ports = {  # noqa: RUF012 - as PortsMixin declares it
        "distance": PortInformation(float, description="Where to, on the axis, m.")
    }
    OUTPUT_PORTS: Ports = {  # noqa: RUF012 - as above
        "final_pose": PortInformation(float, required=False, description="Where it is, m.")
    }


class GripperWithPorts(_ActionWithPorts, tag="Gripper"):
    """``<Gripper name="Close" position="0.0" stalled="{held}" timeout="10"/>``"""

    ACTION_TYPE = "robot_control_interfaces/action/Gripper"
    SERVER = "gripper_control"
    INPUT_PORTS: Ports = {  # noqa: RUF012 - as PortsMixin declares it
        "position": PortInformation(float, description="0 closed to 100 open."),
        "max_effort": PortInformation(
            float, required=False, default_value=0.0, description="N; 0 is the gripper's own."
        ),
    }
    OUTPUT_PORTS: Ports = {  # noqa: RUF012 - as above
        "stalled": PortInformation(bool, required=False, description="Stopped by something."),
        "reached_goal": PortInformation(bool, required=False, description="Came to `position`."),
    }
