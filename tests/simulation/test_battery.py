"""The battery empties on the way and fills at home."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_actions.simulation.battery import Battery
from bt_actions.simulation.stepper import Stepper
from bt_actions.simulation.world import World
from bt_actions.testing import VirtualNetwork


class Robot:
    """A robot that is put somewhere, and its battery."""

    def __init__(self) -> None:
        self.world = World()
        self.battery = Battery(Stepper(VirtualNetwork()), self.world)

    def drive(self, to: float) -> float:
        """Let the robot be there a moment later; return its charge."""
        self.world.robot.current_pose = to
        self.battery.publish(1.0)
        return self.battery.charge


def test_driving_takes_charge_in_either_direction() -> None:
    robot = Robot()
    assert robot.drive(10.0) == pytest.approx(0.99)
    assert robot.drive(0.0) == pytest.approx(0.98)


def test_rest_at_home_fills_it_and_elsewhere_does_not() -> None:
    robot = Robot()
    robot.battery.charge = 0.5
    robot.battery.publish(10.0)
    assert robot.battery.charge == pytest.approx(0.6)
    robot.drive(3.0)
    charge = robot.battery.charge
    robot.battery.publish(10.0)
    assert robot.battery.charge == charge


@given(st.lists(st.floats(-1e6, 1e6) | st.just(0.0)))
def test_the_charge_stays_between_none_and_all(places: list[float]) -> None:
    robot = Robot()
    assert all(0.0 <= robot.drive(place) <= 1.0 for place in places)
