"""One robot of a simulation: its world, its two action servers, and its battery's topic."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from sensor_msgs.msg import BatteryState

from bt_actions.ros.workarounds.closable import closable
from bt_actions.simulation.battery import Battery
from bt_actions.simulation.gripper_control import GripperServer
from bt_actions.simulation.move_robot import MoveRobotServer
from bt_actions.simulation.world import HOME, World, WorldEvent

VOLTAGE = 24.0


class RobotCell:
    """A robot, its gripper and a part, under the names of one namespace."""

    def __init__(
        self,
        node: Node,
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
        self.battery = Battery()
        self._pose = self.world.robot.current_pose
        self._node = node
        self.move_robot = MoveRobotServer(node, self.world, f"{prefix}move_robot", **settings)
        self.gripper = GripperServer(node, self.world, f"{prefix}gripper_control", **settings)
        battery_state = node.create_publisher(BatteryState, f"{prefix}battery_state", 10)
        self._battery_state = closable(battery_state)

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
            self.battery.drive(pose - self._pose)
        elif self.world.station_at(pose) == HOME:
            self.battery.rest_at_home(seconds)
        self._pose = pose
        message = BatteryState(
            voltage=VOLTAGE,
            percentage=self.battery.charge,
            present=True,
            power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        )
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._battery_state.publish(message)

    def close(self) -> None:
        """Close the servers and the topic."""
        for server in self.servers:
            server.close()
        with contextlib.suppress(InvalidHandle):  # the node was destroyed before its simulation
            self._node.destroy_publisher(self._battery_state)
