"""What clients must not do, done to a server: it goes on, and its journal tells."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from test_msgs.action import Fibonacci
from unique_identifier_msgs.msg import UUID

from bt_actions.simulation import Script, ScriptedServer
from bt_actions.simulation import journal as j
from tests.simulation.conftest import RosBench, RosClient

ID = UUID(uuid=list(range(16)))


@pytest.fixture
def client(ros_bench: RosBench, space: str) -> RosClient:
    name = f"{space}/fibonacci"
    client = ros_bench.client(Fibonacci, name)
    ros_bench.serve(
        ScriptedServer(
            ros_bench.node, Fibonacci, name, Script(duration=30.0), journal=ros_bench.path
        )
    )
    client.until_ready()
    return client


def cancel(
    ros_bench: RosBench, client: RosClient, request: CancelGoal.Request
) -> CancelGoal.Response:
    name = client.rclpy_client._action_name
    asker = ros_bench.client_node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
    ros_bench.until(asker.service_is_ready)
    answer = asker.call_async(request)
    ros_bench.until(answer.done)
    ros_bench.client_node.destroy_client(asker)
    return answer.result()


def test_the_same_id_twice_is_one_goal(ros_bench: RosBench, client: RosClient) -> None:
    rclpy_client = client.rclpy_client
    first = rclpy_client.send_goal_async(Fibonacci.Goal(), goal_uuid=ID)
    ros_bench.until(first.done)
    again = rclpy_client.send_goal_async(Fibonacci.Goal(), goal_uuid=ID)
    ros_bench.until(again.done)
    ros_bench.until(ros_bench.happened("rejected"))
    assert first.result().accepted
    assert not again.result().accepted
    assert ros_bench.events() == ["received", "accepted", "received", "rejected"]
    (refused,) = [each for each in ros_bench.entries() if each.event is j.Event.REJECTED]
    assert "already in use" in refused.reason
    assert j.executions(ros_bench.entries()) == {bytes(ID.uuid).hex(): 1}


def test_a_cancel_of_an_unknown_goal_is_answered_as_such(
    ros_bench: RosBench, client: RosClient
) -> None:
    request = CancelGoal.Request()
    request.goal_info.goal_id = ID
    assert (
        cancel(ros_bench, client, request).return_code == CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
    )
    assert ros_bench.events() == ["cancel_requested"]


def test_a_cancel_of_all_goals_cancels_all(ros_bench: RosBench, client: RosClient) -> None:
    goals = [client.send().until_accepted() for _ in range(3)]
    assert len(cancel(ros_bench, client, CancelGoal.Request()).goals_canceling) == 3
    assert [goal.until_ended().status for goal in goals] == [GoalStatus.STATUS_CANCELED] * 3


def test_a_cancel_of_an_ended_goal_is_answered_and_changes_nothing(
    ros_bench: RosBench, client: RosClient
) -> None:
    goal = client.send().until_accepted()
    for _ in range(2):
        goal.cancel()
    assert goal.until_ended().status == GoalStatus.STATUS_CANCELED
    ros_bench.until(lambda: len(goal.cancels) == 2)
    assert ros_bench.events().count("canceled") == 1


def test_a_result_of_an_unknown_goal_is_answered_with_unknown(
    ros_bench: RosBench, client: RosClient
) -> None:
    goal = client.send().until_accepted()
    goal.goal_id = bytes(ID.uuid).hex()
    goal.ask_for_result()
    assert goal.until_ended().status == GoalStatus.STATUS_UNKNOWN


def test_a_client_that_goes_away_leaves_its_goal_running(
    ros_bench: RosBench, client: RosClient
) -> None:
    name = client.rclpy_client._action_name
    leaving = RosClient(ros_bench, Fibonacci, name)
    leaving.until_ready()
    leaving.send()
    ros_bench.until(ros_bench.happened("received"))
    leaving.rclpy_client.destroy()
    ros_bench.until(ros_bench.happened("accepted"))
    assert len(cancel(ros_bench, client, CancelGoal.Request()).goals_canceling) == 1
    ros_bench.until(ros_bench.happened("canceled"))


def test_many_cancels_and_results_at_once(ros_bench: RosBench, client: RosClient) -> None:
    goals: list[Any] = [client.send().until_accepted() for _ in range(4)]
    for goal in goals:
        goal.cancel()
        goal.ask_for_result()
        goal.cancel()
    assert {goal.until_ended().status for goal in goals} == {GoalStatus.STATUS_CANCELED}
