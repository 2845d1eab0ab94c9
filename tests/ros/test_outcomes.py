"""Outcomes that need real servers: servers of another kind, two nodes, names, threads.

All others are brought about in virtual time (tests/traffic/test_outcomes.py), or by kills and
signals (tests/scenarios).
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from py_trees.common import Status
from rclpy.node import Node

from bt_actions import (
    ActionBehaviour,
    End,
    Gripper,
    MoveRobot,
    Outcome,
    Timeouts,
    TreeRunner,
)
from bt_actions.ros.host import host as process
from tests.support.trees import in_turn
from tests.support.waiting import until

Run = Callable[..., Any]


def stood(leaf: ActionBehaviour) -> tuple[Outcome | None, End | None]:
    return leaf.outcome, leaf.end


def executing(leaf: ActionBehaviour) -> bool:
    return leaf.progress().state == "EXECUTING"


class TestSucceeded:
    def test_succeeded(self, serve: Any, name: str, run: Run) -> None:
        journal = serve()
        leaf = run(MoveRobot("m", 0.2, action_name=name))
        assert leaf.status is Status.SUCCESS
        assert stood(leaf) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert leaf.result.final_pose == 0.2
        [record] = leaf.history
        assert (record.attempt, record.outcome, record.late) == (1, Outcome.SUCCEEDED, False)
        assert record.duration >= 0.2
        assert journal.events() == ["received", "accepted", "succeeded"]
        assert record.goal_id == journal.entries()[-1].goal

    @pytest.mark.parametrize("kind", ["callable", "mapping"])
    def test_what_gives_a_goal_is_called_without_the_lock(
        self, serve: Any, name: str, node: Node, kind: str
    ) -> None:
        def takes_the_lock() -> bool:
            with process.lock:
                return True

        def goal() -> dict[str, float]:
            with ThreadPoolExecutor(1) as other:
                assert other.submit(takes_the_lock).result(5.0)
            return {"distance": 0.1}

        class Lazy(UserDict[str, float]):
            def __getitem__(self, key: str) -> float:
                return goal()[key]

        serve()
        leaf = MoveRobot("m", 0.1, action_name=name)
        leaf.setup(node=node)
        leaf.goal = goal if kind == "callable" else Lazy(distance=0.1)
        until(lambda: leaf.tick_once() or leaf.status is not Status.RUNNING)
        leaf.shutdown()
        assert leaf.outcome is Outcome.SUCCEEDED


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

    def test_what_replaces_a_goal_of_another_node_is_sent_when_that_is_answered(
        self, serve: Any, name: str, context: Any
    ) -> None:
        """Requests of two nodes arrive in any order, and the last one wins. No tick is needed."""
        journal = serve("1:delay_accept=2", preempts=True)
        limits = Timeouts(accept=9.0, cancel=0.5)
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
        assert older.outcome is Outcome.CANCELED
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


class TestServersOfAnotherKind:
    @pytest.mark.parametrize(
        "answer",
        [
            pytest.param(2, id="executing"),
            pytest.param(0, id="unknown", marks=pytest.mark.chaos),
        ],
    )
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
