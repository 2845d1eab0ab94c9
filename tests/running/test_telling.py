"""What a run tells of itself: when, with which values, and of whose variables."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from typing import Any

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Access, Status
from robot_control_interfaces.action import Gripper as GripperAction
from robot_control_interfaces.action import MoveRobot as Move

from bt_actions import ActionBehaviour, MoveRobot, Retry, Timeouts, TreeError, load_tree
from bt_actions.behaviours.variables import hide, unhide, value_of
from bt_actions.events import (
    AttemptEnded,
    Event,
    FeedbackCame,
    GoalChanged,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    RoundBegan,
    RunBegan,
    ServerSeen,
    StopWanted,
    TreeFinished,
    VariableWritten,
    to_line,
)
from bt_actions.events.snapshot import HIDDEN
from bt_actions.goals.policy import Busy
from bt_actions.story.state import State
from bt_actions.story.why import why
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner
from bt_actions.testing.host import VirtualHost
from bt_actions.utilities.ids import new_id
from tests.support.trees import in_sequence


def events_of(runner: VirtualRunner, kind: type[Any]) -> list[Any]:
    return [event for event in runner.events if isinstance(event, kind)]


def tree(text: str, tmp_path: Any, **inputs: object) -> Behaviour:
    file = tmp_path / "t.yaml"
    file.write_text(text)
    return load_tree(file, inputs)


class Does(Behaviour):
    """Does something in each tick of a number, and succeeds in the last."""

    def __init__(self, name: str, do: Callable[[int], None], ticks: int = 1) -> None:
        super().__init__(name)
        self._do, self._ticks, self._seen = do, ticks, 0

    def update(self) -> Status:
        self._seen += 1
        self._do(self._seen)
        return Status.SUCCESS if self._seen >= self._ticks else Status.RUNNING


class TestGoals:
    def test_are_told_with_what_was_sent_and_what_came_back(self) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(duration=1.0))
        runner = VirtualRunner(MoveRobot("m", 2.0), network)
        runner.run()
        sent = [(e.state, e.goal) for e in events_of(runner, GoalChanged) if e.goal is not None]
        assert sent == [("SENDING", {"distance": 2.0})]
        came = [e.result for e in events_of(runner, GoalChanged) if e.result is not None]
        assert came == [{"final_pose": 0.0, "status": 0, "message": ""}]

    def test_are_told_as_they_were_though_the_message_is_changed_since(self) -> None:
        network, goal = VirtualNetwork(), Move.Goal(distance=2.0)
        ScriptedServer(network, Move, "move_robot", Script(duration=1.0))

        def spoil(message: Any) -> None:
            goal.distance = message.current_pose = 99.0

        leaf = ActionBehaviour("m", Move, "move_robot", goal, on_feedback=spoil)
        runner = VirtualRunner(leaf, network)
        runner.run()
        sent = [e.goal for e in events_of(runner, GoalChanged) if e.goal is not None]
        assert sent == [{"distance": 2.0}]
        assert goal.distance == 99.0
        heard = events_of(runner, FeedbackCame)
        assert heard
        assert {e.feedback["current_pose"] for e in heard} == {0.0}

    def test_tell_feedback_at_most_five_times_a_second_and_the_last_before_the_end(self) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(duration=3.0))
        runner = VirtualRunner(MoveRobot("m", 2.0), network)
        runner.run()
        times = [e.at.steady for e in events_of(runner, FeedbackCame)]
        assert 14 <= len(times) <= 17
        gaps = [after - before for before, after in itertools.pairwise(times[:-1])]
        assert min(gaps) >= 0.2 - 1e-9
        (end,) = [e.at for e in events_of(runner, GoalChanged) if e.state == "DONE"]
        last = events_of(runner, FeedbackCame)[-1]
        assert last.at.number == end.number - 1

    def test_tell_the_verdict_of_expect_with_what_it_saw(self, tmp_path: Any) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, GripperAction, "gripper_control", Script(duration=0.5))
        root = tree(
            "tree: t\ninputs: {least: {type: float64, default: 5.0}}\nroot:\n"
            "  action: Grasp\n  type: robot_control_interfaces/action/Gripper\n"
            "  server: gripper_control\n  goal: {position: 0.0}\n  timeout: 9 s\n"
            "  expect: result.stalled and result.position > $least\n"
            "  retry: {attempts: 2, backoff: 300 ms}\n",
            tmp_path,
        )
        runner = VirtualRunner(root, network)
        runner.run()
        first, second = events_of(runner, AttemptEnded)
        assert (first.attempt, first.outcome) == (1, "UNEXPECTED_RESULT")
        assert first.again_in == pytest.approx(0.3)
        assert (second.attempt, second.again_in) == (2, None)
        assert first.expect == "result.stalled and result.position > $least"
        assert first.seen == {"result.stalled": False, "result.position": 0.0, "$least": 5.0}


def test_a_server_is_told_of_when_it_comes_in_sight_and_when_it_goes() -> None:
    network = VirtualNetwork()
    leaf = MoveRobot("m", 2.0, timeout=Timeouts(server=30.0))
    runner = VirtualRunner(leaf, network)
    runner.start()
    runner.advance(2.0)
    server = ScriptedServer(network, Move, "move_robot", Script(duration=60.0))
    runner.advance(5.0)
    server.die()
    runner.advance(30.0)
    told = [(e.server, e.in_sight) for e in events_of(runner, ServerSeen)]
    assert told == [("/move_robot", True), ("/move_robot", False)]
    assert runner.state.servers["/move_robot"].in_sight is False


class TestNodes:
    def test_are_told_at_each_visit_though_the_status_is_the_same(self, tmp_path: Any) -> None:
        root = tree(
            "tree: t\nroot: {for_each: All, in: [7, 8], as: x, child: {check: $x > 0}}\n", tmp_path
        )
        runner = VirtualRunner(root)
        runner.run()
        check = [e.status for e in events_of(runner, NodeChanged) if e.node == 2]
        assert check == [Status.SUCCESS, Status.SUCCESS]
        rounds = [(e.node, e.number, e.of, e.item) for e in events_of(runner, RoundBegan)]
        assert rounds == [(1, 0, 2, 7), (1, 1, 2, 8)]

    def test_are_told_of_as_they_stop(self) -> None:
        fails = Does("fails", lambda tick: None, ticks=3)
        fails.update = lambda: Status.FAILURE  # type: ignore[method-assign]
        policy = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)
        runs = py_trees.behaviours.Running("runs")
        root = py_trees.composites.Parallel("p", policy, children=[runs, fails])
        runner = VirtualRunner(root)
        runner.run()
        told = [(e.node, e.status) for e in events_of(runner, NodeChanged)]
        assert told == [
            (2, Status.RUNNING),
            (3, Status.FAILURE),
            (1, Status.FAILURE),
            (2, Status.INVALID),
        ]

    def test_that_are_inserted_are_told_of_before_they_do_anything(self) -> None:
        root = in_sequence(name="root")

        def insert(tick: int) -> None:
            if tick == 1:
                root.add_child(Does("new", lambda tick: None))

        root.add_child(Does("inserts", insert, ticks=2))
        runner = VirtualRunner(root)
        runner.run()
        (added,) = events_of(runner, NodesAdded)
        assert [(node.id, node.parent, node.name) for node in added.nodes] == [(3, 1, "new")]
        assert runner.state.path(3) == ("root", "new")
        first = next(e for e in runner.events if isinstance(e, NodeChanged) and e.node == 3)
        assert first.at.number > added.at.number

    def test_that_are_inserted_stand_in_their_place_among_their_siblings(self) -> None:
        root = in_sequence(*(Does(name, lambda tick: None, ticks=30) for name in "bd"), name="root")
        runner = VirtualRunner(root)
        runner.start()
        runner.advance(1.0)
        root.insert_child(Does("a", lambda tick: None), 0)
        root.insert_child(Does("c", lambda tick: None), 2)
        runner.advance(1.0)
        names = [runner.state.nodes[each].node.name for each in runner.state.in_order()]
        assert names == ["root", "a", "b", "c", "d"]

    def test_of_a_tree_that_cannot_be_set_up_are_told_of_all_the_same(self) -> None:
        class Broken(Does):
            def setup(self, **kwargs: Any) -> None:
                raise OSError("no device")

        runner = VirtualRunner(in_sequence(Broken("b", print), name="root"))
        with pytest.raises(Exception, match="no device"):
            runner.run()
        assert isinstance(runner.events[0], RunBegan)
        assert "no device" in runner.state.finished.error  # type: ignore[union-attr]


class TestVariables:
    def test_that_the_tree_writes_are_told_with_who_wrote_them(self, tmp_path: Any) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(duration=0.5))
        root = tree(
            "tree: t\nroot:\n  sequence: S\n  children:\n    - set: {x: 1}\n"
            "    - action: M\n      type: robot_control_interfaces/action/MoveRobot\n"
            "      server: move_robot\n      timeout: 9 s\n      goal: {distance: 1.0}\n"
            "      save: {y: result.final_pose}\n"
            "    - {for_each: F, in: [3], as: z, child: {success: Z}}\n",
            tmp_path,
        )
        runner = VirtualRunner(root, network)
        runner.run()
        names = {number: story.node.name for number, story in runner.state.nodes.items()}
        told = [(e.name, e.value, names[e.node]) for e in events_of(runner, VariableWritten)]
        assert told == [("x", 1, "set x"), ("y", 0.0, "M"), ("z", 3, "F")]

    def test_that_a_client_of_the_blackboard_writes_are_told(self) -> None:
        client = py_trees.blackboard.Client(name="mine")
        client.register_key("speed", access=Access.WRITE)
        before = Blackboard.activity_stream

        def write(tick: int) -> None:
            client.speed = tick

        runner = VirtualRunner(in_sequence(Does("writes", write)))
        runner.run()
        told = [(e.name, e.value, e.node) for e in events_of(runner, VariableWritten)]
        assert told == [("/speed", 1, 2)]
        assert Blackboard.activity_stream is before

    def test_that_change_often_are_told_five_times_a_second_and_the_last_before_a_failure(
        self,
    ) -> None:
        client = py_trees.blackboard.Client(name="mine")
        client.register_key("speed", access=Access.WRITE)

        class Writes(Does):
            def update(self) -> Status:
                self._seen += 1
                client.speed = self._seen // 2
                return Status.FAILURE if self._seen == 34 else Status.RUNNING

        runner = VirtualRunner(in_sequence(Writes("writes", print)), heartbeat=0.05)
        runner.run()
        told = events_of(runner, VariableWritten)
        values = [e.value for e in told]
        assert values[-1] == 17
        assert values == sorted(set(values))
        assert len(values) <= 11
        failed = next(e for e in runner.events if getattr(e, "status", None) is Status.FAILURE)
        assert told[-1].at.number < failed.at.number

    def test_that_a_leaf_writes_while_it_runs_are_told_at_once_and_as_its_own(self) -> None:
        client = py_trees.blackboard.Client(name="mine")
        client.register_key("speed", access=Access.WRITE)

        def write(tick: int) -> None:
            client.speed = tick

        policy = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)
        writer, other = Does("writes", write, ticks=40), Does("other", lambda tick: None, ticks=41)
        root = py_trees.composites.Parallel("p", policy, children=[writer, other])
        runner = VirtualRunner(root, heartbeat=0.1)
        runner.run()
        told = events_of(runner, VariableWritten)
        assert {e.node for e in told} == {2}
        assert len(told) > 10

    def test_of_two_runs_are_not_mixed_up(self) -> None:
        client = py_trees.blackboard.Client(name="mine")
        for key in ("one", "other"):
            client.register_key(key, access=Access.WRITE)
        runners = [
            VirtualRunner(in_sequence(Does("w", lambda _, key=key: setattr(client, key, 1), 2)))
            for key in ("one", "other")
        ]
        for runner in runners:
            runner.start()
        for runner in runners * 3:
            runner.advance(1.0)
        told = [{e.name for e in events_of(runner, VariableWritten)} for runner in runners]
        assert told == [{"/one"}, {"/other"}]


def test_an_observer_that_takes_its_time_is_told_of_once() -> None:
    network = VirtualNetwork()
    runner = VirtualRunner(in_sequence(Does("d", lambda tick: None, ticks=3)), network)

    def slow(event: Event) -> None:
        network.timeline.advance(network.timeline.now + 0.06)

    runner.observe_events(slow)
    runner.run()
    said = [line for line in network.log.lines if "observer" in str(line)]
    assert len(said) == 1


def test_retries_tell_their_rounds(tmp_path: Any) -> None:
    root = tree("tree: t\nroot: {retry: R, attempts: 3, child: {check: 1 > 2}}\n", tmp_path)
    runner = VirtualRunner(root)
    runner.run()
    assert [(e.number, e.of) for e in events_of(runner, RoundBegan)] == [(0, 3), (1, 3), (2, 3)]
    assert Retry(3).attempts == 3


class TestSecrets:
    TREE = """\
