"""Every row of the outcome table and every end, as servers in virtual time bring them about.

What needs a real server (leases, kills, two nodes) is in tests/ros/test_outcomes.py.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from py_trees.blackboard import Blackboard
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as MoveRobotAction

from bt_actions import ActionBehaviour, End, MoveRobot, Outcome, Retry, Timeouts, Var
from bt_actions.behaviours.variables import read
from bt_actions.events import GoalChanged
from bt_actions.testing import VirtualBackend
from bt_actions.testing.transport import VirtualParticipant
from bt_actions.traffic import handover, watcher
from bt_actions.traffic.state import Entry, GoalHandle, Record, RunListener
from tests.support.trees import Gate, in_sequence, in_turn, together
from tests.support.virtual import World


def stood(leaf: ActionBehaviour) -> tuple[Outcome | None, End | None]:
    return leaf.outcome, leaf.end


def executing(leaf: ActionBehaviour) -> bool:
    return leaf.progress().state == "EXECUTING"


def run_after(world: World, first: MoveRobot, second: MoveRobot) -> None:
    """Run both beside each other; the second begins when the server has the goal of the first."""
    starts = Gate()
    with world.runner(together(first, in_sequence(starts, second))) as runner:
        runner.start()
        runner.until(lambda: executing(first))
        starts.passed = True
        runner.wait(60.0)


class TestSucceeded:
    def test_a_result_that_is_not_expected_is_unexpected(self, world: World) -> None:
        world.serve()
        leaf = world.run(MoveRobot("m", 0.1, expect="result.final_pose > 1"))
        assert leaf.status is Status.FAILURE
        assert stood(leaf) == (Outcome.UNEXPECTED_RESULT, End.SUCCEEDED)
        assert leaf.result.final_pose == 0.1

    def test_expect_may_be_a_callable_and_may_hold(self, world: World) -> None:
        world.serve()
        leaf = world.run(MoveRobot("m", 0.1, expect=lambda r: r.final_pose == 0.1))
        assert leaf.outcome is Outcome.SUCCEEDED

    def test_a_late_result_is_held_against_expect_as_well(self, world: World) -> None:
        world.serve("1:ignore_cancel")
        leaf = world.run(MoveRobot("m", 0.8, timeout=0.3, expect="result.status == 9"))
        assert leaf.outcome is Outcome.UNEXPECTED_RESULT

    def test_a_lost_result_is_asked_for_again(self, world: World) -> None:
        """The status topic tells that the goal has ended."""
        journal = world.serve("1:drop_result=2")
        leaf = world.run(MoveRobot("m", 0.1))
        assert stood(leaf) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert leaf.result.final_pose == 0.1
        assert journal.ends() == ["succeeded"]

    def test_what_is_saved_is_on_the_blackboard(self, world: World) -> None:
        world.serve()
        save = {"outcome_pose": "result.final_pose"}
        world.run(MoveRobot("m", 0.1, save=save))
        assert read("outcome_pose") == 0.1

    def test_nothing_is_saved_of_a_failure(self, world: World) -> None:
        world.serve("1:abort")
        save = {"outcome_never": "result.final_pose"}
        world.run(MoveRobot("m", 0.1, save=save))
        with pytest.raises(KeyError):
            read("outcome_never")

    def test_variables_are_read_when_the_goal_is_sent(self, world: World) -> None:
        world.serve("1:abort")
        Blackboard.set("outcome_way", {"steps": [0.3, 0.1]})
        goals = iter([0.2])

        def first_fails(result: Any) -> bool:
            Blackboard.set("outcome_way", {"steps": [0.3, next(goals)]})
            return True

        leaf = world.run(
            MoveRobot(
                "m",
                Var("outcome_way.steps.1"),
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
    def test_a_goal_may_be_given_in_many_ways(self, world: World, goal: Any) -> None:
        world.serve()
        leaf = world.run(ActionBehaviour("m", MoveRobotAction, "move_robot", goal))
        assert leaf.result.final_pose == 0.1

    def test_feedback_is_given_to_the_tree_in_order(self, world: World) -> None:
        world.serve()
        poses: list[float] = []
        world.run(MoveRobot("m", 0.5, on_feedback=lambda f: poses.append(f.current_pose)))
        assert poses
        assert poses == sorted(poses)


class TestFailedByTheServer:
    def test_rejected(self, world: World) -> None:
        journal = world.serve()
        leaf = world.run(MoveRobot("m", 101.0))
        assert leaf.status is Status.FAILURE
        assert stood(leaf) == (Outcome.REJECTED, End.NEVER_STARTED)
        assert journal.ends() == ["rejected"]

    def test_aborted_and_the_result_is_kept(self, world: World) -> None:
        world.robot("move_robot:1:abort")
        leaf = world.run(MoveRobot("m", 2.0))
        assert stood(leaf) == (Outcome.ABORTED, End.ABORTED)
        assert leaf.result.status == MoveRobotAction.Result.STATUS_FAULT
        assert leaf.result.message

    def test_canceled_by_another_client(self, world: World) -> None:
        journal = world.serve()
        leaf = MoveRobot("m", 5.0, retry=3)
        with world.runner(leaf) as runner:
            runner.start()
            runner.until(lambda: executing(leaf))
            world.cancel_all()
            assert runner.wait(5.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.CANCELED_BY_OTHER, End.CANCELED)
        assert len(leaf.history) == 1
        assert journal.ends() == ["canceled"]


class TestNoServer:
    def test_no_server_is_unavailable(self, world: World) -> None:
        leaf = world.run(MoveRobot("m", 1.0, timeout=Timeouts(server=0.4)))
        assert stood(leaf) == (Outcome.SERVER_UNAVAILABLE, End.NEVER_STARTED)
        assert leaf.history[0].duration == pytest.approx(0.4, abs=0.01)

    def test_a_server_that_comes_late_is_waited_for(self, world: World) -> None:
        leaf = MoveRobot("m", 0.1)
        with world.runner(leaf) as runner:
            runner.start()
            runner.until(lambda: leaf.progress().state == "WAITING_FOR_SERVER")
            world.serve()
            assert runner.wait(5.0) is Status.SUCCESS

    def test_a_second_server_after_sending_leaves_the_goal_alone(self, world: World) -> None:
        here = world.serve()
        first, second = (MoveRobot(n, 6.0) for n in ("first", "second"))
        tree = in_sequence(first, second)
        with world.runner(tree) as runner:
            runner.start()
            runner.until(lambda: executing(first))
            there = world.serve()
            assert executing(first)
            assert runner.wait(20.0) is Status.FAILURE
        assert stood(first) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert second.outcome is Outcome.SERVER_AMBIGUOUS
        assert here.events() == ["received", "accepted", "succeeded"]
        assert there.events() == []

    def test_a_second_server_that_came_between_two_goals_is_seen(self, world: World) -> None:
        first = world.serve()
        one, gate, two = MoveRobot("one", 0.1), Gate(), MoveRobot("two", 0.1)
        with world.runner(in_sequence(one, gate, two)) as runner:
            runner.start()
            runner.until(lambda: one.status is Status.SUCCESS)
            second = world.serve()
            runner.advance(0.02)
            gate.passed = True
            assert runner.wait(30.0) is Status.FAILURE
        assert two.outcome is Outcome.SERVER_AMBIGUOUS
        assert [first.count("received"), second.count("received")] == [1, 0]


class TestBusy:
    def test_fail_gives_up_at_once(self, world: World) -> None:
        journal = world.serve()
        first = MoveRobot("first", 9.0)
        second = MoveRobot("second", 0.1, busy="fail")
        run_after(world, first, second)
        assert stood(second) == (Outcome.SERVER_BUSY, End.NEVER_STARTED)
        assert journal.count("received") == 1

    def test_wait_gives_up_after_its_deadline(self, world: World) -> None:
        journal = world.serve()
        first = MoveRobot("first", 9.0)
        second = MoveRobot("second", 0.1, timeout=Timeouts(queue=0.3))
        run_after(world, first, second)
        assert stood(second) == (Outcome.SERVER_BUSY, End.NEVER_STARTED)
        assert second.history[0].duration >= 0.3
        assert journal.count("received") == 1

    def test_wait_goes_on_when_the_older_has_ended(self, world: World) -> None:
        journal = world.serve()
        leaves = [MoveRobot(f"m{i}", 0.2) for i in range(3)]
        world.run(together(*leaves))
        assert [leaf.outcome for leaf in leaves] == [Outcome.SUCCEEDED] * 3
        assert journal.max_live == 1

    def test_share_sends_beside_the_others(self, world: World) -> None:
        journal = world.serve()
        leaves = [MoveRobot(f"m{i}", 0.5, busy="share") for i in range(3)]
        world.run(together(*leaves))
        assert [leaf.outcome for leaf in leaves] == [Outcome.SUCCEEDED] * 3
        assert journal.max_live == 3

    def test_replace_cancels_the_older_at_once_where_another_server_has_it(
        self, world: World
    ) -> None:
        """A server cannot preempt what it does not know of."""
        journals = [world.serve(name=f"/{letter}") for letter in "ab"]
        patient = Timeouts(cancel=60.0)
        older = MoveRobot("a", 50.0, action_name="/a", resources=["base"], timeout=patient)
        newer = MoveRobot("b", 50.0, action_name="/b", resources=["base"], busy="replace")
        starts = Gate()
        with world.runner(together(older, in_sequence(starts, newer))) as runner:
            runner.start()
            runner.until(lambda: executing(older))
            starts.passed = True
            runner.until(lambda: journals[0].count("canceled"))
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
        self, world: World, faults: list[str], accept: float, outcome: Outcome
    ) -> None:
        """Requests of two nodes arrive in any order, and the last one wins."""
        journal = world.serve(*faults, preempts=True)
        older = MoveRobot("older", 9.0, timeout=Timeouts(accept=accept, cancel=0.5))
        newer = MoveRobot("newer", 0.1, busy="replace", timeout=9.0)
        backend = VirtualBackend(world.network)
        older.setup(node=backend)
        newer.setup(node=VirtualBackend(world.network, host=backend.host))
        running = [older, newer]
        while running:
            for leaf in running:
                leaf.tick_once()
                world.network.timeline.advance(world.network.now() + 0.05)
            running = [leaf for leaf in running if leaf.status is Status.RUNNING]
        assert (older.outcome, newer.outcome) == (outcome, Outcome.SUCCEEDED)
        first, second = (each.t for each in journal.entries() if each.event == "received")
        assert second - first > 1.9, "before, the newer might have been first"

    @pytest.mark.parametrize("written", ["relative", "absolute"])
    def test_a_resource_is_named_as_a_server_is(self, world: World, written: str) -> None:
        """A leaf that occupies another's server waits for it, however both are written."""
        journals = [world.serve(name=f"/{letter}") for letter in "ab"]
        arm = "/a" if written == "absolute" else "a"
        first = MoveRobot("first", 0.3, action_name="a")
        second = MoveRobot("second", 0.3, action_name="/b", resources=[arm])
        world.run(together(first, second))
        assert [leaf.outcome for leaf in (first, second)] == [Outcome.SUCCEEDED] * 2
        ended = next(e.t for e in journals[0].entries() if e.event == "succeeded")
        began = next(e.t for e in journals[1].entries() if e.event == "received")
        assert began >= ended


