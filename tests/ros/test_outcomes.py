"""Outcomes that need real servers: leases, kills, servers of another kind, two nodes, discovery.

All others are brought about in virtual time (tests/traffic/test_outcomes.py).
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from typing import Any

import pytest
from py_trees.common import Status
from rclpy.node import Node
from robot_control_interfaces.action import MoveRobot as MoveRobotAction

from bt_actions import (
    ActionBehaviour,
    End,
    Gripper,
    MoveRobot,
    Outcome,
    Retry,
    Timeouts,
    TreeRunner,
)
from bt_actions.events import GoalChanged
from bt_actions.goals.policy import Busy
from bt_actions.goals.terms import Event
from bt_actions.ros.host import host as process
from bt_actions.ros.node_participant import traffic_of
from tests.support.processes import HostFactory
from tests.support.trees import in_turn
from tests.support.waiting import until

Run = Callable[..., Any]


def stood(leaf: ActionBehaviour) -> tuple[Outcome | None, End | None]:
    return leaf.outcome, leaf.end


def executing(leaf: ActionBehaviour) -> bool:
    return leaf.progress().state == "EXECUTING"


class TestSucceeded:
    def test_succeeded(self, serve: Any, name: str, run: Run, executor: str) -> None:
        journal = serve()
        leaf = run(MoveRobot("m", 0.2, action_name=name), executor=executor)
        assert leaf.status is Status.SUCCESS
        assert stood(leaf) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert leaf.result.final_pose == 0.2
        [record] = leaf.history
        assert (record.attempt, record.outcome, record.late) == (1, Outcome.SUCCEEDED, False)
        assert record.duration >= 0.2
        assert journal.events() == ["received", "accepted", "succeeded"]
        assert record.goal_id == journal.entries()[-1].goal


class TestNoServer:
    def test_another_type_under_the_name_and_names_like_it_are_told(
        self, serve: Any, name: str, run: Run
    ) -> None:
        serve()
        limits = Timeouts(server=2.0)
        other = run(Gripper("g", 1.0, action_name=name, timeout=limits))
        kind = "robot_control_interfaces/action/MoveRobot"
        assert other.reason.endswith(f"; there is one of another type or version, {kind}")
        near = run(MoveRobot("m", 1.0, action_name=f"{name}e", timeout=limits))
        assert near.reason.endswith(f"; did you mean {name!r}?")
        elsewhere = run(MoveRobot("m", 1.0, action_name=f"/elsewhere{name}", timeout=limits))
        assert elsewhere.reason.endswith(f"; there is {name} of that type")
        far = run(MoveRobot("m", 1.0, action_name="/elsewhere/of/robot_7", timeout=limits))
        assert "; of its type there is " in far.reason
        assert name in far.reason, "the full name"

    @pytest.mark.parametrize(
        ("rules", "told"),
        [
            (["move:=/r1/move"], ["a rule remaps /move to /r1/move, and has no effect"]),
            (["move:=/r1/move", "move/_action/send_goal:=/r1/move/_action/send_goal"], []),
            (["moves:=/r1/move"], []),
        ],
    )
    def test_a_rule_that_remaps_an_action_is_told_to_have_no_effect_once(
        self, context: Any, monkeypatch: pytest.MonkeyPatch, rules: list[str], told: list[str]
    ) -> None:
        said = list[str]()
        monkeypatch.setattr(process.log, "warning", said.append)
        words = ["--ros-args", *(word for rule in rules for word in ("-r", rule))]
        node = Node("remapped", context=context, cli_args=words)
        for _ in range(2):
            leaf = MoveRobot("m", 1.0, action_name="move")
            leaf.setup(node=node)
            leaf.shutdown()
        node.destroy_node()
        assert [text.partition(":")[0] for text in said] == told

    def test_a_server_that_accepts_twice_is_one_server(
        self, serve: Any, new_host: HostFactory, name: str, node: Any
    ) -> None:
        serve()
        leaf = MoveRobot("m", 0.1, action_name=name)
        with TreeRunner(leaf, node=node) as runner:
            runner.start()
            handle = until(
                lambda: leaf._endpoint and next(iter(leaf._endpoint.goals.values()), None)
            )
            assert runner.wait(9.0) is Status.SUCCESS
            line, goal_id = leaf._endpoint, handle.goal.id
            line.goal_answered(goal_id, (True, True))
            assert not line.goals
            line.goal_answered(goal_id, (True,))
            line.goal_answered(uuid.uuid4().bytes, (True,))
            assert not line.goals
            until(lambda: goal_id not in line.cancels._asked, what="asked, and answered")
            new_host().open(name)
            until_two_are_seen(node, name)
            with process.lock:
                line.goal_answered(goal_id, (True, True))
                assert goal_id in line.goals, (line._past._ended, line.watch.gids)
                duplicate = line.goals[goal_id]
                line.tell(handle, Event.INTERRUPTED)
                assert line.goals == {goal_id: duplicate}, "the goal that has ended is not its twin"
            until(lambda: not line.goals)

    @pytest.mark.parametrize("is_news", [True, False])
    def test_what_had_come_when_the_last_goal_ended_is_heard(
        self, name: str, node: Any, monkeypatch: pytest.MonkeyPatch, is_news: bool
    ) -> None:
        """The leaf has gone; behind the result lies a second server's acceptance, or feedback."""
        traffic = traffic_of(node)
        line = traffic.endpoint(MoveRobotAction, name)
        shown = [frozenset({b"one", b"other"})]
        monkeypatch.setattr(line.transport, "servers", lambda: shown[-1])
        monkeypatch.setattr(line.transport, "ready", lambda: True)
        gone = MoveRobot("gone", 0.1, action_name=name)
        with process.lock:
            line.see()
            handle = traffic.begin(line, gone, Timeouts(), frozenset({"base"}), Busy.WAIT)
            line.tell(handle, Event.SERVER_READY, message=MoveRobotAction.Goal())
            line.tell(handle, Event.ACCEPTED)
            traffic.leave(line)
            asked, goal_id = time.monotonic(), handle.goal.id
            ended = (asked, ((5, MoveRobotAction.Result()), (0, None)))
            line.transport._inbox.append(("result", goal_id, ended))
            if is_news:
                line.transport._inbox.append(("goal", goal_id, (asked, (True, True))))
            else:
                line.transport._inbox.append(("feedback", b"somebody's", None))
            line.transport._deliver()
            assert handle.goal.end is End.CANCELED
            assert line.transport.closed is not is_news
            if not is_news:
                return
            duplicate = line.goals[goal_id]
            shown.append(frozenset())
        until(lambda: duplicate.goal.end is End.SERVER_GONE)
        with process.lock:
            line.tell(duplicate, Event.PROCESS_EXITING)
            assert line.transport.closed, "when there is nothing more to hear"

    def test_two_servers_are_ambiguous_and_neither_gets_the_goal(
        self,
        serve: Any,
        new_host: HostFactory,
        name: str,
        node: Any,
        run: Run,
        executor: str,
    ) -> None:
        here = serve()
        other = new_host()
        there = other.open(name)
        until_two_are_seen(node, name)
        leaf = run(MoveRobot("m", 0.1, action_name=name), executor=executor)
        assert stood(leaf) == (Outcome.SERVER_AMBIGUOUS, End.NEVER_STARTED)
        assert here.events() == []
        assert there.events() == []
        other.close_server(name)
        leaf = run(MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(server=8.0)))
        assert leaf.outcome is Outcome.SUCCEEDED
        assert here.events() == ["received", "accepted", "succeeded"]


