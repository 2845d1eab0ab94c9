"""What a run makes of its goals, in virtual time: when it ticks, what it drains, whose they are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from robot_control_interfaces.action import MoveRobot as Move

from bt_actions import End, MoveRobot, Outcome, Retry, Timeouts, TreeError
from bt_actions.events import Event, GoalChanged, TreeFinished
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner
from tests.support.stories import changes_of
from tests.support.trees import Gate, in_sequence, state, together


class TicksItself(MoveRobot):
    def tick(self) -> Iterator[Behaviour]:
        return super().tick()


class Stage:
    """A tree that is run beside a server."""

    def __init__(
        self,
        tree: Behaviour | BehaviourTree,
        *faults: str,
        lasts: float = 9.0,
        heartbeat: float = 0.1,
    ) -> None:
        self.network = VirtualNetwork()
        script = Script(duration=lasts)
        self.server = ScriptedServer(
            self.network, Move, "move_robot", script, faults=[f"*:1:{each}" for each in faults]
        )
        self.runner = VirtualRunner(tree, self.network, heartbeat=heartbeat)
        self.loop = self.runner._loop

    def run_until(self, leaf: MoveRobot, wanted: str) -> None:
        self.runner.start()
        while state(leaf) != wanted:
            assert self.runner.advance(0.05) is None

    @property
    def goals(self) -> list[GoalChanged]:
        return [event for event in self.runner.events if isinstance(event, GoalChanged)]


class TestTicks:
    @pytest.mark.parametrize(
        ("faults", "settings", "status", "by"),
        [
            ([], {}, Status.SUCCESS, 1.3),
            ([], {"timeout": 0.4}, Status.FAILURE, 1.0),
            (["reject"], {"retry": Retry(2, backoff=0.2)}, Status.SUCCESS, 1.6),
        ],
        ids=["an outcome", "a deadline", "a pause before a retry"],
    )
    def test_come_with(self, faults: list[str], settings: Any, status: Status, by: float) -> None:
        tree = BehaviourTree(MoveRobot("m", 1.0, **settings))
        stage = Stage(tree, *faults, lasts=1.0, heartbeat=30.0)
        assert stage.runner.run() is status
        assert stage.runner.now < by
        assert tree.count < 40

    @pytest.mark.parametrize(
        ("leaf", "heartbeat", "ticks"),
        [
            (Gate(), 0.1, range(80, 99)),
            (TicksItself("n", 1.0), 0.1, range(80, 99)),
            (MoveRobot("n", 1.0), 0.1, range(5, 9)),
            (MoveRobot("n", 1.0), 3.0, range(5, 9)),
        ],
    )
    def test_come_at_heartbeats_where_more_than_a_goal_is_waited_for(
        self, leaf: Behaviour, heartbeat: float, ticks: range
    ) -> None:
        tree = BehaviourTree(together(MoveRobot("m", 1.0), leaf))
        runner = Stage(tree, heartbeat=heartbeat).runner
        runner.start()
        runner.advance(8.0)
        assert tree.count in ticks

    def test_come_at_once_where_one_leaf_follows_another(self) -> None:
        leaves = [MoveRobot(f"m{number}", 0.0) for number in range(20)]
        stage = Stage(in_sequence(*leaves), lasts=0.0, heartbeat=5.0)
        assert stage.runner.run() is Status.SUCCESS
        assert stage.runner.now < 5.0
        assert not stage.loop.goals._handles, "what is over is forgotten"

    def test_do_not_come_with_what_neither_a_leaf_nor_anybody_else_acts_on(self) -> None:
        tree = BehaviourTree(in_sequence(*[MoveRobot(f"m{number}", 1.0) for number in range(5)]))
        stage = Stage(tree, lasts=1.0, heartbeat=30.0)
        stage.loop._observers.clear()
        assert stage.runner.run() is Status.SUCCESS
        assert stage.runner.now < 6.0
        assert tree.count == 8, "at each end of a goal, and until the first is sent"


class TestItsEnd:
    def test_out_of_time_it_drains_and_raises_and_may_run_again(self) -> None:
        leaf = MoveRobot("m", 9.0)
        stage = Stage(leaf, lasts=2.0)
        with pytest.raises(TimeoutError, match=r"m did not finish within 1.5 s"):
            stage.runner.run(timeout=1.5)
        assert (leaf.outcome, leaf.end, leaf.status) == (
            Outcome.CANCELED, End.CANCELED, Status.INVALID,
        )  # fmt: skip
        assert stage.server.live_goals == []
        assert stage.runner.run() is Status.SUCCESS

    def test_to_abandon_ends_the_wait_for_a_goal_that_cannot_be_canceled(self) -> None:
        leaf = MoveRobot("m", 9.0, timeout=Timeouts(cancel=30.0))
        stage = Stage(leaf, "reject_cancel")
        stage.run_until(leaf, "EXECUTING")
        stage.runner.interrupt()
        assert stage.runner.advance(3.0) is None
        stage.loop.interrupt(stage.runner.now, abandon=True)
        assert stage.runner.advance(1.0) is Status.INVALID
        assert [report.name for report in stage.runner.unaccounted] == ["m"]
        while stage.network.timeline.advance(20.0):
            pass
        assert stage.runner.unaccounted == [], "its end was heard of since"
        stage.runner.shutdown()
        assert stage.goals[-1].end is End.SUCCEEDED, "and is told"

    def test_is_told_when_all_its_goals_are_drained(self) -> None:
        leaf = MoveRobot("m", 9.0)
        stage = Stage(in_sequence(leaf, name="root"))
        stage.run_until(leaf, "EXECUTING")
        stage.runner.interrupt()
        stage.runner.advance(5.0)
        last = stage.runner.events[-1]
        assert isinstance(last, TreeFinished)
        assert last.status is Status.INVALID
        goal = stage.goals[-1]
        assert (goal.state, goal.outcome, goal.end) == ("DONE", "CANCELED", "CANCELED")
        changes = dict(changes_of(stage.runner.events))
        assert changes == {("root",): Status.INVALID, ("root", "m"): Status.INVALID}

    def test_a_terminate_of_an_action_that_raises_keeps_no_goal_from_its_drain(self) -> None:
        class Careless(MoveRobot):
            def terminate(self, new_status: Status) -> None:
                raise RuntimeError("on purpose in terminate")

        class Breaks(py_trees.behaviours.Running):
            def update(self) -> Status:
                if state(leaf) == "EXECUTING":
                    raise RuntimeError("on purpose in update")
                return Status.RUNNING

        class Tidy(MoveRobot):
            def terminate(self, new_status: Status) -> None:
                tidied.append(self.name)
                super().terminate(new_status)

        tidied: list[str] = []
        leaf, behind = Careless("m", 50.0), Tidy("behind", 50.0, action_name="another")
        stage = Stage(together(Breaks("breaks"), leaf, behind))
        with pytest.raises(TreeError, match="on purpose in update"):
            stage.runner.run()
        assert (leaf.end, stage.server.live_goals) == (End.CANCELED, [])
        assert "behind" in tidied
        assert isinstance(stage.runner.events[-1], TreeFinished)

    @pytest.mark.parametrize("who", ["a terminate()", "an observer"])
    def test_what_ends_the_program_does_so_after_the_drain(self, who: str) -> None:
        class Leaves(py_trees.behaviours.Running):
            def terminate(self, new_status: Status) -> None:
                if who == "a terminate()":
                    raise SystemExit(7)

        def observer(event: Event) -> None:
            if isinstance(event, GoalChanged) and event.state == "EXECUTING":
                stage.runner.interrupt()
                if who == "an observer":
                    raise SystemExit(7)

        leaf = MoveRobot("m", 50.0)
        stage = Stage(together(Leaves("leaves"), leaf))
        stage.runner.observe_events(observer)
        with pytest.raises(SystemExit, match="7"):
            stage.runner.run()
        assert (leaf.end, stage.server.live_goals) == (End.CANCELED, [])


class TestPause:
    def test_no_new_goal_starts_and_running_ones_finish(self) -> None:
        first, second = MoveRobot("first", 1.0), MoveRobot("second", 1.0)
        stage = Stage(in_sequence(first, second), lasts=1.0)
        stage.run_until(first, "EXECUTING")
        stage.loop.pause(True)
        stage.runner.advance(60.0)
        assert [action.node.name for action in stage.runner.state.actions] == ["first"]
        assert stage.goals[-1].outcome is Outcome.SUCCEEDED
        stage.loop.pause(False)
        assert stage.runner.advance(3.0) is Status.SUCCESS

    def test_waiting_for_a_server_is_paused_too_and_a_running_goals_deadline_holds(self) -> None:
        waits = MoveRobot("waits", 0.1, action_name="nobody", timeout=Timeouts(server=2.0))
        runs = MoveRobot("runs", 9.0, timeout=2.0)
        stage = Stage(together(waits, runs))
        stage.run_until(runs, "EXECUTING")
        stage.loop.pause(True)
        stage.runner.advance(60.0)
        assert (waits.outcome, stage.goals[-1].outcome) == (None, Outcome.RESULT_TIMEOUT)
        stage.loop.pause(False)
        assert stage.runner.advance(5.0) is Status.FAILURE

    def test_a_paused_tree_can_be_interrupted(self) -> None:
        leaf = MoveRobot("m", 9.0)
        stage = Stage(leaf)
        stage.run_until(leaf, "EXECUTING")
        stage.loop.pause(True)
        stage.runner.interrupt()
        assert stage.runner.advance(1.0) is Status.INVALID
        assert leaf.end is End.CANCELED


class TestWhoseGoalsTheyAre:
    def test_those_of_a_leaf_that_was_replaced_in_its_tick(self) -> None:
        def replace(tree: Any) -> None:
            if leaf.parent is not None and state(leaf) == "SENDING":
                tree.replace_subtree(leaf.id, py_trees.behaviours.Success("instead"))

        leaf = MoveRobot("m", 9.0)
        tree = BehaviourTree(in_sequence(leaf))
        tree.add_post_tick_handler(replace)
        stage = Stage(tree, "delay_accept=1")
        assert stage.runner.run() is Status.SUCCESS
        assert stage.runner.unaccounted == stage.server.live_goals == []
        assert stage.goals[-1].end is End.CANCELED, "and it was waited for"

    def test_those_of_a_leaf_inside_of_another_behaviour(self) -> None:
        class Wrapper(Behaviour):
            """Ticks a leaf that nobody else knows of."""

            leaf = MoveRobot("m", 9.0, timeout=Timeouts(cancel=0.5))

            def setup(self, **kwargs: Any) -> None:
                self.leaf.setup(**kwargs)

            def update(self) -> Status:
                self.leaf.tick_once()
                return self.leaf.status if state(self.leaf) != "EXECUTING" else Status.SUCCESS

        stage = Stage(Wrapper("wrapper"), "reject_cancel")
        assert stage.runner.run() is Status.SUCCESS
        assert [report.name for report in stage.runner.unaccounted] == ["m"]
