"""Every row of the outcome table and every end, from real servers, read from the leaf.

The servers are in another process and do wrong what they are told to; their journal says what
became of a goal. What the report tells of is in tests/scenarios/test_answers.py: late, missing and
lost answers, cancels that are refused, two servers on one resource, `replace`.
"""

from __future__ import annotations

import itertools
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
    Var,
)
from bt_actions.behaviours.variables import read, write
from bt_actions.events import GoalChanged
from bt_actions.goals.policy import Busy
from bt_actions.goals.terms import Event
from bt_actions.ros.host import host as process
from bt_actions.ros.node_participant import traffic_of
from tests.support.processes import Host, HostFactory
from tests.support.trees import Gate, in_sequence, in_turn, together
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

    def test_a_result_that_is_not_expected_is_unexpected(
        self, serve: Any, name: str, run: Run
    ) -> None:
        serve()
        leaf = run(MoveRobot("m", 0.1, action_name=name, expect="result.final_pose > 1"))
        assert leaf.status is Status.FAILURE
        assert stood(leaf) == (Outcome.UNEXPECTED_RESULT, End.SUCCEEDED)
        assert leaf.result.final_pose == 0.1

    def test_expect_may_be_a_callable_and_may_hold(self, serve: Any, name: str, run: Run) -> None:
        serve()
        leaf = run(MoveRobot("m", 0.1, action_name=name, expect=lambda r: r.final_pose == 0.1))
        assert leaf.outcome is Outcome.SUCCEEDED

    def test_a_late_result_is_held_against_expect_as_well(
        self, serve: Any, name: str, run: Run
    ) -> None:
        serve("1:ignore_cancel")
        leaf = run(MoveRobot("m", 0.8, action_name=name, timeout=0.3, expect="result.status == 9"))
        assert leaf.outcome is Outcome.UNEXPECTED_RESULT

    def test_a_lost_result_is_asked_for_again(self, serve: Any, name: str, run: Run) -> None:
        """The status topic tells that the goal has ended."""
        journal = serve("1:drop_result=2")
        leaf = run(MoveRobot("m", 0.1, action_name=name))
        assert stood(leaf) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert leaf.result.final_pose == 0.1
        assert journal.ends() == ["succeeded"]

    def test_what_is_saved_is_on_the_blackboard(self, serve: Any, name: str, run: Run) -> None:
        serve()
        save = {"outcome_pose": "result.final_pose"}
        run(MoveRobot("m", 0.1, action_name=name, save=save))
        assert read("outcome_pose") == 0.1

    def test_nothing_is_saved_of_a_failure(self, serve: Any, name: str, run: Run) -> None:
        serve("1:abort")
        save = {"outcome_never": "result.final_pose"}
        run(MoveRobot("m", 0.1, action_name=name, save=save))
        with pytest.raises(KeyError):
            read("outcome_never")

    def test_variables_are_read_when_the_goal_is_sent(
        self, serve: Any, name: str, run: Run
    ) -> None:
        serve("1:abort")
        write("outcome_way", {"steps": [0.3, 0.1]})
        goals = iter([0.2])

        def first_fails(result: Any) -> bool:
            write("outcome_way", {"steps": [0.3, next(goals)]})
            return True

        leaf = run(
            MoveRobot(
                "m",
                Var("outcome_way.steps.1"),
                action_name=name,
                retry=Retry(2, when=first_fails),
            )
        )
        assert leaf.result.final_pose == 0.2

    @pytest.mark.parametrize(
        "goal",
        [
            {"distance": 0.1},
            MoveRobotAction.Goal(distance=0.1),
            lambda: {"distance": 0.1},
            lambda: MoveRobotAction.Goal(distance=0.1),
        ],
        ids=["mapping", "message", "callable of a mapping", "callable of a message"],
    )
    def test_a_goal_may_be_given_in_many_ways(
        self, serve: Any, name: str, run: Run, goal: Any
    ) -> None:
        serve()
        leaf = run(ActionBehaviour("m", MoveRobotAction, name, goal))
        assert leaf.result.final_pose == 0.1

    def test_feedback_is_given_to_the_tree_in_order(self, serve: Any, name: str, run: Run) -> None:
        serve()
        poses: list[float] = []
        run(
            MoveRobot(
                "m", 0.5, action_name=name, on_feedback=lambda f: poses.append(f.current_pose)
            )
        )
        assert poses
        assert poses == sorted(poses)