class TestFeedback:
    def test_the_latest_feedback_is_in_the_feedback_message_of_the_leaf(self, world: World) -> None:
        """So that any viewer of py_trees shows the progress, though nobody reads it here."""
        world.serve("1:stall=0.5")
        leaf = MoveRobot("m", 5.0)
        with world.runner(leaf) as runner:
            runner.start()
            runner.until(
                lambda: leaf.feedback_message.startswith(
                    f"executing on {leaf.server}: current_pose 0."
                )
            )
            runner.until(
                lambda: f"{leaf.progress().feedback.current_pose:g}" in leaf.feedback_message
            )

    @pytest.mark.parametrize("how", ["stop", "shutdown"])
    def test_a_leaf_that_its_own_callback_ends_is_over(self, world: World, how: str) -> None:
        journal = world.serve()

        def ends(message: Any) -> None:
            leaf.stop(Status.INVALID) if how == "stop" else leaf.shutdown()

        leaf = MoveRobot("m", 5.0, on_feedback=ends)
        with world.runner(leaf) as runner:
            assert runner.run(timeout=9.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.CANCELED, End.CANCELED)
        assert journal.count("received") == 1

    @pytest.mark.parametrize("where", ["goal", "expect", "when"])
    def test_a_leaf_that_its_own_code_stops_is_over_and_sends_no_more(
        self, world: World, where: str
    ) -> None:
        journal = world.serve(*(["1:abort"] if where == "when" else []))

        def stops(answer: Any) -> Callable[..., Any]:
            return lambda *_: (leaf.stop(Status.INVALID), answer)[1]

        settings: dict[str, Any] = {
            "goal": {"goal": stops({"distance": 0.3})},
            "expect": {"expect": stops(True)},
            "when": {"retry": Retry(3, when=stops(True))},
        }[where]
        settings.setdefault("goal", {"distance": 0.3})
        goal = settings.pop("goal")
        leaf = ActionBehaviour(
            "m", "robot_control_interfaces/MoveRobot", "move_robot", goal, **settings
        )
        with world.runner(leaf) as runner:
            assert runner.run(timeout=9.0) is Status.FAILURE
        expected = Outcome.ABORTED if where == "when" else Outcome.CANCELED
        assert (leaf.outcome, len(leaf.history)) == (expected, 1)
        assert journal.count("received") == (0 if where == "goal" else 1)


