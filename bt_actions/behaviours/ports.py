"""The tags `MoveRobot` and `Gripper` of py_trees' own XML trees, with their ports.

After `import bt_actions` this file is imported with `py_trees.parsers`, to which it makes the tags
known; the leaf that stands for both, in robot.py, when a tree has one. py_trees marks ports as
experimental.
"""

from __future__ import annotations

from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.ports import PortInformation, PortsMixin


class _Tag(PortsMixin, Behaviour):
    """Makes a leaf in place of an object of its own."""

    update: Any = None
    """Not abstract, as py_trees wants its classes; there is none that it is called of."""

    def __new__(cls, *args: Any, **settings: Any) -> Any:
        """Make the leaf."""
        from bt_actions.behaviours.robot import leaf_of

        return leaf_of(cls)(*args, **settings)


class MoveRobot(_Tag):
    """``<MoveRobot name="To the part" distance="2.0" final_pose="{at}" timeout="30"/>``"""

    ACTION_TYPE, SERVER = "robot_control_interfaces/action/MoveRobot", "move_robot"
    INPUT_PORTS = {  # noqa: RUF012 - as PortsMixin declares it
        "distance": PortInformation(float, description="Where to, on the axis, m.")
    }
    OUTPUT_PORTS = {  # noqa: RUF012 - as above
        "final_pose": PortInformation(float, required=False, description="Where it is, m.")
    }


class Gripper(_Tag):
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
