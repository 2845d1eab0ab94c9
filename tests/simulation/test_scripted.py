"""Any action type, as a script says; and scripts that are wrong end the goal, never the server."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from test_msgs.action import Fibonacci

from bt_actions.simulation import Script, ScriptedServer
from bt_actions.simulation import journal as j
from tests.simulation.conftest import Bench, Client


@pytest.fixture
def stands_on() -> str:
    """What a server decides is the same everywhere."""
    return "virtual"


def wrong(*_: object) -> Any:
    raise RuntimeError("a bug in the script")


@pytest.fixture
def serve(bench: Bench, space: str) -> Any:
    def serve(script: Script | None = None, **settings: Any) -> Client:
        name = f"{space}/fibonacci"
        client = bench.client(Fibonacci, name)
        bench.serve(
            ScriptedServer(bench.node, Fibonacci, name, script, journal=bench.path, **settings)
        )
        return client.until_ready()

    return serve


def test_without_a_script_it_succeeds_with_empty_messages(serve: Any) -> None:
    goal = serve().send(order=5).until_ended()
    assert goal.status == GoalStatus.STATUS_SUCCEEDED
    assert list(goal.result.sequence) == []
    assert len(goal.all_feedback(10)) == 10


def test_goals_run_beside_each_other_unless_the_server_preempts(serve: Any, bench: Bench) -> None:
    client = serve(Script(duration=0.2))
    goals = [client.send() for _ in range(3)]
    assert [goal.until_ended().status for goal in goals] == [GoalStatus.STATUS_SUCCEEDED] * 3
    assert j.max_live(bench.entries()) == 3


def test_with_preempts_a_newer_goal_aborts_the_older(serve: Any) -> None:
    client = serve(Script(duration=0.2, preempts=True))
    goals = [client.send() for _ in range(3)]
    assert [goal.until_ended().status for goal in goals] == [
        GoalStatus.STATUS_ABORTED, GoalStatus.STATUS_ABORTED, GoalStatus.STATUS_SUCCEEDED,
    ]  # fmt: skip


def test_it_refuses_and_aborts_with_the_reasons_of_the_script(serve: Any, bench: Bench) -> None:
    client = serve(
        Script(
            duration=0.1,
            refuse=lambda goal: "negative" if goal.order < 0 else None,
            aborts=lambda goal: "odd" if goal.order % 2 else None,
        )
    )
    refused, odd, even = (client.send(order=order) for order in (-2, 1, 2))
    assert odd.until_ended().status == GoalStatus.STATUS_ABORTED
    assert even.until_ended().status == GoalStatus.STATUS_SUCCEEDED
    assert refused.accepted is False
    reasons = {entry.reason for entry in bench.entries() if entry.reason}
    assert reasons == {"negative", "odd"}


@pytest.mark.parametrize(
    ("script", "says"),
    [
        (Script(duration=wrong), "could not begin"),
        (Script(duration=float("nan")), "could not begin"),
        (Script(duration=-1.0), "could not begin"),
        (Script(duration=0.1, feedback=wrong), "no feedback"),
        (Script(duration=0.1, feedback=lambda goal, done: "text"), "no feedback"),
        (Script(duration=0.1, result=wrong), "no result"),
        (Script(duration=0.1, result=lambda goal: None), "None is no Fibonacci.Result"),
        (Script(duration=0.1, aborts=wrong), "no result"),
    ],
)
def test_a_wrong_script_aborts_the_goal(
    serve: Any, bench: Bench, script: Script, says: str
) -> None:
    goal = serve(script).send().until_ended()
    assert goal.status == GoalStatus.STATUS_ABORTED
    reason = bench.entries()[-1].reason
    assert says in reason
    name = bench.entries()[-1].server
    told = ("warning", f"{name}: goal {goal.goal_id[:8]} aborted: {reason}")
    assert bench.node.log.lines == [told], "a test that watches no journal is told"


def test_a_result_of_the_wrong_type_does_not_end_the_server(serve: Any, bench: Bench) -> None:
    client = serve(Script(duration=0.0, result=lambda goal: "text" if goal.order == 1 else None))
    client.send(order=1).until_accepted()
    bench.until(bench.happened("aborted"))
    assert client.send().until_ended().status == GoalStatus.STATUS_ABORTED
    assert bench.events().count("received") == 2