class TestDeadlines:
    def test_a_request_that_is_never_answered(
        self, world: World, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(VirtualParticipant, "unheard", lambda _: "; as a guess")
        journal = world.serve("1:drop_goal")
        timeouts = Timeouts(accept=0.5, cancel=1.0)
        leaf = MoveRobot("m", 0.1, timeout=timeouts)
        ends = []
        with world.runner(leaf) as runner:
            runner.observe_events(lambda event: ends.append(getattr(event, "end", None)))
            runner.run(timeout=9.0)
            assert [report.goal_id for report in runner.unaccounted] == [leaf.history[0].goal_id]
        assert stood(leaf) == (Outcome.ACCEPT_TIMEOUT, End.UNKNOWN)
        assert leaf.reason == "no answer to the goal request within 0.5 s; as a guess"
        assert End.NEVER_STARTED in ends, "the server denied it, so that the tree could go on"
        assert journal.count("accepted") == 0

    def test_a_server_that_decides_after_the_tree_has_gone_on_is_waited_for(
        self, world: World
    ) -> None:
        """It denies the goal as long as it has not decided: that proves nothing."""
        journal = world.serve("1:delay_accept=2")
        leaf = world.run(MoveRobot("m", 5.0, timeout=Timeouts(accept=0.5, cancel=2.0)))
        assert stood(leaf) == (Outcome.ACCEPT_TIMEOUT, End.CANCELED)
        assert journal.ends() == ["canceled"]

    def test_an_acceptance_after_its_deadline_is_canceled_at_once(self, world: World) -> None:
        journal = world.serve("1:delay_accept=0.8")
        leaf = world.run(MoveRobot("m", 5.0, timeout=Timeouts(accept=0.5)))
        assert stood(leaf) == (Outcome.ACCEPT_TIMEOUT, End.CANCELED)
        assert journal.ends() == ["canceled"]

    def test_a_goal_believed_never_started_is_canceled_when_it_turns_up_after_all(
        self, world: World
    ) -> None:
        journal = world.serve("1:delay_accept=2")
        late = MoveRobot("late", 9.0, timeout=Timeouts(accept=0.4))
        waits = MoveRobot("waits", 3.0, action_name="/other")
        other = world.serve(name="/other")
        world.run(in_turn(late, waits))
        assert late.outcome is Outcome.ACCEPT_TIMEOUT
        assert journal.ends() == ["canceled"]
        assert late.end is End.CANCELED
        assert other.ends() == ["succeeded"]

    def test_a_goal_that_takes_too_long_is_canceled(self, world: World) -> None:
        journal = world.serve()
        leaf = world.run(MoveRobot("m", 5.0, timeout=0.3))
        assert stood(leaf) == (Outcome.RESULT_TIMEOUT, End.CANCELED)
        assert journal.ends() == ["canceled"]
        assert leaf.history[0].duration >= 0.3

    def test_a_goal_with_feedback_is_not_stalled(self, world: World) -> None:
        world.serve()
        leaf = world.run(MoveRobot("m", 3.5, timeout=Timeouts(feedback=2.0)))
        assert leaf.outcome is Outcome.SUCCEEDED

    def test_others_wait_for_a_goal_that_cannot_be_canceled(self, world: World) -> None:
        journal = world.serve("1:reject_cancel")
        stuck = MoveRobot("stuck", 1.5, timeout=Timeouts(result=0.2, cancel=0.3))
        soon = MoveRobot("soon", 0.1, timeout=Timeouts(queue=0.3))
        later = MoveRobot("later", 0.1)
        tree = in_turn(stuck, soon, later)
        with world.runner(tree) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
            assert runner.unaccounted == []
        assert soon.outcome is Outcome.SERVER_BUSY
        held = f"goal {stuck.history[0].goal_id} of stuck has not ended there"
        assert soon.reason.endswith(f"{held}; /move_robot refuses to cancel it")
        assert later.outcome is Outcome.SUCCEEDED
        assert stood(stuck) == (Outcome.RESULT_TIMEOUT, End.SUCCEEDED)  # known by now
        assert journal.max_live == 1

    def test_a_result_that_is_never_given_ends_as_the_status_topic_says(self, world: World) -> None:
        world.serve("1:drop_result")
        leaf = world.run(MoveRobot("m", 0.1))
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SUCCEEDED)

    def test_a_goal_that_ended_by_its_status_is_tried_again_though_its_result_was_lost(
        self, world: World
    ) -> None:
        world.serve("1:drop_result=1000")
        timeouts = Timeouts(result=1.5, cancel=1.5)
        leaf = world.run(MoveRobot("m", 9.0, timeout=timeouts, retry=Retry(2)))
        first = leaf.history[0]
        assert (first.outcome, first.end) == (Outcome.RESULT_TIMEOUT, End.CANCELED)
        assert len(leaf.history) == 2

    def test_an_end_that_becomes_known_in_shutdown_is_told(self, world: World) -> None:
        world.serve("1:delay_cancel=1.5", "1:drop_result=1000")
        leaf = MoveRobot("m", 9.0, timeout=Timeouts(result=0.5, cancel=0.3))
        told: list[End] = []

        def tell(event: object) -> None:
            if isinstance(event, GoalChanged):
                told.append(event.end)

        with world.runner(leaf) as runner:
            runner.observe_events(tell)
            runner.run(timeout=20.0)
            assert leaf.end is told[-1] is End.UNKNOWN
            runner.until(lambda: leaf.history[0].goal.lost_result.status)
        assert leaf.end is told[-1] is End.CANCELED
        assert runner.unaccounted == []