def until_two_are_seen(node: Any, name: str) -> None:
    """Wait until discovery has shown both servers to the node of the tests."""
    topic = f"{name}/_action/status"
    until(lambda: len(node.get_publishers_info_by_topic(topic)) == 2, what=f"two servers {name}")


class TestBusy:
    def test_who_waits_for_the_turn_of_a_paused_tree_is_told(
        self, serve: Any, name: str, node: Any
    ) -> None:
        serve()
        first = MoveRobot("first", 0.5, action_name=name)
        second = MoveRobot("second", 0.1, action_name=name)
        third = MoveRobot("third", 0.1, action_name=name, timeout=Timeouts(queue=1.5))
        runners = [TreeRunner(each, node=node) for each in (first, second, third)]
        try:
            for leaf, runner, is_now in zip(
                (first, second), runners[:2], ("EXECUTING", "QUEUED"), strict=True
            ):
                runner.start()
                until(lambda: leaf.progress().state == is_now)  # noqa: B023 - called at once
            runners[1].pause()
            assert runners[2].run(9.0) is Status.FAILURE
        finally:
            for runner in runners:
                runner.shutdown()
        assert third.outcome is Outcome.SERVER_BUSY
        assert third.reason.endswith(": it is the turn of second, whose tree is paused")

    @pytest.mark.parametrize(
        ("faults", "accept", "outcome"),
        [
            (["1:delay_accept=2"], 9.0, Outcome.CANCELED),
            (["1:delay_accept=2", "1:reject"], 9.0, Outcome.REJECTED),
            (["1:drop_goal"], 2.0, Outcome.CANCELED),
        ],
        ids=["accepted", "refused", "past accept"],
    )
    def test_what_replaces_a_goal_of_another_node_is_sent_when_that_is_answered(
        self,
        serve: Any,
        name: str,
        context: Any,
        faults: list[str],
        accept: float,
        outcome: Outcome,
    ) -> None:
        """Requests of two nodes arrive in any order, and the last one wins. No tick is needed."""
        journal = serve(*faults, preempts=True)
        limits = Timeouts(accept=accept, cancel=0.5)
        older = MoveRobot("older", 9.0, action_name=name, timeout=limits)
        newer = MoveRobot("newer", 0.1, action_name=name, busy="replace", timeout=9.0)
        nodes = [Node(f"of_{leaf.name}", context=context) for leaf in (older, newer)]
        runners = [TreeRunner(older, node=nodes[0]), TreeRunner(newer, node=nodes[1], heartbeat=60)]
        try:
            runners[0].start()
            journal.wait_for("received")
            runners[1].start()
            statuses = [runner.wait(15.0) for runner in runners]
        finally:
            for runner, node in zip(runners, nodes, strict=True):
                runner.shutdown()
                node.destroy_node()
        assert statuses == [Status.FAILURE, Status.SUCCESS]
        assert older.outcome is outcome
        first, second = (each.t for each in journal.entries() if each.event == "received")
        assert second - first > 1.9, "before, the newer might have been first"


