"""The gripper goes step by step, and stalls on what is between its fingers."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_actions.simulation.gripper import STEP, GripperSimulator, refusal

positions = st.floats(0.0, 100.0)


def test_it_opens_in_ten_steps() -> None:
    gripper = GripperSimulator()
    gripper.set_goal(100.0)
    seen = [gripper.move_step() for _ in range(10)]
    assert seen == [10.0 * n for n in range(1, 11)]
    assert gripper.reached
    assert gripper.done
    assert not gripper.stalled


def test_closing_it_stalls_on_what_is_between_the_fingers() -> None:
    gripper = GripperSimulator(100.0)
    gripper.set_goal(0.0)
    while not gripper.done:
        gripper.move_step(between=35.0)
    assert gripper.position == 35.0
    assert gripper.stalled
    assert not gripper.reached


def test_closing_to_exactly_the_part_reaches_it_without_force() -> None:
    gripper = GripperSimulator(45.0)
    gripper.set_goal(40.0)
    gripper.move_step(between=40.0)
    assert gripper.reached
    assert not gripper.stalled


@pytest.mark.parametrize("position", [math.nan, math.inf, -math.inf, -0.0001, 100.0001])
def test_a_position_outside_the_stroke_is_refused(position: float) -> None:
    gripper = GripperSimulator()
    with pytest.raises(ValueError, match=r"finite|outside"):
        gripper.set_goal(position)
    assert gripper.target == 0.0


@pytest.mark.parametrize("effort", [math.nan, math.inf, -1.0])
def test_a_senseless_effort_is_refused(effort: float) -> None:
    assert "effort" in str(refusal(50.0, effort))


@given(start=positions, target=positions, between=st.none() | positions)
def test_it_always_ends_and_never_goes_through_anything(
    start: float, target: float, between: float | None
) -> None:
    gripper = GripperSimulator(start)
    gripper.set_goal(target)
    for _ in range(12):
        before = gripper.position
        gripper.move_step(between=between)
        assert 0.0 <= gripper.position <= 100.0
        assert abs(gripper.position - before) <= STEP * (1 + 1e-9)
        if between is not None and before >= between:
            assert gripper.position >= min(between, before)
    assert gripper.done
