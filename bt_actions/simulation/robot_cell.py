"""One robot of a simulation: its world, its two action servers, and its battery's topic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bt_actions.simulation.battery import Battery
from bt_actions.simulation.gripper_control import GripperServer
from bt_actions.simulation.move_robot import MoveRobotServer
from bt_actions.simulation.stepper import Stepper
from bt_actions.simulation.world import World, WorldEvent


class RobotCell:
    """A robot, its gripper and a part, under the names of one namespace."""

    def __init__(
        self,
        stepper: Stepper,
        namespace: str,
        *,
        on_event: Callable[[WorldEvent], None],
        **settings: Any,
    ) -> None:
        """Serve `move_robot` and `gripper_control` in `namespace`; both get the `settings`."""
        self.namespace = namespace
        prefix = f"{namespace.rstrip('/')}/" if namespace else ""
        name = namespace.strip("/") or "the robot"
        self.world = World(name=name, on_event=on_event)
        platform, settings["stepper"] = stepper.platform, stepper
        self.move_robot = MoveRobotServer(platform, self.world, f"{prefix}move_robot", **settings)
        self.gripper = GripperServer(platform, self.world, f"{prefix}gripper_control", **settings)
        self.battery = Battery(stepper, self.world, prefix)

    def __repr__(self) -> str:
        return f"<RobotCell {self.namespace or '/'} {self.world!r}>"

    @property
    def servers(self) -> tuple[MoveRobotServer, GripperServer]:
        """Both action servers."""
        return self.move_robot, self.gripper

    def close(self) -> None:
        """Close the servers and the topic."""
        for server in self.servers:
            server.close()
        self.battery.close()
