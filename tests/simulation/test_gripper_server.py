"""The gripper's action server."""

from __future__ import annotations

import math
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from robot_control_interfaces.action import Gripper

from bt_actions.simulation import GripperServer, World
from tests.simulation.conftest import Bench, Client


@pytest.fixture
def stands_on() -> str:
    """What a server decides is the same everywhere."""
    return "virtual"


@pytest.fixture
def world() -> World:
    return World(part_at=0.0)


@pytest.fixture
def serve(bench: Bench, space: str, world: World) -> Any:
    def serve(*faults: str, speed: float = 20.0) -> Client:
        name = f"{space}/gripper_control"
        client = bench.client(Gripper, name)
        bench.serve(
            GripperServer(bench.node, world, name, faults=faults, speed=speed, journal=bench.path)
        )
        return client.until_ready()

    return serve


def test_it_opens_step_by_step(serve: Any) -> None:
    goal = serve(speed=5.0).send(position=100.0).until_ended()
    assert goal.status == GoalStatus.STATUS_SUCCEEDED
    assert (goal.result.position, goal.result.stalled, goal.result.reached_goal) == (
        100.0, False, True,
    )  # fmt: skip
    positions = [message.position for message in goal.all_feedback(10)]
    assert positions == [10.0 * n for n in range(1, 11)]
    assert [message.reached_goal for message in goal.feedback] == [False] * 9 + [True]


def test_it_stalls_on_the_part_and_holds_it(serve: Any, world: World) -> None:
    client = serve()
    client.send(position=100.0).until_ended()
    goal = client.send(position=0.0).until_ended()
    assert goal.status == GoalStatus.STATUS_SUCCEEDED
    assert (goal.result.position, goal.result.stalled, goal.result.reached_goal) == (
        40.0, True, False,
    )  # fmt: skip
    assert world.part.held_by
    client.send(position=100.0).until_ended()
    assert world.part.held_by is None


@pytest.mark.parametrize(
    "fields",
    [
        {"position": -0.0001},
        {"position": 100.0001},
        {"position": math.nan},
        {"position": math.inf},
        {"position": 50.0, "max_effort": math.nan},
        {"position": 50.0, "max_effort": -1.0},
    ],
)
def test_a_senseless_goal_is_refused(serve: Any, bench: Bench, fields: dict[str, float]) -> None:
    goal = serve().send(**fields)
    bench.until(lambda: goal.accepted is False)
    assert bench.events() == ["received", "rejected"]


def test_a_cancel_stops_the_fingers(serve: Any, world: World) -> None:
    goal = serve(speed=2.0).send(position=100.0).until_moving()
    goal.cancel()
    assert goal.until_ended().status == GoalStatus.STATUS_CANCELED
    assert 0.0 < goal.result.position == world.gripper.position < 100.0
    assert not goal.result.reached_goal


def test_the_part_can_fall_as_soon_as_it_is_gripped(serve: Any, world: World) -> None:
    client = serve("gripper_control:2:drop_part=10")
    client.send(position=100.0).until_ended()
    goal = client.send(position=0.0).until_ended()
    assert goal.status == GoalStatus.STATUS_SUCCEEDED
    assert world.part.held_by is None
