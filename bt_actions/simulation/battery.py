"""The battery of a simulated robot, and its topic."""

from __future__ import annotations

from sensor_msgs.msg import BatteryState

from bt_actions.simulation.stepper import Stepper
from bt_actions.simulation.world import HOME, World

VOLTAGE = 24.0
PER_METRE = 0.001
"""Charge that one metre takes, of 1."""
PER_SECOND_AT_HOME = 0.01
"""Charge that comes back in one simulated second at home, of 1."""
PERIOD = 1.0
"""Wall seconds between two messages of the charge;"""
PERIOD_AT_FIRST, AT_FIRST = 0.05, 3.0
"""and in the first seconds, in which a listener may not be discovered yet."""


class Battery:
    """A battery that empties on the way of a robot and fills at home."""

    def __init__(self, stepper: Stepper, world: World, prefix: str = "") -> None:
        """Publish on `battery_state` behind `prefix`, from now on."""
        self.charge = 1.0
        self._world = world
        self._pose = world.robot.current_pose
        self._stepper = stepper
        self._publisher = stepper.platform.publisher(BatteryState, f"{prefix}battery_state")
        self._began = stepper.now()
        self._publish_again(self._began)

    def publish(self, seconds: float) -> None:
        """Publish the charge, `seconds` of simulated time after the last call."""
        pose = self._world.robot.current_pose
        if pose != self._pose:
            self.charge = max(0.0, self.charge - PER_METRE * abs(pose - self._pose))
        elif self._world.station_at(pose) == HOME:
            self.charge = min(1.0, self.charge + PER_SECOND_AT_HOME * seconds)
        self._pose = pose
        message = BatteryState(
            voltage=VOLTAGE,
            percentage=self.charge,
            present=True,
            power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        )
        self._publisher.publish(message)

    def close(self) -> None:
        """Destroy the topic, once the stepper is closed."""
        self._publisher.destroy()

    def _publish_again(self, now: float, passed: float = 0.0) -> None:
        self.publish(passed * self._stepper.speed)
        period = PERIOD_AT_FIRST if now - self._began < AT_FIRST else PERIOD
        self._stepper.call_at(now + period, lambda now: self._publish_again(now, period))