class Noted(Record):
    """A record that has everything, and takes note of what it is told."""

    def __init__(self, order: list[str]) -> None:
        self.order = order

    def __contains__(self, goal_id: bytes) -> bool:
        return True

    def enter(self, goal_id: bytes, entry: Entry) -> None:
        self.order.append("lost" if entry.lost else "sent")


class TestServerLost:
    def test_a_server_that_leaves_is_lost(self, world: World) -> None:
        world.serve()
        leaf = MoveRobot("m", 9.0, retry=3)
        with world.runner(leaf) as runner:
            runner.start()
            runner.until(lambda: executing(leaf))
            world.servers["/move_robot"].close()
            assert runner.wait(9.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert len(leaf.history) == 1

    def test_a_server_that_restarts_is_lost(self, world: World) -> None:
        journal = world.serve("1:restart=0.2")
        leaf = MoveRobot("m", 1.0)
        with world.runner(leaf) as runner:
            assert runner.run(timeout=8.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert journal.count("opened") == 2

    def test_a_server_killed_before_it_answers_is_no_success(self, world: World) -> None:
        world.serve("1:die=accept")
        leaf = world.run(MoveRobot("m", 0.1))
        assert leaf.outcome in (Outcome.SERVER_LOST, Outcome.ACCEPT_TIMEOUT)
        assert leaf.end is End.SERVER_GONE

    def test_who_is_told_of_a_lost_goal_finds_that_on_record(self, world: World) -> None:
        """A process that is killed on that word leaves a record that says so."""
        world.serve("1:delay_accept=60")
        leaf = MoveRobot("m", 0.1, timeout=Timeouts(accept=60.0))
        order: list[str] = []
        with world.runner(leaf) as runner:
            runner.backend.traffic.host.record = Noted(order)
            stream = runner._loop.teller.stream
            add = stream.add

            def told(kind: type, *args: Any, **fields: Any) -> None:
                if kind is GoalChanged and Outcome.SERVER_LOST in args:
                    order.append("told")
                add(kind, *args, **fields)

            stream.add = told  # type: ignore[method-assign, assignment]
            runner.observe_events(lambda event: None)
            runner.start()
            runner.until(lambda: leaf.progress().state == "SENDING")
            world.servers["/move_robot"].close()
            runner.wait(90.0)
        assert order[:3] == ["sent", "lost", "told"]

    def test_a_server_killed_while_canceling_settles_the_deadline(self, world: World) -> None:
        world.serve("1:die=cancel")
        leaf = world.run(MoveRobot("m", 9.0, timeout=0.3))
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
        self, world: World, goal: Any, reason: str
    ) -> None:
        journal = world.serve()
        leaf = world.run(ActionBehaviour("m", MoveRobotAction, "move_robot", goal, retry=3))
        assert stood(leaf) == (Outcome.INVALID_GOAL, End.NEVER_STARTED)
        assert leaf.reason.startswith(reason)
        assert len(leaf.history) == 1
        assert journal.events() == []


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
        self, world: World, fault: str, outcome: Outcome, settings: dict[str, Any]
    ) -> None:
        journal = world.serve(f"1:{fault}", f"2:{fault}")
        leaf = world.run(MoveRobot("m", 0.1, retry=3, **settings))
        assert [record.outcome for record in leaf.history] == [outcome] * 2 + [Outcome.SUCCEEDED]
        assert [record.attempt for record in leaf.history] == [1, 2, 3]
        assert len({record.goal_id for record in leaf.history}) == 3
        assert journal.count("received") == 3
        assert journal.max_live == 1

    def test_attempts_counts_all_tries(self, world: World) -> None:
        journal = world.serve("*:abort")
        leaf = world.run(MoveRobot("m", 0.1, retry=3))
        assert leaf.outcome is Outcome.ABORTED
        assert journal.count("received") == 3

    def test_an_unexpected_result_is_tried_again(self, world: World) -> None:
        journal = world.serve()
        seen: list[Any] = []
        leaf = world.run(
            MoveRobot(
                "m",
                0.1,
                retry=3,
                expect=lambda result: seen.append(result) or len(seen) > 1,
            )
        )
        assert leaf.outcome is Outcome.SUCCEEDED
        assert journal.count("received") == 2

    def test_a_server_that_is_not_there_is_tried_again(self, world: World) -> None:
        timeouts = Timeouts(server=0.2)
        leaf = world.run(MoveRobot("m", 0.1, retry=2, timeout=timeouts))
        assert [record.outcome for record in leaf.history] == [Outcome.SERVER_UNAVAILABLE] * 2

    @pytest.mark.parametrize("named", [False, True])
    def test_a_goal_that_may_have_been_executed_is_tried_again_only_if_named(
        self, world: World, named: bool
    ) -> None:
        journal = world.serve("1:drop_goal")
        retry = Retry(2, outcomes=frozenset({Outcome.ACCEPT_TIMEOUT})) if named else Retry(2)
        leaf = world.run(MoveRobot("m", 0.1, retry=retry, timeout=Timeouts(accept=0.4)))
        assert leaf.outcome is (Outcome.SUCCEEDED if named else Outcome.ACCEPT_TIMEOUT)
        assert journal.count("accepted") == named

    @pytest.mark.parametrize("named", [False, True])
    def test_a_lost_server_is_tried_again_only_if_named(self, world: World, named: bool) -> None:
        journal = world.serve("1:restart=0.2")
        retry = Retry(2, outcomes=frozenset({Outcome.SERVER_LOST})) if named else Retry(2)
        leaf = world.run(MoveRobot("m", 0.3, retry=retry))
        assert leaf.outcome is (Outcome.SUCCEEDED if named else Outcome.SERVER_LOST)
        assert journal.count("received") == 1 + named

    def test_each_pause_is_longer_than_the_one_before(self, world: World) -> None:
        journal = world.serve("1:reject", "2:reject")
        leaf = world.run(MoveRobot("m", 0.1, retry=Retry(3, backoff=0.2, factor=3.0)))
        assert leaf.outcome is Outcome.SUCCEEDED
        times = [entry.t for entry in journal.entries() if entry.event == "received"]
        first, second = (later - earlier for earlier, later in itertools.pairwise(times))
        assert first >= 0.2
        assert second >= 0.6

    def test_a_pause_begins_when_the_result_has_been_judged(self, world: World) -> None:
        world.serve()
        judged: list[float] = []

        def slowly(result: Any) -> bool:
            world.network.timeline.now += 2.0
            judged.append(world.network.now())
            return len(judged) > 1

        leaf = world.run(MoveRobot("m", 0.1, retry=Retry(2, backoff=1.0), expect=slowly))
        assert leaf.history[1].started >= judged[0] + 1.0

    @pytest.mark.parametrize("when", ["result.status == 3", lambda result: result.status == 3])
    @pytest.mark.parametrize("holds", [True, False])
    def test_when_decides_over_the_result(self, world: World, when: Any, holds: bool) -> None:
        """STATUS_FAULT is 3."""
        world.robot("move_robot:1:abort")
        if not holds:
            when = "result.status != 3" if isinstance(when, str) else lambda r: r.status != 3
        leaf = world.run(MoveRobot("m", 0.5, retry=Retry(2, when=when)))
        assert leaf.outcome is (Outcome.SUCCEEDED if holds else Outcome.ABORTED)