tree: t
inputs:
  pin: {type: string, secret: true}
  place: {type: float64, default: 2.0}
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 9 s}
root:
  sequence: S
  children:
    - set: {code: "= $pin + '!'", open: true}
    - log: the code is $(code)
    - for_each: Each
      in: [1, 2]
      as: x
      child:
        subtree: inner.yaml
        with: {word: $code}
    - check: $pin == 'x'
      name: Look
    - move: To it
      goal: {distance: $place}
"""
    INNER = "tree: inner\ninputs: {word: string}\nroot: {log: $word}\n"

    def test_are_in_no_event_nor_is_what_is_computed_from_them(self, tmp_path: Any) -> None:
        (tmp_path / "inner.yaml").write_text(self.INNER)
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(aborts=lambda goal: "no"))
        root = tree(self.TREE.replace("== 'x'", "!= 'x'"), tmp_path, pin="hunter2")
        runner = VirtualRunner(root, network)
        runner.run()
        lines = [to_line(event) for event in runner.events]
        assert not [line for line in lines if "hunter2" in line]
        assert network.log.lines, "a log of the tree's own says what it was told to"
        (began,) = events_of(runner, RunBegan)
        assert began.inputs == {"pin": HIDDEN, "place": 2.0}
        written = {e.name: e.value for e in events_of(runner, VariableWritten)}
        assert written["code"] == written["inner_1/word"] == HIDDEN
        assert written["x"] == 2, "which comes of no secret"
        (goal,) = [e.goal for e in events_of(runner, GoalChanged) if e.goal is not None]
        assert goal == {"distance": 2.0}

    def test_are_in_no_goal_that_is_told_and_no_reason(self, tmp_path: Any) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(aborts=lambda goal: "no"))
        text = (
            "tree: t\ninputs: {far: {type: float64, secret: true}}\nroot:\n  action: To it\n"
            "  type: robot_control_interfaces/action/MoveRobot\n  server: move_robot\n"
            "  timeout: 9 s\n  goal: {distance: = $far + 1}\n  retry: {attempts: 2, backoff: 0 s}\n"
        )
        runner = VirtualRunner(tree(text, tmp_path, far=7776.0), network)
        runner.run()
        lines = [to_line(event) for event in runner.events]
        assert not [line for line in lines if "7777" in line or "7776" in line]
        goals = [e.goal for e in events_of(runner, GoalChanged) if e.goal is not None]
        assert goals == [HIDDEN, HIDDEN]
        told = why(runner.state)
        assert not any("7777" in line for line in told)
        assert told[1].startswith("  attempts 1 to 2: ABORTED: aborted by /move_robot; its result")
        assert "goal" not in told[1], "of a hidden one there is nothing to say"


def test_a_reader_that_comes_late_is_told_of_the_tree_first() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robot", Script(duration=5.0))
    runner = VirtualRunner(in_sequence(MoveRobot("m", 1.0)), network)
    runner.start()
    runner.advance(1.0)
    late: list[Event] = []
    runner.observe_events(late.append)
    runner.advance(20.0)
    assert isinstance(late[0], RunBegan)
    state = State()
    for event in late:
        state.fold(event)
    assert (state.status, state.actions[0].outcome) == (Status.SUCCESS, "SUCCEEDED")


class TestWhatIsOdd:
    def test_a_stop_while_the_tree_is_set_up_is_not_forgotten(self) -> None:
        root = in_sequence(Does("d", lambda tick: None), name="root")
        runner = VirtualRunner(root)
        stream = runner._loop.teller.stream
        root.setup = lambda **_: stream.add(StopWanted, "SIGINT", "interrupted by SIGINT")
        runner.run()
        assert runner.state.stop is not None
        assert isinstance(runner.events[0], StopWanted)

    def test_a_goal_of_an_earlier_run_does_not_stand_for_one_of_the_next(self) -> None:
        network = VirtualNetwork()
        script = Script(duration=lambda goal: goal.distance)
        ScriptedServer(network, Move, "move_robot", script, faults=["move_robot:*:delay_cancel=3"])
        far = iter((50.0, 9.0))
        leaf = ActionBehaviour("m", Move, "move_robot", lambda: {"distance": next(far)})
        leaf.busy = Busy.SHARE
        runner = VirtualRunner(in_sequence(leaf), network)
        runner.start()
        runner.advance(1.0)
        runner._loop.interrupt(runner.now, abandon=True)
        runner.advance(0.1)
        assert runner.run() is Status.SUCCESS
        (action,) = runner.state.actions
        assert (action.visits, action.outcome) == (1, "SUCCEEDED")
        began = [at for at, event in enumerate(runner.events) if isinstance(event, RunBegan)]
        goals = [event.goal_id for event in runner.events if isinstance(event, GoalChanged)]
        later = runner.events[began[1] :]
        assert goals[0] not in [e.goal_id for e in later if isinstance(e, GoalChanged)]

    def test_a_reader_whose_poke_raises_is_let_go_of_and_nobody_else_suffers(self) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(duration=1.0))
        runner = VirtualRunner(MoveRobot("m", 1.0), network)
        runner._loop.teller.stream.reader(poke=lambda: 1 / 0)
        assert runner.run() is Status.SUCCESS

    def test_what_is_pruned_is_told_of_and_let_go_of(self) -> None:
        root = in_sequence(name="root")

        def prune(tick: int) -> None:
            if tick == 1:
                root.remove_child(pruned)

        pruned = Does("pruned", lambda tick: None)
        root.add_children([Does("prunes", prune, ticks=3), pruned])
        runner = VirtualRunner(root)
        runner.run()
        (removed,) = events_of(runner, NodesRemoved)
        assert removed.nodes == (3,)
        assert list(runner.state.nodes) == [1, 2]
        assert pruned not in runner._loop.teller.numbers

    def test_feedback_that_came_too_soon_is_told_when_its_time_has_come(self) -> None:
        network = VirtualNetwork()
        script = Script(duration=60.0)
        faults = ["move_robot:1:stall=0.4"]
        ScriptedServer(network, Move, "move_robot", script, faults=faults)
        runner = VirtualRunner(in_sequence(MoveRobot("m", 1.0)), network, heartbeat=0.1)
        runner.observe_events(lambda event: None)
        runner.start()
        runner.advance(20.0)
        told = events_of(runner, FeedbackCame)
        assert not runner._loop.goals._late
        assert told[-1].at.steady - told[-2].at.steady < 0.5, "though the tree rests for 2 s"

    def test_a_condition_says_what_stood_in_it(self, tmp_path: Any) -> None:
        text = "tree: t\ninputs: {n: {type: int32, default: 2}}\nroot: {check: $n > 3 and 1 < 2}\n"
        runner = VirtualRunner(tree(text, tmp_path))
        runner.run()
        assert any("$n > 3 and 1 < 2 is false: $n is 2" in line for line in why(runner.state))

    def test_what_a_timeout_has_stopped_is_told(self, tmp_path: Any) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(duration=60.0))
        text = (
            "tree: t\nroot:\n  timeout: T\n  after: 2 s\n  child:\n    action: Go\n"
            "    type: robot_control_interfaces/action/MoveRobot\n    server: move_robot\n"
            "    timeout: 90 s\n    goal: {distance: 7.0}\n"
        )
        runner = VirtualRunner(tree(text, tmp_path), network)
        runner.run()
        said = why(runner.state)
        assert "not done within 2 s" in said[1]
        assert said[2].startswith("  it stopped Go: CANCELED: ")
        assert "goal {distance: 7.0}" in said[2]

    def test_a_behaviour_that_raises_is_told_with_its_place(self) -> None:
        def breaks(tick: int) -> None:
            raise ValueError("no camera 3")

        runner = VirtualRunner(in_sequence(Does("Camera", breaks), name="Main"))
        with pytest.raises(TreeError, match=r"^Main / Camera: tick raised ValueError: no camera 3"):
            runner.run()
        (finished,) = events_of(runner, TreeFinished)
        assert finished.culprit == 2
        where, what, place = why(runner.state)
        assert where.endswith("  Main / Camera")
        assert re.fullmatch(
            r"  tick raised ValueError: no camera 3 \(.*test_telling.py:\d+\)", what
        )
        assert place == "  Camera (Does)"

    def test_a_run_that_is_stopped_says_in_what(self) -> None:
        network = VirtualNetwork()
        ScriptedServer(network, Move, "move_robot", Script(duration=60.0))
        runner = VirtualRunner(in_sequence(MoveRobot("m", 7.0), name="root"), network)
        runner.start()
        runner.advance(2.0)
        runner._loop.teller.stream.add(StopWanted, "SIGINT", "interrupted by SIGINT")
        runner.interrupt()
        runner.advance(9.0)
        said = why(runner.state)
        assert said[0] == "stopped while it ran:"
        assert said[1].endswith("  root / m")
        assert said[2] == "  running for 2.0 s"
        assert said[3].startswith("  CANCELED: ")
        assert "goal {distance: 7.0}" in said[3]


class TestStops:
    """Who asked for the end is told before anything is stopped."""

    def stops(self, runner: VirtualRunner) -> list[tuple[str, str]]:
        assert [each.node.name for each in runner.state.stopped] == ["waits"]
        return [(e.who, e.why) for e in runner.events if isinstance(e, StopWanted)]

    @pytest.fixture
    def runner(self) -> VirtualRunner:
        return VirtualRunner(in_sequence(py_trees.behaviours.Running("waits"), name="root"))

    def test_an_interrupt_is_told(self, runner: VirtualRunner) -> None:
        runner.start()
        runner.advance(1.0)
        runner.interrupt()
        runner.advance(1.0)
        assert self.stops(runner) == [("INTERRUPTED", "interrupted")]

    def test_a_timeout_is_told_in_each_run(self, runner: VirtualRunner) -> None:
        for _ in range(2):
            with pytest.raises(TimeoutError):
                runner.run(timeout=2.5)
        assert self.stops(runner) == [("TIMEOUT", "timeout of 2.5 s expired")] * 2

    def test_one_that_somebody_has_told_is_not_told_again(self, runner: VirtualRunner) -> None:
        runner.start()
        runner.advance(1.0)
        runner._loop.teller.stream.add(StopWanted, "SIGINT", "interrupted by SIGINT")
        runner.interrupt()
        runner.advance(1.0)
        assert self.stops(runner) == [("SIGINT", "interrupted by SIGINT")]

    def test_of_a_tree_that_fails_by_itself_there_is_none(self) -> None:
        runner = VirtualRunner(py_trees.behaviours.Failure("fails"))
        runner.run()
        assert runner.state.stop is None


class TestSecretsInWords:
    @pytest.mark.parametrize(
        "node",
        [
            "{timeout: T, after: $pin, child: {wait: 9 s}}",
            "{for_each: F, in: '= [$pin]', as: x, child: {check: $x > 9999}}",
            "{check: $pin > 9999}",
            "{while: $pin > 9999, child: {success: S}}",
            "{set: {code: = $pin + 1}}",
            "{force_success: C, child: {check: $pin > 9999}}",
            "{force_failure: C, child: {log: $(pin)}}",
            "{force_success: C, child: {force_failure: F, child: {log: $(pin)}}}",
            "{force_success: C, child: {if: {check: $pin > 9999}, then: {success: a}}}",
        ],
    )
    def test_no_kind_of_node_tells_one(self, node: str, tmp_path: Any) -> None:
        text = (
            "tree: t\ninputs: {pin: {type: float64, secret: true}}\noutputs: {code: float64}\n"
            f"root: {{sequence: S, children: [{{wait: 1 s}}, {node}]}}\n"
        )
        runner = VirtualRunner(tree(text, tmp_path, pin=0.7776))
        runner.run()
        lines = [to_line(event) for event in runner.events if not isinstance(event, RunBegan)]
        assert not [line for line in lines if "7776" in line]

    def test_the_words_of_an_exception_are_hidden_and_its_place_is_told(self) -> None:
        def raise_it(_tick: int) -> None:
            raise RuntimeError(f"bad {value_of('/pin')}")

        Blackboard.set("/pin", "hunter2")
        hide(["/pin"])
        runner = VirtualRunner(Does("D", raise_it), VirtualNetwork())
        with pytest.raises(TreeError, match="hunter2"):
            runner.run()
        unhide(["/pin"])
        assert not [event for event in runner.events if "hunter2" in to_line(event)]
        (finished,) = events_of(runner, TreeFinished)
        assert re.fullmatch(r"RuntimeError: ••• \(.*test_telling.py:\d+\)", finished.error)

    def test_what_never_read_one_is_told(self, tmp_path: Any) -> None:
        text = (
            "tree: t\ninputs: {pin: {type: string, secret: true}, n: {type: int32, default: 1}}\n"
            "root: {sequence: S, children: [{set: {x: $pin}}, {wait: 1 s}, {check: $n > 3}]}\n"
        )
        runner = VirtualRunner(tree(text, tmp_path, pin="hunter2"))
        runner.run()
        assert any("$n > 3 is false" in line for line in why(runner.state))

    def test_what_a_parent_takes_over_is_hidden_there_too(self, tmp_path: Any) -> None:
        inner = (
            "tree: inner\ninputs: {pin: {type: string, secret: true, default: hunter2}}\n"
            "root: {check: $pin == 'x'}\n"
        )
        (tmp_path / "inner.yaml").write_text(inner)
        runner = VirtualRunner(tree("tree: t\nroot: {subtree: inner.yaml}\n", tmp_path))
        runner.run()
        lines = [to_line(event) for event in runner.events if not isinstance(event, RunBegan)]
        assert not [line for line in lines if "hunter2" in line]


def test_ids_of_runs_differ_in_their_first_letters(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ids of goals begin with what all goals of a machine have in common."""
    monkeypatch.setattr(VirtualHost, "new_goal_id", lambda _: new_id())
    runner = VirtualRunner(Does("D", lambda tick: None), VirtualNetwork())
    runner.run()
    runner.run()
    ids = [event.run_id for event in events_of(runner, RunBegan)]
    assert [len(bytes.fromhex(each)) for each in ids] == [16, 16]
    assert len({each[:8] for each in ids}) == 2