class TestFailedByTheServer:
    def test_rejected(self, serve: Any, name: str, run: Run, executor: str) -> None:
        journal = serve()
        leaf = run(MoveRobot("m", 101.0, action_name=name), executor=executor)
        assert leaf.status is Status.FAILURE
        assert stood(leaf) == (Outcome.REJECTED, End.NEVER_STARTED)
        assert journal.ends() == ["rejected"]

    def test_aborted_and_the_result_is_kept(
        self, host: Host, name: str, run: Run, executor: str
    ) -> None:
        namespace = name.rpartition("/")[0]
        host.robot(namespace, "1:abort")
        leaf = run(MoveRobot("m", 2.0, action_name=f"{namespace}/move_robot"), executor=executor)
        host.close_server(namespace)
        assert stood(leaf) == (Outcome.ABORTED, End.ABORTED)
        assert leaf.result.status == MoveRobotAction.Result.STATUS_FAULT
        assert leaf.result.message

    def test_canceled_by_another_client(self, serve: Any, host: Host, name: str, node: Any) -> None:
        journal = serve()
        leaf = MoveRobot("m", 5.0, action_name=name, retry=3)
        with TreeRunner(leaf, node=node) as runner:
            runner.start()
            until(lambda: executing(leaf))
            host.cancel_all(name)
            assert runner.wait(5.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.CANCELED_BY_OTHER, End.CANCELED)
        assert len(leaf.history) == 1
        assert journal.ends() == ["canceled"]


class TestNoServer:
    def test_no_server_is_unavailable(self, name: str, run: Run, executor: str) -> None:
        started = time.monotonic()
        leaf = run(
            MoveRobot("m", 1.0, action_name=name, timeout=Timeouts(server=0.4)), executor=executor
        )
        assert stood(leaf) == (Outcome.SERVER_UNAVAILABLE, End.NEVER_STARTED)
        assert time.monotonic() - started >= 0.4

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

    def test_a_server_that_comes_late_is_waited_for(self, serve: Any, name: str, node: Any) -> None:
        leaf = MoveRobot("m", 0.1, action_name=name)
        with TreeRunner(leaf, node=node) as runner:
            runner.start()
            until(lambda: leaf.progress().state == "WAITING_FOR_SERVER")
            serve()
            assert runner.wait(5.0) is Status.SUCCESS

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

    def test_a_second_server_after_sending_leaves_the_goal_alone(
        self, serve: Any, new_host: HostFactory, name: str, node: Any
    ) -> None:
        here = serve()
        other = new_host()
        first, second = (MoveRobot(n, 6.0, action_name=name) for n in ("first", "second"))
        tree = in_sequence(first, second)
        with TreeRunner(tree, node=node) as runner:
            runner.start()
            until(lambda: executing(first))
            there = other.open(name)
            until_two_are_seen(node, name)
            assert executing(first)
            assert runner.wait(20.0) is Status.FAILURE
        assert stood(first) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert second.outcome is Outcome.SERVER_AMBIGUOUS
        assert here.events() == ["received", "accepted", "succeeded"]
        assert there.events() == []


def until_two_are_seen(node: Any, name: str) -> None:
    """Wait until discovery has shown both servers to the node of the tests."""
    topic = f"{name}/_action/status"
    until(lambda: len(node.get_publishers_info_by_topic(topic)) == 2, what=f"two servers {name}")


def run_after(first: MoveRobot, second: MoveRobot, node: Any, executor: str = "multi") -> None:
    """Run both beside each other; the second begins when the server has the goal of the first."""
    starts = Gate()
    tree = together(first, in_sequence(starts, second))
    with TreeRunner(tree, node=node, executor=executor) as runner:
        runner.start()
        until(lambda: executing(first))
        starts.passed = True
        runner.wait(9.0)