def test_every_outcome_and_every_end_has_a_test_here() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    for value in [*Outcome, *End]:
        assert f"{type(value).__name__}.{value.name}" in text, value


@pytest.mark.parametrize("busy", ["share", "wait"])
def test_what_another_node_left_is_canceled_first_also_at_a_server_just_looked_at(
    world: World, busy: str
) -> None:
    world.serve("1:ignore_cancel")
    network, other = world.network, VirtualBackend(world.network)
    node = VirtualBackend(network, host=other.host)
    old = MoveRobot("old", 9.0, timeout=Timeouts(cancel=0.2), resources=["a"])
    looks = MoveRobot("looks", 0.0, busy="share", resources=["b"])
    new = MoveRobot("new", 0.1, busy=busy, resources=["b"])
    for leaf, backend in ((old, other), (looks, node), (new, node)):
        leaf.setup(node=backend)
    for leaf in (old, old, looks, looks):
        leaf.tick_once()
        network.timeline.advance(network.now() + 0.2)
    assert executing(old)
    other.traffic.destroy()
    new.tick_once()
    assert new.progress().state == "WAITING_FOR_SERVER"


def test_a_lost_goal_that_another_node_takes_over_is_still_known_to_be_left(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.serve()
    here = VirtualBackend(world.network)
    leaves = [MoveRobot(name, 9.0) for name in ("one", "two")]
    leaves[0].setup(node=here)
    leaves[1].setup(node=VirtualBackend(world.network, host=here.host))
    until_it_runs(world, leaves[0])
    one, two = (leaf._own for leaf in leaves)
    monkeypatch.setattr(one.transport, "servers", frozenset)
    watcher.look(one, here.host.steady())
    two.watch.see(here.host.steady(), True, two.transport.servers())
    handover.take_over(two, here.host.steady())
    [handle] = leaves[0].open_handles()
    assert handle.goal.lost
    assert handle.endpoint is two
    assert handle in here.host.domain(0).left


def test_a_node_that_is_destroyed_while_a_goal_is_made_sends_it_not(world: World) -> None:
    journal = world.serve()
    node = VirtualBackend(world.network)
    leaf = MoveRobot("m", 0.1)
    leaf.setup(node=node)
    leaf.goal = lambda: node.traffic.participant.close() or {"distance": 0.1}
    while leaf.tick_once() or leaf.status is Status.RUNNING:
        world.network.timeline.advance(world.network.now() + 0.05)
    assert stood(leaf) == (Outcome.CANCELED, End.NEVER_STARTED)
    assert journal.count("received") == 0


def test_a_leaf_that_was_shut_down_and_is_set_up_again_has_a_transport_that_is_open(
    world: World,
) -> None:
    node, leaf = VirtualBackend(world.network), MoveRobot("m", 0.1)
    for _ in range(2):
        leaf.setup(node=node)
        transport = leaf._own.transport
        assert not transport.closed
        leaf.shutdown()
        assert transport.closed


def test_all_that_a_goal_has_decided_is_done_before_what_follows_for_the_next(world: World) -> None:
    """The result of the first gives the server to the second, which is told when that is over."""
    world.serve()
    node = VirtualBackend(world.network)
    first, second = MoveRobot("first", 0.1), MoveRobot("second", 0.1)
    for leaf in (first, second):
        leaf.setup(node=node)
    until_it_runs(world, first)
    second.tick_once()
    [waits] = second.open_handles()
    there = list[list[str]]()

    def note(changed: GoalHandle | None) -> None:
        if changed is not None:
            there.append([each.name for each in changed.endpoint.handles])

    waits.run = RunListener(note)
    while not there:
        world.network.timeline.advance(world.network.now() + 0.05)
    assert there == [["second"]]


def until_it_runs(world: World, leaf: ActionBehaviour) -> None:
    while leaf.tick_once() or not executing(leaf):
        world.network.timeline.advance(world.network.now() + 0.05)
