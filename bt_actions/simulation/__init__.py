"""Simulated robots, their action servers, and faults on purpose.

Only `ros/` imports rclpy, where a server is made on an rclpy node. The servers' messages are
imported when a server's name is first asked for.
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
    from bt_actions.simulation.recorded.servers import RecordedServers
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
    "RecordedServers",
    "RobotSimulator",
    "RobotStatus",
    "Script",
    "ScriptedServer",
    "Simulation",
    "Station",
    "World",
    "WorldEvent",
]

_NEED_MESSAGES = {
    "GripperServer": "gripper_control",
    "MoveRobotServer": "move_robot",
    "RecordedServers": "recorded.servers",
    "Script": "scripted",
    "ScriptedServer": "scripted",
    "Simulation": "simulation",
}


def __getattr__(name: str) -> object:
    if name in _NEED_MESSAGES:
        module = importlib.import_module(f"{__name__}.{_NEED_MESSAGES[name]}")
        return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