class TestFeedback:
    def test_all_feedback_is_told_before_the_outcome_however_slow_the_callback_is(
        self, serve: Any, name: str, run: Run
    ) -> None:
        serve()
        told, latest = list[Any](), list[Any]()

        def outlasts_the_goal(message: Any) -> None:
            told.append(message)
            until(lambda: leaf.end is End.SUCCEEDED)
            assert leaf.outcome is None
            latest.append(leaf.progress().feedback)

        leaf = MoveRobot("m", 0.5, action_name=name, on_feedback=outlasts_the_goal)
        assert run(leaf).outcome is Outcome.SUCCEEDED
        assert len(told) > 1
        assert told[-1] is latest[0], "the last one that came"


class TestDeadlines:
    def test_a_request_that_was_denied_for_long_is_accounted_for(
        self, serve: Any, name: str, node: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("bt_actions.goals.asking.DENIED_FOR_GOOD", 2.0)  # not 30 s
        serve("1:drop_goal")
        retry = Retry(2, outcomes={Outcome.ACCEPT_TIMEOUT})
        leaf = MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(accept=0.5), retry=retry)
        with TreeRunner(leaf, node=node) as runner:
            assert runner.run(timeout=20.0) is Status.SUCCESS
            assert runner.unaccounted == []
        assert [record.end for record in leaf.history] == [End.NEVER_STARTED, End.SUCCEEDED]

    def test_who_ends_the_program_at_news_in_shutdown_is_heard(self, serve: Any, name: str) -> None:
        serve("1:delay_cancel=1.5", "1:drop_result=1000")
        leaf = MoveRobot("m", 9.0, action_name=name, timeout=Timeouts(result=0.5, cancel=0.3))
        runner = TreeRunner(leaf)

        def leave(event: object) -> None:
            if isinstance(event, GoalChanged) and event.end is End.CANCELED:
                raise SystemExit(9)

        runner.observe(leave)
        runner.run(timeout=20.0)
        until(lambda: leaf.history[0].goal.lost_result.status)
        with pytest.raises(SystemExit):
            runner.shutdown()
        runner.shutdown()


