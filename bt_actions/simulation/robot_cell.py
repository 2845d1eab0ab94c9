"""One robot of a simulation: its world, its two action servers, and its battery's topic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sensor_msgs.msg import BatteryState

from bt_actions.simulation.gripper_control import GripperServer
from bt_actions.simulation.move_robot import MoveRobotServer
from bt_actions.simulation.platform import Platform
from bt_actions.simulation.world import HOME, World, WorldEvent

VOLTAGE = 24.0
PER_METRE = 0.001
"""Charge that one metre takes, of 1."""
PER_SECOND_AT_HOME = 0.01
"""Charge that comes back in one simulated second at home, of 1."""


class RobotCell:
    """A robot, its gripper and a part, under the names of one namespace."""

    def __init__(
        self,
        platform: Platform,
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
        self.charge = 1.0
        self._pose = self.world.robot.current_pose
        self.move_robot = MoveRobotServer(platform, self.world, f"{prefix}move_robot", **settings)
        self.gripper = GripperServer(platform, self.world, f"{prefix}gripper_control", **settings)
        self._battery_state = platform.publisher(BatteryState, f"{prefix}battery_state")

    def __repr__(self) -> str:
        return f"<RobotCell {self.namespace or '/'} {self.world!r}>"

    @property
    def servers(self) -> tuple[MoveRobotServer, GripperServer]:
        """Both action servers."""
        return self.move_robot, self.gripper

    def publish_battery(self, seconds: float) -> None:
        """Publish the charge, `seconds` of simulated time after the last call."""
        pose = self.world.robot.current_pose
        if pose != self._pose:
            self.charge = max(0.0, self.charge - PER_METRE * abs(pose - self._pose))
        elif self.world.station_at(pose) == HOME:
            self.charge = min(1.0, self.charge + PER_SECOND_AT_HOME * seconds)
        self._pose = pose
        message = BatteryState(
            voltage=VOLTAGE,
            percentage=self.charge,
            present=True,
            power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        )
        self._battery_state.publish(message)

    def close(self) -> None:
        """Close the servers and the topic."""
        for server in self.servers:
            server.close()
        self._battery_state.destroy()
