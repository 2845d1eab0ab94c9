"""The robot's action server: refuses, moves, stops when canceled, gives up, makes way."""

from __future__ import annotations

import math
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from robot_control_interfaces.action import MoveRobot

from bt_actions.simulation import MoveRobotServer, RobotStatus, World
from bt_actions.simulation import journal as j
from tests.simulation.conftest import Bench, Client


@pytest.fixture
def stands_on() -> str:
    """What a server decides is the same everywhere."""
    return "virtual"


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def serve(bench: Bench, space: str, world: World) -> Any:
    def serve(*faults: str, speed: float = 20.0) -> Client:
        name = f"{space}/move_robot"
        client = bench.client(MoveRobot, name)
        bench.serve(
            MoveRobotServer(bench.node, world, name, faults=faults, speed=speed, journal=bench.path)
        )
        return client.until_ready()

    return serve


def test_the_states_of_the_robot_are_those_of_the_message() -> None:
    assert {status.name: status.value for status in RobotStatus} == {
        "READY": MoveRobot.Feedback.STATUS_READY,
        "MOVING": MoveRobot.Feedback.STATUS_MOVING,
        "COMPLETED": MoveRobot.Feedback.STATUS_COMPLETED,
    }


def test_it_arrives_and_gives_feedback_each_step(serve: Any, bench: Bench, world: World) -> None:
    goal = serve(speed=10.0).send(distance=-2.0).until_ended()
    assert goal.status == GoalStatus.STATUS_SUCCEEDED
    assert goal.result.status == MoveRobot.Result.STATUS_COMPLETED
    assert goal.result.final_pose == world.robot.current_pose == pytest.approx(-2.0, abs=0.01)
    poses = [entry.pose for entry in bench.entries() if entry.event is j.Event.STEP]
    assert len(poses) == 51
    assert [round(message.current_pose, 6) for message in goal.feedback] == poses
    moving, completed = MoveRobot.Feedback.STATUS_MOVING, MoveRobot.Feedback.STATUS_COMPLETED
    assert {message.status for message in goal.feedback} <= {moving, completed}


@pytest.mark.parametrize(
    "distance", [math.nan, math.inf, -math.inf, 10.0001, -10.0001, 1.7e308, -1.7e308]
)
def test_a_goal_beyond_the_axis_is_refused_with_a_reason_in_the_log(
    serve: Any, bench: Bench, world: World, distance: float
) -> None:
    goal = serve().send(distance=distance)
    bench.until(lambda: goal.accepted is False)
    assert world.robot.current_pose == 0.0
    assert bench.events() == ["received", "rejected"]
    reason = bench.entries()[-1].reason
    assert "finite" in reason or "beyond" in reason
    assert reason in str(bench.node.log.lines)


def test_a_cancel_stops_it_where_it_is(serve: Any, bench: Bench, world: World) -> None:
    goal = serve(speed=5.0).send(distance=9.0).until_moving()
    goal.cancel()
    goal.until_ended()
    assert goal.status == GoalStatus.STATUS_CANCELED
    assert goal.result.status == MoveRobot.Result.STATUS_CANCELED
    stopped_at = world.robot.current_pose
    assert goal.result.final_pose == stopped_at < 9.0
    assert world.robot.get_status() is RobotStatus.READY
    bench.go_on_for(0.2)
    assert world.robot.current_pose == stopped_at
    assert bench.events() == [
        "received", "accepted", "cancel_requested", "cancel_accepted", "canceled",
    ]  # fmt: skip


def test_a_newer_goal_aborts_the_older(serve: Any, bench: Bench, world: World) -> None:
    client = serve(speed=5.0)
    older = client.send(distance=9.0).until_moving()
    newer = client.send(distance=-1.0)
    older.until_ended()
    assert older.status == GoalStatus.STATUS_ABORTED
    assert older.result.status == MoveRobot.Result.STATUS_FAULT
    assert "newer goal" in older.result.message
    assert newer.until_ended().status == GoalStatus.STATUS_SUCCEEDED
    assert world.robot.current_pose == pytest.approx(-1.0, abs=0.01)
    assert bench.events() == [
        "received", "accepted", "received", "accepted", "aborted", "succeeded",
    ], "the journal shows a client that sent two at once"  # fmt: skip


def test_it_gives_up_after_thirty_simulated_seconds(serve: Any, bench: Bench) -> None:
    goal = serve("move_robot:1:slow=1000", speed=100.0).send(distance=9.0).until_ended()
    assert goal.status == GoalStatus.STATUS_ABORTED
    assert goal.result.status == MoveRobot.Result.STATUS_TIMEOUT
    assert "30 s" in goal.result.message
    steps = [entry for entry in bench.entries() if entry.event is j.Event.STEP]
    assert len(steps) == 300


def test_an_aborted_goal_says_that_it_was_a_fault(serve: Any) -> None:
    goal = serve("move_robot:1:abort").send(distance=2.0).until_ended()
    assert goal.status == GoalStatus.STATUS_ABORTED
    assert goal.result.status == MoveRobot.Result.STATUS_FAULT
    assert goal.result.final_pose >= 1.0