class TestServersOfAnotherKind:
    @pytest.mark.parametrize("answer", [2, 0], ids=["executing", "unknown"])
    def test_a_goal_that_runs_by_its_status_is_not_forgotten_whatever_its_result_service_says(
        self, context: Any, name: str, node: Any, answer: int
    ) -> None:
        """get_result is answered at once, though the goal runs; another leaf wants the server."""
        from tests.support.hand_written import CANCELED, HandWrittenServer

        server = HandWrittenServer(context, name, answer)
        timeouts = Timeouts(result=4.0)
        first = MoveRobot("first", 1.0, action_name=name, timeout=timeouts)
        second = MoveRobot("second", 2.0, action_name=name, timeout=timeouts)
        try:
            with TreeRunner(in_turn(first, second), node=node) as runner:
                runner.run(timeout=30.0)
                assert runner.unaccounted == []
        finally:
            server.close()
        assert [stood(leaf) for leaf in (first, second)] == [
            (Outcome.RESULT_TIMEOUT, End.CANCELED)
        ] * 2
        assert list(server.statuses.values()) == [CANCELED] * 2
        assert server.most_live == 1


class TestServerLost:
    def test_a_killed_server_is_lost_within_its_lease(
        self, new_host: HostFactory, name: str, node: Any
    ) -> None:
        victim = new_host()
        victim.open(name)
        leaf = MoveRobot("m", 9.0, action_name=name)
        with TreeRunner(leaf, node=node) as runner:
            runner.start()
            until(lambda: executing(leaf))
            victim.kill()
            assert runner.wait(15.0) is Status.FAILURE  # the lease of stock Fast DDS is 20 s
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)

    @pytest.mark.parametrize("short_lease", [True, False], ids=["short lease", "ghost for 20 s"])
    def test_a_server_killed_and_started_again_is_lost_and_then_used(
        self, new_host: HostFactory, name: str, node: Any, short_lease: bool
    ) -> None:
        victim = new_host(short_lease=short_lease)
        victim.open(name)
        spare = new_host(short_lease=short_lease)
        lost = MoveRobot("lost", 8.0, action_name=name)
        next_one = MoveRobot("next", 0.1, action_name=name, timeout=Timeouts(server=10.0))
        tree = in_turn(lost, next_one)
        with TreeRunner(tree, node=node) as runner:
            runner.start()
            until(lambda: executing(lost))
            victim.kill()
            journal = spare.open(name)
            until(lambda: lost.outcome, 15.0)
            assert runner.wait(12.0) is Status.SUCCESS
        assert stood(lost) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert next_one.outcome is Outcome.SUCCEEDED
        started_again = [e for e in journal.entries() if e.pid == spare.pid and e.goal]
        assert [e.event for e in started_again if e.event != "step"] == [
            "received",
            "accepted",
            "succeeded",
        ]


class TestInvalidGoal:
    def test_what_an_error_says_is_asked_without_the_lock(
        self, serve: Any, name: str, run: Run
    ) -> None:
        """It may ask a leaf on another thread for something."""
        under_the_lock = list[bool]()

        class Mine(Exception):
            def __str__(self) -> str:
                under_the_lock.append(process.lock._is_owned())  # type: ignore[attr-defined]
                return "no such place"

        def goal() -> None:
            raise Mine

        serve()
        leaf = run(ActionBehaviour("m", MoveRobotAction, name, goal))
        assert leaf.reason == "Mine: no such place"
        assert set(under_the_lock) == {False}
