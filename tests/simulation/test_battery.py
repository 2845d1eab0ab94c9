"""The battery empties on the way and fills at home."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_actions.simulation.robot_cell import RobotCell
from bt_actions.testing import VirtualNetwork


def cell() -> RobotCell:
    return RobotCell(VirtualNetwork(), "", on_event=lambda event: None)


def drive(robot: RobotCell, to: float) -> float:
    """Let the robot be there a moment later; return its charge."""
    robot.world.robot.current_pose = to
    robot.publish_battery(1.0)
    return robot.charge


def test_driving_takes_charge_in_either_direction() -> None:
    robot = cell()
    assert drive(robot, 10.0) == pytest.approx(0.99)
    assert drive(robot, 0.0) == pytest.approx(0.98)


def test_rest_at_home_fills_it_and_elsewhere_does_not() -> None:
    robot = cell()
    robot.charge = 0.5
    robot.publish_battery(10.0)
    assert robot.charge == pytest.approx(0.6)
    drive(robot, 3.0)
    charge = robot.charge
    robot.publish_battery(10.0)
    assert robot.charge == charge


@given(st.lists(st.floats(-1e6, 1e6) | st.just(0.0)))
def test_the_charge_stays_between_none_and_all(places: list[float]) -> None:
    robot = cell()
    assert all(0.0 <= drive(robot, place) <= 1.0 for place in places)
