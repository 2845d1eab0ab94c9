"""Simulated robots, their action servers, and faults on purpose.

The names that need no ROS import without it; the servers are imported when first asked for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from bt_actions.simulation.fault_plan import FaultPlan
from bt_actions.simulation.faults import Fault, FaultError, FaultKind
from bt_actions.simulation.gripper import GripperSimulator
from bt_actions.simulation.robot import RobotSimulator, RobotStatus
from bt_actions.simulation.world import Part, Station, World, WorldEvent

if TYPE_CHECKING:
    from bt_actions.simulation.gripper_control import GripperServer
    from bt_actions.simulation.move_robot import MoveRobotServer
    from bt_actions.simulation.scripted import Script, ScriptedServer
    from bt_actions.simulation.simulation import Simulation

__all__ = [
    "Fault",
    "FaultError",
    "FaultKind",
    "FaultPlan",
    "GripperServer",
    "GripperSimulator",
    "MoveRobotServer",
    "Part",
    "RobotSimulator",
    "RobotStatus",
    "Script",
    "ScriptedServer",
    "Simulation",
    "Station",
    "World",
    "WorldEvent",
]

_NEED_ROS = {
    "GripperServer": "gripper_control",
    "MoveRobotServer": "move_robot",
    "Script": "scripted",
    "ScriptedServer": "scripted",
    "Simulation": "simulation",
}


def __getattr__(name: str) -> object:
    if name in _NEED_ROS:
        module = importlib.import_module(f"{__name__}.{_NEED_ROS[name]}")
        return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
