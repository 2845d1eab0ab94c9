"""The robot moves as in the article: a tenth of what is left each step, to within a centimetre."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_actions.simulation.robot import LIMIT, TOLERANCE, RobotSimulator, RobotStatus

targets = st.floats(-LIMIT, LIMIT)


def test_a_step_covers_a_tenth_of_what_is_left() -> None:
    robot = RobotSimulator()
    robot.set_goal(2.0)
    assert robot.move_step() == pytest.approx(0.2)
    assert robot.move_step() == pytest.approx(0.38)


def test_it_does_not_move_before_a_goal_nor_after_it_was_stopped() -> None:
    robot = RobotSimulator(1.0)
    assert robot.move_step() == 1.0
    assert robot.get_status() is RobotStatus.READY
    robot.set_goal(2.0)
    robot.move_step()
    assert robot.get_status() is RobotStatus.MOVING
    robot.stop()
    stopped_at = robot.current_pose
    assert robot.move_step() == stopped_at
    assert robot.get_status() is RobotStatus.READY


@pytest.mark.parametrize("distance", [math.nan, math.inf, -math.inf, 10.0001, -10.0001, 1e308])
def test_a_goal_beyond_the_axis_is_refused_and_changes_nothing(distance: float) -> None:
    robot = RobotSimulator()
    robot.set_goal(1.0)
    with pytest.raises(ValueError, match=r"finite|axis"):
        robot.set_goal(distance)
    assert robot.target_pose == 1.0


@given(start=targets, target=targets)
def test_it_arrives_from_anywhere_without_passing_its_target(start: float, target: float) -> None:
    robot = RobotSimulator(start)
    robot.set_goal(target)
    left = abs(target - start)
    for _ in range(80):
        if robot.get_status() is RobotStatus.COMPLETED:
            break
        robot.move_step()
        now_left = abs(target - robot.current_pose)
        assert now_left <= left
        assert (target - robot.current_pose) * (target - start) >= 0
        left = now_left
    assert robot.get_status() is RobotStatus.COMPLETED
    assert left < TOLERANCE


@given(target=targets, share=st.floats(0.01, 1.0))
def test_a_smaller_share_of_a_step_covers_that_much_less(target: float, share: float) -> None:
    slow, fast = RobotSimulator(), RobotSimulator()
    for robot in (slow, fast):
        robot.set_goal(target)
    slow.move_step(share)
    fast.move_step()
    assert abs(slow.current_pose) <= abs(fast.current_pose)
    assert slow.current_pose == pytest.approx(share * fast.current_pose)
