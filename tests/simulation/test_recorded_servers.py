"""A recorded run is played again: servers answer as they did, and what differs is said."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree as RunTreeAction
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as Move
from test_msgs.action import Fibonacci

from bt_actions import ActionBehaviour, End, MoveRobot, Outcome, RunTree, Timeouts
from bt_actions.behaviours.leaves import Wait
from bt_actions.events import Event, EventsLost, FeedbackCame, GoalChanged, Moment, ServerSeen
from bt_actions.events.bare import bare
from bt_actions.events.snapshot import HIDDEN, Value
from bt_actions.simulation import RecordedServers, Script, ScriptedServer
from bt_actions.simulation.recorded.run import RecordedGoal
from bt_actions.simulation.recorded.servers import RecordedServer
from bt_actions.testing import VirtualNetwork, VirtualRunner
from bt_actions.testing.transport import VirtualParticipant
from tests.simulation.conftest import Bench, Client
from tests.support.trees import in_sequence, in_turn, together

TIMEOUTS = Timeouts(server=2.0, accept=1.0, result=5.0, feedback=2.0, cancel=2.0)
EMPTY = {"final_pose": 0.0, "status": 0, "message": ""}
FAULTS = (
    *("reject", "abort", "stall", "slow=9", "no_feedback", "drop_goal", "drop_accept"),
    *("die", "restart=1", "delay_result=1", "delay_accept=0.8", "delay_accept=1.5"),
)
ON_CANCEL = (
    *("delay_cancel=1", "drop_cancel", "ignore_cancel", "reject_cancel"),
    *("succeed_on_cancel", "abort_on_cancel"),
)


def move(name: str, distance: float, **settings: Any) -> MoveRobot:
    return MoveRobot(name, distance, **{"timeout": TIMEOUTS, **settings})


def recorded(tree: Behaviour, *faults: str, **script: Any) -> VirtualRunner:
    """Run a tree with a server whose goals take 3 s, and do what their distance says."""
    network = VirtualNetwork()
    does: dict[str, Any] = {
        "duration": 3.0,
        "result": lambda goal: Move.Result(final_pose=goal.distance, message="there"),
        "feedback": lambda goal, done: Move.Feedback(current_pose=goal.distance * done),
    }
    ScriptedServer(
        network,
        Move,
        "move_robot",
        Script(**does | script),
        faults=[f"move_robot:{fault}" for fault in faults],
    )
    runner = VirtualRunner(tree, network)
    runner.run()
    return runner


def again(
    tree: Behaviour, events: Iterable[Event], **settings: Any
) -> tuple[VirtualRunner, RecordedServers]:
    """Run a tree with the servers of the run that `events` tell of."""
    network = VirtualNetwork()
    servers = RecordedServers(network, tree, events, **settings)
    runner = VirtualRunner(tree, network)
    runner.run()
    return runner, servers


def warnings(runner: VirtualRunner) -> list[str]:
    return [text for level, text in runner.network.log.lines if level == "warning"]


def told(events: Iterable[Event]) -> list[tuple[Any, ...]]:
    """What a leaf learned of each goal at its end: outcome, end, result."""
    last = {each.goal_id: each for each in events if isinstance(each, GoalChanged)}
    results = {
        each.goal_id: each.result
        for each in events
        if isinstance(each, GoalChanged) and each.result is not None
    }
    return [(each.outcome, each.end, results.get(each.goal_id)) for each in last.values()]


def times(events: Iterable[Event]) -> list[float]:
    """Seconds from acceptance to the end of each goal."""
    accepted, over = dict[str, float](), dict[str, float]()
    for each in events:
        if isinstance(each, GoalChanged) and each.state == "EXECUTING":
            accepted[each.goal_id] = each.at.steady
        elif isinstance(each, GoalChanged) and each.state == "DONE":
            over.setdefault(each.goal_id, each.at.steady)
    return [over[key] - at for key, at in accepted.items() if key in over]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_goal_ends_again_as_it_did(fault: str) -> None:
    first = recorded(move("A", 1.0), f"1:{fault}")
    runner, servers = again(move("A", 1.0), first.events)
    assert told(runner.events) == told(first.events)
    assert runner.outcomes == first.outcomes
    assert runner.now == pytest.approx(first.now, abs=0.3)
    assert warnings(runner) == warnings(first)
    assert all("at most five a second" in each for each in servers.remarks)


@pytest.mark.parametrize("fault", ON_CANCEL)
def test_a_cancel_request_is_answered_as_it_was(fault: str) -> None:
    first = recorded(move("A", 1.0), "1:slow=9", f"1:{fault}")
    runner, _ = again(move("A", 1.0), first.events)
    assert [o for o, *_ in told(runner.events)] == [o for o, *_ in told(first.events)]
    assert runner.now == pytest.approx(first.now, abs=0.2)


def test_results_times_and_feedback_are_those_that_were_recorded() -> None:
    tree = in_sequence(move("A", 1.0), move("B", 2.0))
    first = recorded(tree, "2:slow=1.5")
    came: list[float] = []

    def hears(name: str, distance: float) -> MoveRobot:
        return move(name, distance, on_feedback=lambda each: came.append(each.current_pose))

    runner, _ = again(in_sequence(hears("A", 1.0), hears("B", 2.0)), first.events)
    assert told(runner.events) == told(first.events)
    assert times(runner.events) == pytest.approx(times(first.events), abs=0.05)
    recorded_ones = [each for each in first.events if isinstance(each, FeedbackCame)]
    assert came == [each.feedback["current_pose"] for each in recorded_ones]  # type: ignore[index,call-overload]


def test_speed_shortens_what_a_server_takes() -> None:
    first = recorded(move("A", 1.0))
    runner, _ = again(move("A", 1.0), first.events, speed=10.0)
    assert times(runner.events) == pytest.approx([0.3], abs=0.05)


def test_faults_are_added_to_what_was_recorded() -> None:
    first = recorded(in_turn(move("A", 1.0), move("B", 1.0)), "1:reject")
    tree = in_turn(move("A", 1.0), move("B", 1.0))
    runner, _ = again(tree, first.events, faults=["move_robot:2:abort"])
    assert runner.outcomes == [("A", Outcome.REJECTED), ("B", Outcome.ABORTED)]


def test_a_server_of_any_action_type_is_played() -> None:
    def tree() -> Behaviour:
        return ActionBehaviour("F", Fibonacci, "fibonacci", {"order": 3}, timeout=5.0)

    network = VirtualNetwork()
    script = Script(
        result=lambda goal: Fibonacci.Result(sequence=[0, 1, goal.order]),
        feedback=lambda goal, done: Fibonacci.Feedback(sequence=[0]),
    )
    ScriptedServer(network, Fibonacci, "fibonacci", script)
    first = VirtualRunner(tree(), network)
    assert first.run() is Status.SUCCESS
    runner, _ = again(tree(), first.events)
    assert told(runner.events) == told(first.events)
    assert told(runner.events)[0][2] == {"sequence": (0, 1, 3)}


@pytest.mark.parametrize("settled", [True, False])
def test_a_tree_that_another_server_runs_is_played_for_another_run(settled: bool) -> None:
    network = VirtualNetwork()
    result = RunTreeAction.Result(outputs='{"pose": 2.0}', settled=settled)
    script = Script(result=lambda goal: result)
    ScriptedServer(network, RunTreeAction, "run_tree", script, faults=["run_tree:2:abort"])
    first = VirtualRunner(in_sequence(RunTree("A", "pick"), RunTree("B", "place")), network)
    first.run()
    tree = in_sequence(RunTree("A", "pick"), RunTree("B", "place"))
    network = VirtualNetwork()
    RecordedServers(network, tree, first.events)
    runner = VirtualRunner(tree, network, seed=7)  # goals name the run that sends them
    runner.run()
    assert told(runner.events) == told(first.events)
    assert warnings(runner) == []


def test_a_tree_that_was_canceled_and_may_have_left_goals_is_canceled_as_soon_again() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, RunTreeAction, "run_tree", Script(duration=60.0))
    first = VirtualRunner(RunTree("A", "pick", timeout=Timeouts(result=1.0)), network)
    first.run()
    assert [end for _, end, _ in told(first.events)] == [End.UNKNOWN]
    runner, _ = again(RunTree("A", "pick", timeout=Timeouts(result=1.0)), first.events)
    assert told(runner.events) == told(first.events)
    assert runner.now == pytest.approx(first.now, abs=0.3)


def test_a_goal_that_another_client_canceled_is_canceled_again() -> None:
    network = VirtualNetwork()
    server = ScriptedServer(network, Move, "move_robot", Script(duration=3.0))
    first = VirtualRunner(move("A", 1.0), network)
    first.start()
    first.advance(1.0)
    transport = VirtualParticipant(network, "other", "/").open_transport(
        Move, "/move_robot", Deaf()
    )
    transport.cancel(bytes.fromhex(server.live_goals[0]))
    first.run()
    assert first.outcomes == [("A", Outcome.CANCELED_BY_OTHER)]
    runner, _ = again(move("A", 1.0), first.events)
    assert told(runner.events) == told(first.events)


class Deaf:
    """Who hears nothing of what others do."""

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


class TestOnEitherNetwork:
    def serve(self, bench: Bench, space: str, end: End, away: float = 0.0) -> Client:
        """Serve one recorded goal of a tenth of a second."""
        goal = RecordedGoal({"order": 0}, 0.0, accepted=0.0, over=0.1, ended=end, away=away)
        goal.result = {"sequence": (5,)}
        client = bench.client(Fibonacci, f"{space}/fibonacci")
        bench.serve(RecordedServer(bench.node, Fibonacci, f"{space}/fibonacci", [goal]))
        return client.until_ready()

    def test_a_goal_is_canceled_again_though_nobody_asks_for_it(
        self, bench: Bench, space: str
    ) -> None:
        goal = self.serve(bench, space, End.CANCELED).send().until_ended()
        assert (goal.status, list(goal.result.sequence)) == (GoalStatus.STATUS_CANCELED, [5])

    def test_a_server_that_goes_after_a_goal_gives_its_result_first_and_comes_back(
        self, bench: Bench, space: str
    ) -> None:
        client = self.serve(bench, space, End.ABORTED, away=0.3)
        goal = client.send().until_ended()
        assert (goal.status, list(goal.result.sequence)) == (GoalStatus.STATUS_ABORTED, [5])
        bench.until(lambda: not client.is_ready(), what="the server goes")
        assert client.until_ready().send().until_ended().status == GoalStatus.STATUS_SUCCEEDED


class TestServersThatWereNotThere:
    def test_one_that_never_came_is_not_there_again(self) -> None:
        first = VirtualRunner(move("A", 1.0))
        assert first.run() is Status.FAILURE
        assert first.outcomes == [("A", Outcome.SERVER_UNAVAILABLE)]
        runner, servers = again(move("A", 1.0), first.events)
        assert runner.outcomes == first.outcomes
        assert servers.servers == []

    def test_one_that_came_late_comes_late_again(self) -> None:
        network = VirtualNetwork()
        tree = in_sequence(move("A", 1.0, retry=2))
        network.timeline.call_in(3.5, lambda: ScriptedServer(network, Move, "move_robot"))
        first = VirtualRunner(tree, network)
        assert first.run() is Status.SUCCESS
        runner, _ = again(in_sequence(move("A", 1.0, retry=2)), first.events)
        assert runner.outcomes == first.outcomes
        assert runner.now == pytest.approx(first.now, abs=0.2)

    def test_one_that_went_between_two_goals_and_came_back_does_so_again(self) -> None:
        def tree() -> Behaviour:
            return in_sequence(move("A", 1.0), Wait("W", lambda: 0.5), move("B", 2.0, retry=2))

        network = VirtualNetwork()
        server = ScriptedServer(network, Move, "move_robot", Script(duration=1.0))
        network.timeline.call_in(1.3, lambda: server.restart(3.0))
        first = VirtualRunner(tree(), network)
        assert first.run() is Status.SUCCESS
        assert [outcome for _, outcome in first.outcomes][1] is Outcome.SERVER_UNAVAILABLE
        runner, _ = again(tree(), first.events)
        assert runner.outcomes == first.outcomes
        assert runner.now == pytest.approx(first.now, abs=0.3)

    def test_one_that_came_back_is_there_though_more_is_told_of_the_goal_it_lost(self) -> None:
        def tree() -> Behaviour:
            return in_turn(move("A", 1.0), in_sequence(Wait("W", lambda: 9.0), move("B", 2.0)))

        first = recorded(tree(), "1:restart=1")
        assert first.outcomes == [("A", Outcome.SERVER_LOST), ("B", Outcome.SUCCEEDED)]
        lost = next(each for each in first.events if getattr(each, "outcome", None))
        back = [at for at, each in enumerate(first.events) if isinstance(each, ServerSeen)][-1]
        later = replace(lost, at=first.events[back].at, state="DONE")  # type: ignore[call-arg]
        events = [*first.events[: back + 1], later, *first.events[back + 1 :]]
        runner, servers = again(tree(), events)
        assert runner.outcomes == first.outcomes
        assert servers.run.servers["/move_robot"].goals[0].away == pytest.approx(1.0, abs=0.5)

    def test_one_that_died_with_two_goals_stays_away_for_both(self) -> None:
        def tree() -> Behaviour:
            beside = move("A", 1.0, busy="share"), move("B", 2.0, busy="share")
            return together(*beside)

        network = VirtualNetwork()
        server = ScriptedServer(network, Move, "move_robot", Script(duration=9.0))
        network.timeline.call_in(2.0, server.die)
        first = VirtualRunner(tree(), network)
        first.run()
        runner, servers = again(tree(), first.events)
        assert runner.outcomes == first.outcomes
        assert [outcome for _, outcome in runner.outcomes] == [Outcome.SERVER_LOST] * 2
        assert not servers.servers[0].is_open


class TestWhichGoalIsWhich:
    def test_goals_in_another_order_get_their_own_answers(self) -> None:
        first = recorded(in_sequence(move("A", 1.0), move("B", 2.0), move("C", 1.0)))
        runner, _ = again(in_sequence(move("B", 2.0), move("A", 1.0), move("C", 1.0)), first.events)
        assert [result["final_pose"] for _, _, result in told(runner.events)] == [2.0, 1.0, 1.0]
        assert warnings(runner) == []

    def test_equal_goals_get_their_answers_in_their_order(self) -> None:
        tree = in_turn(move("A", 1.0), move("B", 1.0))
        first = recorded(tree, "1:abort")
        runner, _ = again(in_turn(move("A", 1.0), move("B", 1.0)), first.events)
        assert runner.outcomes == [("A", Outcome.ABORTED), ("B", Outcome.SUCCEEDED)]

    def test_another_goal_is_answered_as_the_oldest_left_and_both_are_named(self) -> None:
        first = recorded(in_sequence(move("A", 1.0), move("B", 2.0)))
        runner, _ = again(in_sequence(move("A", 1.0), move("B", 7.0)), first.events)
        assert told(runner.events)[1][2]["final_pose"] == 2.0
        [said] = warnings(runner)
        assert said == (
            "/move_robot: goal 2, {distance: 7.0}, is answered as {distance: 2.0} was in the "
            "recorded run"
        )

    def test_a_goal_beyond_the_recorded_ones_is_answered_by_the_script_and_named(self) -> None:
        first = recorded(move("A", 1.0), "1:abort")
        script = Script(result=lambda goal: Move.Result(final_pose=9.0))
        runner, servers = again(move("A", 1.0, retry=2), first.events, script=script)
        assert runner.outcomes == [("A", Outcome.ABORTED), ("A", Outcome.SUCCEEDED)]
        assert told(runner.events)[1][2]["final_pose"] == 9.0
        assert warnings(runner) == [
            "/move_robot: goal 2, {distance: 1.0}, is beyond the 1 recorded: its answer is made up"
        ]
        assert "1 of 1 of /move_robot" in servers.describe()

    def test_servers_of_the_tree_or_of_the_run_alone_are_named(self) -> None:
        first = recorded(move("A", 1.0))
        new = MoveRobot("A", 1.0, action_name="arm")
        network = VirtualNetwork()
        servers = RecordedServers(network, new, first.events)
        assert servers.remarks[-2:] == [
            "the recorded run has no goals for /arm: answers are made up",
            "the tree has no leaf for /move_robot: its goals are not asked for",
        ]
        assert VirtualRunner(new, network).run() is Status.SUCCESS

    def test_a_goal_is_known_again_whatever_its_stamp(self) -> None:
        first = recorded(in_sequence(move("A", 1.0), move("B", 2.0)))
        stamp: Value = {"sec": 4, "nanosec": 0}
        events = [
            replace(each, goal={**each.goal, "stamp": stamp})
            if isinstance(each, GoalChanged) and isinstance(each.goal, dict)
            else each
            for each in first.events
        ]
        runner, _ = again(in_sequence(move("B", 2.0), move("A", 1.0)), events)
        assert [result["final_pose"] for _, _, result in told(runner.events)] == [2.0, 1.0]
        assert warnings(runner) == []


class TestWhatIsNotKnown:
    def test_a_recording_without_values_says_so_and_has_outcomes(self) -> None:
        first = recorded(move("A", 1.0), "1:abort")
        events = [each for event in first.events if (each := bare(event)) is not None]
        runner, servers = again(move("A", 1.0), events)
        assert runner.outcomes == first.outcomes
        assert warnings(runner) == []
        [said] = servers.remarks
        assert said.startswith("not recorded, or not whole: 1 of 1 goals, 1 of 1 results; ")

    def test_a_secret_goal_is_in_no_warning(self) -> None:
        first = recorded(move("A", 1.0))
        events = [
            replace(each, goal=HIDDEN) if isinstance(each, GoalChanged) and each.goal else each
            for each in first.events
        ]
        runner, servers = again(in_sequence(move("A", 1.0), move("B", 2.0)), events)
        assert runner.outcomes == [("A", Outcome.SUCCEEDED), ("B", Outcome.SUCCEEDED)]
        assert "1 of 1 goals" in servers.remarks[0]
        [said] = warnings(runner)
        assert said.startswith("/move_robot: goal 2 is beyond the 1 recorded")

    def test_of_a_value_that_was_cut_the_beginning_is_played(self) -> None:
        def tree() -> ActionBehaviour:
            return ActionBehaviour("F", Fibonacci, "fibonacci", {"order": 3}, timeout=5.0)

        network = VirtualNetwork()
        script = Script(result=lambda goal: Fibonacci.Result(sequence=[7] * 5000))
        ScriptedServer(network, Fibonacci, "fibonacci", script)
        first = VirtualRunner(tree(), network)
        first.run()
        leaf = tree()
        _, servers = again(leaf, first.events)
        assert 0 < len(leaf.result.sequence) < 5000
        assert "1 of 1 results" in servers.remarks[0]

    def test_a_field_that_the_type_has_no_more_is_named(self) -> None:
        first = recorded(move("A", 1.0))
        events = [
            replace(each, result={"final_pose": 4.0, "\x1b[2Jold": 1})
            if isinstance(each, GoalChanged) and each.result
            else each
            for each in first.events
        ]
        runner, _ = again(move("A", 1.0), events)
        assert told(runner.events)[0][2]["final_pose"] == 4.0
        [said] = warnings(runner)
        assert re.search(r"a recorded MoveRobot.Result does not fit: .*old", said)
        assert "\x1b" not in said

    def test_a_second_server_of_a_name_is_not_played_and_named(self) -> None:
        network = VirtualNetwork()
        for _ in range(2):
            ScriptedServer(network, Move, "move_robot")
        first = VirtualRunner(move("A", 1.0), network)
        first.run()
        assert first.outcomes == [("A", Outcome.SERVER_AMBIGUOUS)]
        _, servers = again(move("A", 1.0), first.events)
        assert servers.remarks == ["two servers answered to /move_robot: one is played"]

    def test_events_that_are_missing_are_counted(self) -> None:
        first = recorded(move("A", 1.0))
        lost = EventsLost(Moment(99, 0.0, 0.0, 0.0), 7)
        _, servers = again(move("A", 1.0), [*first.events, lost])
        assert servers.remarks[0] == "7 events are missing: what servers did then is not played"

    def test_feedback_that_may_be_thinned_is_said_and_slow_feedback_is_not(self) -> None:
        often = recorded(move("A", 1.0))
        _, servers = again(move("A", 1.0), often.events)
        assert "at most five a second" in servers.remarks[0]
        seldom = [each for each in often.events if not isinstance(each, FeedbackCame)]
        _, servers = again(move("A", 1.0), seldom)
        assert servers.remarks == []


def test_a_goal_that_was_canceled_runs_on_until_it_is_canceled_again() -> None:
    first = recorded(move("A", 1.0, timeout=2.0))
    assert first.outcomes == [("A", Outcome.RESULT_TIMEOUT)]
    runner, _ = again(move("A", 1.0, timeout=6.0), first.events)
    assert (runner.outcomes, round(runner.now)) == (first.outcomes, 6)


def test_a_goal_that_nobody_saw_end_runs_until_it_is_canceled() -> None:
    first = recorded(move("A", 1.0))
    cut = next(
        at
        for at, each in enumerate(first.events)
        if isinstance(each, GoalChanged) and each.state == "DONE"
    )
    runner, _ = again(move("A", 1.0), first.events[:cut])
    assert told(runner.events) == [(Outcome.RESULT_TIMEOUT, End.CANCELED, EMPTY)]


def test_a_tree_of_several_robots_has_a_battery_for_each() -> None:
    network = VirtualNetwork()
    tree = in_sequence(
        MoveRobot("A", 1.0, action_name="left/move_robot"), MoveRobot("B", 1.0, action_name="arm")
    )
    RecordedServers(network, tree, ())
    assert network.topic("/left/battery_state").publishers
    assert len(network.topics) == 1