class TestBusy:
    def test_fail_gives_up_at_once(self, serve: Any, name: str, node: Any) -> None:
        journal = serve()
        first = MoveRobot("first", 9.0, action_name=name)
        second = MoveRobot("second", 0.1, action_name=name, busy="fail")
        run_after(first, second, node)
        assert stood(second) == (Outcome.SERVER_BUSY, End.NEVER_STARTED)
        assert journal.count("received") == 1

    def test_wait_gives_up_after_its_deadline(
        self, serve: Any, name: str, node: Any, executor: str
    ) -> None:
        journal = serve()
        first = MoveRobot("first", 9.0, action_name=name)
        second = MoveRobot("second", 0.1, action_name=name, timeout=Timeouts(queue=0.3))
        run_after(first, second, node, executor)
        assert stood(second) == (Outcome.SERVER_BUSY, End.NEVER_STARTED)
        assert second.history[0].duration >= 0.3
        assert second.history[0].ended < first.history[0].ended
        assert journal.count("received") == 1

    def test_wait_goes_on_when_the_older_has_ended(self, serve: Any, name: str, run: Run) -> None:
        journal = serve()
        leaves = [MoveRobot(f"m{i}", 0.2, action_name=name) for i in range(3)]
        run(together(*leaves))
        assert [leaf.outcome for leaf in leaves] == [Outcome.SUCCEEDED] * 3
        assert journal.max_live == 1

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

    def test_share_sends_beside_the_others(self, serve: Any, name: str, run: Run) -> None:
        journal = serve()
        leaves = [MoveRobot(f"m{i}", 0.5, action_name=name, busy="share") for i in range(3)]
        run(together(*leaves))
        assert [leaf.outcome for leaf in leaves] == [Outcome.SUCCEEDED] * 3
        assert journal.max_live == 3

    def test_replace_cancels_the_older_at_once_where_another_server_has_it(
        self, serve: Any, name: str, node: Any
    ) -> None:
        """A server cannot preempt what it does not know of."""
        journals = [serve(name=f"{name}{letter}") for letter in "ab"]
        patient = Timeouts(cancel=60.0)
        older = MoveRobot("a", 50.0, action_name=f"{name}a", resources=["base"], timeout=patient)
        newer = MoveRobot("b", 50.0, action_name=f"{name}b", resources=["base"], busy="replace")
        starts = Gate()
        with TreeRunner(together(older, in_sequence(starts, newer)), node=node) as runner:
            runner.start()
            until(lambda: executing(older))
            starts.passed = True
            journals[0].wait_for("canceled")
            runner.wait(20.0)
        assert stood(older) == (Outcome.CANCELED, End.CANCELED)
        assert older.reason == f"replaced by a newer goal on {newer.server}"

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

    @pytest.mark.parametrize("written", ["relative", "absolute"])
    def test_a_resource_is_named_as_a_server_is(
        self, serve: Any, name: str, run: Run, written: str
    ) -> None:
        """A leaf that occupies another's server waits for it, however both are written."""
        journals = [serve(name=f"{name}{letter}") for letter in "ab"]
        arm = f"{name}a" if written == "absolute" else f"{name}a".lstrip("/")
        first = MoveRobot("first", 0.3, action_name=f"{name}a".lstrip("/"))
        second = MoveRobot("second", 0.3, action_name=f"{name}b", resources=[arm])
        run(together(first, second))
        assert [leaf.outcome for leaf in (first, second)] == [Outcome.SUCCEEDED] * 2
        ended = next(e.t for e in journals[0].entries() if e.event == "succeeded")
        began = next(e.t for e in journals[1].entries() if e.event == "received")
        assert began >= ended


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

    def test_the_latest_feedback_is_in_the_feedback_message_of_the_leaf(
        self, serve: Any, name: str, node: Any
    ) -> None:
        """So that any viewer of py_trees shows the progress, though nobody reads it here."""
        serve("1:stall=0.5")
        leaf = MoveRobot("m", 5.0, action_name=name)
        with TreeRunner(leaf, node=node) as runner:
            runner.start()
            until(lambda: leaf.feedback_message.startswith("executing: current_pose 0."))
            until(lambda: f"{leaf.progress().feedback.current_pose:g}" in leaf.feedback_message)

    @pytest.mark.parametrize("how", ["stop", "shutdown"])
    def test_a_leaf_that_its_own_callback_ends_is_over(
        self, serve: Any, name: str, node: Any, how: str
    ) -> None:
        journal = serve()

        def ends(message: Any) -> None:
            leaf.stop(Status.INVALID) if how == "stop" else leaf.shutdown()

        leaf = MoveRobot("m", 5.0, action_name=name, on_feedback=ends)
        with TreeRunner(leaf, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.CANCELED, End.CANCELED)
        assert journal.count("received") == 1

    @pytest.mark.parametrize("where", ["goal", "expect", "when"])
    def test_a_leaf_that_its_own_code_stops_is_over_and_sends_no_more(
        self, serve: Any, name: str, node: Any, where: str
    ) -> None:
        journal = serve(*(["1:abort"] if where == "when" else []))

        def stops(answer: Any) -> Callable[..., Any]:
            return lambda *_: (leaf.stop(Status.INVALID), answer)[1]

        settings: dict[str, Any] = {
            "goal": {"goal": stops({"distance": 0.3})},
            "expect": {"expect": stops(True)},
            "when": {"retry": Retry(3, when=stops(True))},
        }[where]
        settings.setdefault("goal", {"distance": 0.3})
        goal = settings.pop("goal")
        leaf = ActionBehaviour("m", "robot_control_interfaces/MoveRobot", name, goal, **settings)
        with TreeRunner(leaf, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.FAILURE
        expected = Outcome.ABORTED if where == "when" else Outcome.CANCELED
        assert (leaf.outcome, len(leaf.history)) == (expected, 1)
        assert journal.count("received") == (0 if where == "goal" else 1)


class TestDeadlines:
    def test_a_request_that_is_never_answered(
        self, serve: Any, name: str, node: Any, executor: str
    ) -> None:
        journal = serve("1:drop_goal")
        timeouts = Timeouts(accept=0.5, cancel=1.0)
        leaf = MoveRobot("m", 0.1, action_name=name, timeout=timeouts)
        ends = []
        with TreeRunner(leaf, node=node, executor=executor) as runner:
            runner.observe(lambda event: ends.append(getattr(event, "end", None)))
            runner.run(timeout=9.0)
            assert [report.goal_id for report in runner.unaccounted] == [leaf.history[0].goal_id]
        assert stood(leaf) == (Outcome.ACCEPT_TIMEOUT, End.UNKNOWN)
        assert End.NEVER_STARTED in ends, "the server denied it, so that the tree could go on"
        assert journal.count("accepted") == 0

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

    def test_a_server_that_decides_after_the_tree_has_gone_on_is_waited_for(
        self, serve: Any, name: str, run: Run
    ) -> None:
        """It denies the goal as long as it has not decided: that proves nothing."""
        journal = serve("1:delay_accept=2")
        leaf = run(MoveRobot("m", 5.0, action_name=name, timeout=Timeouts(accept=0.5, cancel=2.0)))
        assert stood(leaf) == (Outcome.ACCEPT_TIMEOUT, End.CANCELED)
        assert journal.ends() == ["canceled"]

    def test_an_acceptance_after_its_deadline_is_canceled_at_once(
        self, serve: Any, name: str, run: Run
    ) -> None:
        journal = serve("1:delay_accept=0.8")
        leaf = run(MoveRobot("m", 5.0, action_name=name, timeout=Timeouts(accept=0.5)))
        assert stood(leaf) == (Outcome.ACCEPT_TIMEOUT, End.CANCELED)
        assert journal.ends() == ["canceled"]

    def test_a_goal_believed_never_started_is_canceled_when_it_turns_up_after_all(
        self, serve: Any, name: str, run: Run
    ) -> None:
        journal = serve("1:delay_accept=2")
        late = MoveRobot("late", 9.0, action_name=name, timeout=Timeouts(accept=0.4))
        waits = MoveRobot("waits", 3.0, action_name=f"{name}_other")
        other = serve(name=f"{name}_other")
        run(in_turn(late, waits))
        assert late.outcome is Outcome.ACCEPT_TIMEOUT
        assert journal.ends() == ["canceled"]
        assert late.end is End.CANCELED
        assert other.ends() == ["succeeded"]

    def test_a_goal_that_takes_too_long_is_canceled(
        self, serve: Any, name: str, run: Run, executor: str
    ) -> None:
        journal = serve()
        leaf = run(MoveRobot("m", 5.0, action_name=name, timeout=0.3), executor=executor)
        assert stood(leaf) == (Outcome.RESULT_TIMEOUT, End.CANCELED)
        assert journal.ends() == ["canceled"]
        assert leaf.history[0].duration >= 0.3

    def test_a_goal_with_feedback_is_not_stalled(self, serve: Any, name: str, run: Run) -> None:
        serve()
        leaf = run(MoveRobot("m", 3.5, action_name=name, timeout=Timeouts(feedback=2.0)))
        assert leaf.outcome is Outcome.SUCCEEDED

    def test_others_wait_for_a_goal_that_cannot_be_canceled(
        self, serve: Any, name: str, node: Any
    ) -> None:
        journal = serve("1:reject_cancel")
        stuck = MoveRobot("stuck", 1.5, action_name=name, timeout=Timeouts(result=0.2, cancel=0.3))
        soon = MoveRobot("soon", 0.1, action_name=name, timeout=Timeouts(queue=0.3))
        later = MoveRobot("later", 0.1, action_name=name)
        tree = in_turn(stuck, soon, later)
        with TreeRunner(tree, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
            assert runner.unaccounted == []
        assert soon.outcome is Outcome.SERVER_BUSY
        held = f"goal {stuck.history[0].goal_id} of stuck has not ended there"
        assert soon.reason.endswith(f"{held}; {name} refuses to cancel it")
        assert later.outcome is Outcome.SUCCEEDED
        assert stood(stuck) == (Outcome.RESULT_TIMEOUT, End.SUCCEEDED)  # known by now
        assert journal.max_live == 1

    def test_a_result_that_is_never_given_ends_as_the_status_topic_says(
        self, serve: Any, name: str, run: Run, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("bt_actions.goals.asking.RESULT_QUESTIONS", 2)
        serve("1:drop_result")
        leaf = run(MoveRobot("m", 0.1, action_name=name))
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SUCCEEDED)

    def test_a_goal_that_ended_by_its_status_is_tried_again_though_its_result_was_lost(
        self, serve: Any, name: str, run: Run
    ) -> None:
        serve("1:drop_result=1000")
        timeouts = Timeouts(result=1.5, cancel=1.5)
        leaf = run(MoveRobot("m", 9.0, action_name=name, timeout=timeouts, retry=Retry(2)))
        first = leaf.history[0]
        assert (first.outcome, first.end) == (Outcome.RESULT_TIMEOUT, End.CANCELED)
        assert len(leaf.history) == 2

    def test_an_end_that_becomes_known_in_shutdown_is_told(self, serve: Any, name: str) -> None:
        serve("1:delay_cancel=1.5", "1:drop_result=1000")
        leaf = MoveRobot("m", 9.0, action_name=name, timeout=Timeouts(result=0.5, cancel=0.3))
        told: list[End] = []

        def tell(event: object) -> None:
            if isinstance(event, GoalChanged):
                told.append(event.end)

        with TreeRunner(leaf) as runner:
            runner.observe(tell)
            runner.run(timeout=20.0)
            assert leaf.end is told[-1] is End.UNKNOWN
            until(lambda: leaf.history[0].goal.lost_result.status)
        assert leaf.end is told[-1] is End.CANCELED
        assert runner.unaccounted == []

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
    def test_a_server_that_leaves_is_lost(
        self, host: Host, name: str, node: Any, executor: str
    ) -> None:
        host.open(name)
        leaf = MoveRobot("m", 9.0, action_name=name, retry=3)
        with TreeRunner(leaf, node=node, executor=executor) as runner:
            runner.start()
            until(lambda: executing(leaf))
            host.close_server(name)
            assert runner.wait(9.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert len(leaf.history) == 1

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

    def test_a_server_that_restarts_is_lost(
        self, serve: Any, name: str, node: Any, executor: str
    ) -> None:
        journal = serve("1:restart=0.2")
        leaf = MoveRobot("m", 1.0, action_name=name)
        with TreeRunner(leaf, node=node, executor=executor) as runner:
            assert runner.run(timeout=8.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        again = journal.wait_for("opened", times=2)
        assert time.monotonic() - again.t < 15.0

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

    def test_a_server_killed_before_it_answers_is_no_success(
        self, new_host: HostFactory, name: str, run: Run
    ) -> None:
        new_host().open(name, "1:die=accept")
        leaf = run(MoveRobot("m", 0.1, action_name=name))
        assert leaf.outcome in (Outcome.SERVER_LOST, Outcome.ACCEPT_TIMEOUT)
        assert leaf.end is End.SERVER_GONE

    def test_a_server_killed_while_canceling_settles_the_deadline(
        self, new_host: HostFactory, name: str, run: Run
    ) -> None:
        new_host().open(name, "1:die=cancel")
        leaf = run(MoveRobot("m", 9.0, action_name=name, timeout=0.3))
        assert stood(leaf) == (Outcome.RESULT_TIMEOUT, End.SERVER_GONE)


class TestInvalidGoal:
    @pytest.mark.parametrize(
        ("goal", "reason"),
        [
            ({"distance": Var("nobody_wrote")}, "variable 'nobody_wrote' has no value"),
            (lambda: {"distance": "far"}, "distance: a number (float64) is needed, not 'far'"),
            (lambda: {"distanse": 1.0}, "distanse: MoveRobot.Goal has no field 'distanse'; "),
            (lambda: 1 / 0, "ZeroDivisionError: division by zero"),
            (lambda: None, "the fields of a MoveRobot.Goal are needed, not nothing"),
        ],
        ids=["missing variable", "wrong type", "unknown field", "callable raises", "nothing"],
    )
    def test_a_goal_that_cannot_be_built_is_not_sent(
        self, serve: Any, name: str, run: Run, goal: Any, reason: str
    ) -> None:
        journal = serve()
        leaf = run(ActionBehaviour("m", MoveRobotAction, name, goal, retry=3))
        assert stood(leaf) == (Outcome.INVALID_GOAL, End.NEVER_STARTED)
        assert leaf.reason.startswith(reason)
        assert len(leaf.history) == 1
        assert journal.events() == []

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


class TestRetry:
    @pytest.mark.parametrize(
        ("fault", "outcome", "settings"),
        [
            ("reject", Outcome.REJECTED, {}),
            ("abort", Outcome.ABORTED, {}),
            ("stall=0", Outcome.STALLED, {"timeout": Timeouts(feedback=0.3)}),
            ("slow=100", Outcome.RESULT_TIMEOUT, {"timeout": Timeouts(result=0.4)}),
        ],
    )
    def test_what_may_pass_is_tried_again(
        self,
        serve: Any,
        name: str,
        run: Run,
        fault: str,
        outcome: Outcome,
        settings: dict[str, Any],
    ) -> None:
        journal = serve(f"1:{fault}", f"2:{fault}")
        leaf = run(MoveRobot("m", 0.1, action_name=name, retry=3, **settings))
        assert [record.outcome for record in leaf.history] == [outcome] * 2 + [Outcome.SUCCEEDED]
        assert [record.attempt for record in leaf.history] == [1, 2, 3]
        assert len({record.goal_id for record in leaf.history}) == 3
        assert journal.count("received") == 3
        assert journal.max_live == 1

    def test_attempts_counts_all_tries(self, serve: Any, name: str, run: Run) -> None:
        journal = serve("*:abort")
        leaf = run(MoveRobot("m", 0.1, action_name=name, retry=3))
        assert leaf.outcome is Outcome.ABORTED
        assert journal.count("received") == 3

    def test_an_unexpected_result_is_tried_again(self, serve: Any, name: str, run: Run) -> None:
        journal = serve()
        seen: list[Any] = []
        leaf = run(
            MoveRobot(
                "m",
                0.1,
                action_name=name,
                retry=3,
                expect=lambda result: seen.append(result) or len(seen) > 1,
            )
        )
        assert leaf.outcome is Outcome.SUCCEEDED
        assert journal.count("received") == 2

    def test_a_server_that_is_not_there_is_tried_again(self, name: str, run: Run) -> None:
        timeouts = Timeouts(server=0.2)
        leaf = run(MoveRobot("m", 0.1, action_name=name, retry=2, timeout=timeouts))
        assert [record.outcome for record in leaf.history] == [Outcome.SERVER_UNAVAILABLE] * 2

    @pytest.mark.parametrize("named", [False, True])
    def test_a_goal_that_may_have_been_executed_is_tried_again_only_if_named(
        self, serve: Any, name: str, run: Run, named: bool
    ) -> None:
        journal = serve("1:drop_goal")
        retry = Retry(2, outcomes=frozenset({Outcome.ACCEPT_TIMEOUT})) if named else Retry(2)
        leaf = run(MoveRobot("m", 0.1, action_name=name, retry=retry, timeout=Timeouts(accept=0.4)))
        assert leaf.outcome is (Outcome.SUCCEEDED if named else Outcome.ACCEPT_TIMEOUT)
        assert journal.count("accepted") == named

    @pytest.mark.parametrize("named", [False, True])
    def test_a_lost_server_is_tried_again_only_if_named(
        self, serve: Any, name: str, run: Run, named: bool
    ) -> None:
        journal = serve("1:restart=0.2")
        retry = Retry(2, outcomes=frozenset({Outcome.SERVER_LOST})) if named else Retry(2)
        leaf = run(MoveRobot("m", 0.3, action_name=name, retry=retry))
        assert leaf.outcome is (Outcome.SUCCEEDED if named else Outcome.SERVER_LOST)
        assert journal.count("received") == 1 + named

    def test_each_pause_is_longer_than_the_one_before(
        self, serve: Any, name: str, run: Run
    ) -> None:
        journal = serve("1:reject", "2:reject")
        leaf = run(MoveRobot("m", 0.1, action_name=name, retry=Retry(3, backoff=0.2, factor=3.0)))
        assert leaf.outcome is Outcome.SUCCEEDED
        times = [entry.t for entry in journal.entries() if entry.event == "received"]
        first, second = (later - earlier for earlier, later in itertools.pairwise(times))
        assert first >= 0.2
        assert second >= 0.6

    @pytest.mark.parametrize("when", ["result.status == 3", lambda result: result.status == 3])
    @pytest.mark.parametrize("holds", [True, False])
    def test_when_decides_over_the_result(
        self, host: Host, name: str, run: Run, when: Any, holds: bool
    ) -> None:
        """STATUS_FAULT is 3."""
        namespace = name.rpartition("/")[0]
        host.robot(namespace, "1:abort")
        if not holds:
            when = "result.status != 3" if isinstance(when, str) else lambda r: r.status != 3
        leaf = run(
            MoveRobot("m", 0.5, action_name=f"{namespace}/move_robot", retry=Retry(2, when=when))
        )
        host.close_server(namespace)
        assert leaf.outcome is (Outcome.SUCCEEDED if holds else Outcome.ABORTED)


def test_every_outcome_and_every_end_has_a_test_here() -> None:
    from pathlib import Path

    text = Path(__file__).read_text(encoding="utf-8")
    for value in [*Outcome, *End]:
        assert f"{type(value).__name__}.{value.name}" in text, value
