"""Every fault, seen by a client: on rclpy and on the virtual network."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from test_msgs.action import Fibonacci

from bt_actions.simulation import Script, ScriptedServer
from bt_actions.simulation import journal as j
from tests.simulation.conftest import Bench, Client

SUCCEEDED = GoalStatus.STATUS_SUCCEEDED
CANCELED = GoalStatus.STATUS_CANCELED
ABORTED = GoalStatus.STATUS_ABORTED

SCRIPT = Script(
    duration=0.2,
    feedback=lambda goal, done: Fibonacci.Feedback(sequence=[round(100 * done)]),
    result=lambda goal: Fibonacci.Result(sequence=[goal.order]),
)


@pytest.fixture
def serve(bench: Bench, space: str) -> Any:
    """Open a server with faults, and a client to it."""

    def serve(*faults: str, script: Script = SCRIPT, **settings: Any) -> Client:
        name = f"{space}/fibonacci"
        given = {"step_period": 0.02, "journal": bench.path} | settings
        written = [f"fibonacci:{fault}" for fault in faults]
        client = bench.client(Fibonacci, name)
        bench.serve(ScriptedServer(bench.node, Fibonacci, name, script, faults=written, **given))
        return client.until_ready()

    return serve


def received(bench: Bench) -> list[j.JournalLine]:
    return [entry for entry in bench.entries() if entry.event is j.Event.RECEIVED]


def test_reject(serve: Any, bench: Bench) -> None:
    client = serve("1:reject")
    first, second = client.send(), client.send()
    bench.until(lambda: first.accepted is False)
    assert second.until_ended().status == SUCCEEDED
    [refused] = [entry for entry in bench.entries() if entry.event is j.Event.REJECTED]
    assert refused.reason == "fault: reject"


def test_delay_accept_holds_up_that_goal_alone(serve: Any, bench: Bench) -> None:
    client = serve("1:delay_accept=0.6")
    began = bench.now()
    first, second = client.send(), client.send()
    assert second.until_ended().status == SUCCEEDED
    assert first.accepted is None
    first.until_accepted()
    assert bench.now() - began >= 0.6
    assert first.until_ended().status == SUCCEEDED


def test_drop_goal_is_never_answered_nor_executed(serve: Any, bench: Bench) -> None:
    client = serve("1:drop_goal")
    lost, next_one = client.send(), client.send()
    assert next_one.until_ended().status == SUCCEEDED
    assert lost.accepted is None
    assert j.ends(bench.entries())[next(iter(j.ends(bench.entries())))] is None
    assert sum(j.executions(bench.entries()).values()) == 1


def test_drop_accept_executes_what_it_never_answered(serve: Any, bench: Bench) -> None:
    client = serve("1:drop_accept")
    lost = client.send()
    bench.until(bench.happened("succeeded"))
    bench.go_on_for(0.1)
    assert lost.accepted is None
    assert bench.events() == ["received", "accepted", "succeeded"]


def test_abort_half_way(serve: Any, bench: Bench) -> None:
    goal = serve("1:abort").send().until_ended()
    assert goal.status == ABORTED
    assert goal.feedback[-1].sequence[0] == 40
    assert bench.entries()[-1].reason == "fault: abort"


def test_abort_so_long_after_acceptance(serve: Any, bench: Bench) -> None:
    began = bench.now()
    goal = serve("1:abort=0.1", script=Script(duration=30.0)).send().until_ended()
    assert goal.status == ABORTED
    assert bench.now() - began < 10.0, "half of the way takes 15 s"


def test_a_goal_that_is_done_at_once_still_meets_its_fault(serve: Any) -> None:
    assert serve("1:abort", script=Script(duration=0.0)).send().until_ended().status == ABORTED


def test_slow(serve: Any, bench: Bench) -> None:
    client = serve("1:slow=4")
    slow, normal = client.send(), client.send()
    assert normal.until_ended().status == SUCCEEDED
    assert slow.status is None
    assert slow.until_ended().status == SUCCEEDED
    steps = [entry.goal for entry in bench.entries() if entry.event is j.Event.STEP]
    assert steps.count(slow.goal_id) == 40
    assert len(slow.feedback) > 4


def test_stall_executes_until_it_is_canceled(serve: Any, bench: Bench) -> None:
    goal = serve("1:stall").send().until_moving()
    bench.until(lambda: len(goal.feedback) == 4)
    bench.go_on_for(0.3)
    assert len(goal.feedback) == 4
    assert goal.status is None
    goal.cancel()
    assert goal.until_ended().status == CANCELED


def test_no_feedback(serve: Any) -> None:
    goal = serve("1:no_feedback").send().until_ended()
    assert goal.status == SUCCEEDED
    assert goal.feedback == []


def test_flood(serve: Any, bench: Bench) -> None:
    client = serve("1:flood=1000", script=Script(duration=30.0))
    goal = client.send().until_moving()
    bench.until(lambda: len(goal.feedback) > 200, 2.0)
    goal.cancel()
    assert goal.until_ended().status == CANCELED


def test_reject_cancel(serve: Any, bench: Bench) -> None:
    goal = serve("1:reject_cancel").send().until_moving()
    goal.cancel()
    assert goal.until_ended().status == SUCCEEDED
    assert goal.cancels == [1]
    assert bench.events() == [
        "received", "accepted", "cancel_requested", "cancel_rejected", "succeeded",
    ]  # fmt: skip


def test_ignore_cancel(serve: Any, bench: Bench) -> None:
    goal = serve("1:ignore_cancel").send().until_moving()
    goal.cancel()
    bench.until(lambda: goal.cancels == [0])
    assert goal.status is None
    assert goal.until_ended().status == SUCCEEDED
    assert "cancel_accepted" in bench.events()


def test_drop_cancel(serve: Any, bench: Bench) -> None:
    goal = serve("1:drop_cancel").send().until_moving()
    goal.cancel()
    assert goal.until_ended().status == SUCCEEDED
    bench.go_on_for(0.1)
    assert goal.cancels == []
    assert bench.events() == ["received", "accepted", "cancel_requested", "succeeded"]


def test_delay_cancel(serve: Any, bench: Bench) -> None:
    goal = serve("1:delay_cancel=0.5").send().until_moving()
    goal.cancel()
    bench.until(lambda: goal.cancels == [0])
    goal.cancel()
    assert goal.until_ended().status == CANCELED
    asked, ended = (
        next(each.t for each in bench.entries() if each.event is event)
        for event in (j.Event.CANCEL_REQUESTED, j.Event.CANCELED)
    )
    assert ended - asked >= 0.5
    assert bench.events().count("canceled") == 1


def test_succeed_on_cancel(serve: Any, bench: Bench) -> None:
    goal = serve("1:succeed_on_cancel", script=Script(duration=30.0)).send().until_moving()
    goal.cancel()
    assert goal.until_ended().status == SUCCEEDED
    bench.until(lambda: goal.cancels == [0])


def test_abort_on_cancel(serve: Any, bench: Bench) -> None:
    goal = serve("1:abort_on_cancel", script=Script(duration=30.0)).send().until_moving()
    goal.cancel()
    assert goal.until_ended().status == ABORTED
    bench.until(lambda: goal.cancels == [0])


def test_delay_result(serve: Any, bench: Bench) -> None:
    goal = serve("1:delay_result=0.5").send(order=3)
    bench.until(bench.happened("succeeded"))
    assert goal.status is None
    assert goal.until_ended().status == SUCCEEDED
    assert list(goal.result.sequence) == [3]
    assert bench.now() - bench.entries()[-1].t >= 0.5


def test_a_result_that_is_later_than_its_server_remembers_is_unknown(serve: Any) -> None:
    goal = serve("1:delay_result=1", result_timeout=0.2).send().until_ended()
    assert goal.status == GoalStatus.STATUS_UNKNOWN


def test_drop_result(serve: Any, bench: Bench) -> None:
    goal = serve("1:drop_result").send()
    bench.until(bench.happened("succeeded"))
    bench.go_on_for(0.2)
    assert goal.status is None
    goal.ask_for_result()
    bench.go_on_for(0.2)
    assert goal.status is None


def test_drop_result_once_answers_who_asks_again(serve: Any, bench: Bench) -> None:
    goal = serve("1:drop_result=1").send()
    bench.until(bench.happened("succeeded"))
    assert goal.status is None
    goal.ask_for_result()
    assert goal.until_ended().status == SUCCEEDED


@pytest.mark.parametrize(
    ("fault", "events"),
    [
        ("die=accept", ["received"]),
        ("die", ["received", "accepted", "died"]),
        ("die=cancel", ["received", "accepted", "cancel_requested", "died"]),
    ],
)
def test_die_destroys_the_server(serve: Any, bench: Bench, fault: str, events: list[str]) -> None:
    client = serve(f"1:{fault}", script=Script(duration=0.6))
    goal = client.send()
    if fault == "die=cancel":
        goal.until_moving().cancel()
    bench.until(lambda: not client.is_ready())
    assert goal.status is None
    assert bench.events() == events
    assert bench.entries()[-1].event is j.Event.CLOSED


def test_a_server_that_died_can_be_opened_again(serve: Any, bench: Bench) -> None:
    client = serve("1:die")
    client.send()
    bench.until(lambda: not client.is_ready())
    [server] = bench.serving
    assert not server.is_open
    server.open()
    bench.until(client.is_ready)
    assert client.send().until_ended().status == SUCCEEDED


def test_restart_forgets_its_goals(serve: Any, bench: Bench) -> None:
    client = serve("1:restart=0.3")
    goal = client.send().until_accepted()
    bench.until(bench.happened("died"))
    opened = lambda: [each.event for each in bench.entries()].count(j.Event.OPENED)  # noqa: E731
    bench.until(lambda: opened() == 2)
    bench.until(client.is_ready)
    goal.cancel()
    bench.until(lambda: goal.cancels == [2], what="unknown goal")
    assert client.send().until_ended().status == SUCCEEDED
