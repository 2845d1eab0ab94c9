"""The runner in virtual time: to the end, in steps, interrupted, out of time."""

import math
from pathlib import Path
from typing import Any
from unittest import mock

import py_trees
import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as Move

from bt_actions import MoveRobot, Outcome, Retry, TreeError, load_tree
from bt_actions.events import GoalChanged
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner


def test_it_stands_still_between_two_steps_and_drains_what_is_interrupted() -> None:
    network = VirtualNetwork()
    server = ScriptedServer(network, Move, "move_robot", Script(duration=60.0))
    runner = VirtualRunner(MoveRobot("To the shelf", 5.0), network)
    with pytest.raises(RuntimeError, match=r"start\(\)"):
        runner.advance(10.0)
    runner.start()
    assert runner.advance(10.0) is None
    assert runner.now == 10.0
    assert len(server.live_goals) == 1
    with pytest.raises(RuntimeError, match="is running already"):
        runner.start()
    with pytest.raises(RuntimeError, match="the run goes on"):
        print(runner.unaccounted)
    runner.interrupt()
    with pytest.raises(RuntimeError, match=r"let it end first, with advance\(\)"):
        print(runner.unaccounted)
    assert runner.advance(1.0) is Status.INVALID
    assert runner.unaccounted == []
    assert server.live_goals == []
    assert runner.outcomes == [("To the shelf", Outcome.CANCELED)]
    assert runner.run() is Status.SUCCESS, "it may run again"
    runner.start()
    runner.advance(10.0)
    runner.interrupt()
    assert runner.run() is Status.INVALID, "it ends the run that was begun"
    runner.shutdown()


def test_an_hour_is_too_long_unless_it_is_said(tmp_path: Path) -> None:
    (tmp_path / "waits.yaml").write_text("tree: waits\nroot:\n  wait: 120 min\n")
    runner = VirtualRunner(load_tree(tmp_path / "waits.yaml"))
    with pytest.raises(TimeoutError):
        runner.run()
    assert runner.now == 3600.0
    assert runner.run(timeout=math.inf) is Status.SUCCESS
    assert runner.now == pytest.approx(3600.0 + 7200.0)


def test_a_behaviour_that_raises_fails_the_run() -> None:
    class Broken(py_trees.behaviour.Behaviour):
        def update(self) -> Status:
            raise RuntimeError("a mistake")

    with pytest.raises(TreeError, match=r"Broken.*a mistake"):
        VirtualRunner(Broken("Broken")).run()


def test_an_outcome_is_what_its_leaf_made_of_the_attempt() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robot", faults=["move_robot:1:abort"])
    leaf = MoveRobot("m", 1.0, expect=lambda result: False, retry=Retry(2, outcomes=["ABORTED"]))
    runner = VirtualRunner(leaf, network)
    assert [runner.run(), runner.run()] == [Status.FAILURE] * 2
    expected = [Outcome.ABORTED, Outcome.UNEXPECTED_RESULT, Outcome.UNEXPECTED_RESULT]
    assert [outcome for _, outcome in runner.outcomes] == expected


def test_two_on_one_network_make_goals_of_their_own() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robot")
    runners = [VirtualRunner(MoveRobot("move", 1.0), network, seed=3) for _ in range(2)]
    assert [runner.run() for runner in runners] == [Status.SUCCESS] * 2
    events = [event for runner in runners for event in runner.events]
    assert len({event.goal_id for event in events if isinstance(event, GoalChanged)}) == 2


def test_timers_of_py_trees_read_the_virtual_time_that_they_are_given() -> None:
    network = VirtualNetwork()
    limited = py_trees.decorators.Timeout("Limit", py_trees.behaviours.Running("Runs"), 7.0)
    tree = py_trees.composites.Sequence("Both", memory=True)
    tree.add_children([py_trees.timers.Timer("Waits", 5.0), limited])
    runner = VirtualRunner(tree, network)
    with mock.patch("time.monotonic", network.now), mock.patch("time.time", network.now):
        assert runner.run() is Status.FAILURE
    assert runner.now == pytest.approx(12.0, abs=0.5)


def test_what_is_no_backend_and_what_is_no_network_is_told() -> None:
    network: Any = VirtualNetwork()
    with pytest.raises(TypeError, match=r"give VirtualBackend\(network\)"):
        MoveRobot("move", 1.0).setup(node=network)
    with pytest.raises(TypeError, match="no VirtualNetwork"):
        VirtualRunner(MoveRobot("move", 1.0), ScriptedServer(network, Move, "move_robot"))  # type: ignore[arg-type]


def test_a_failed_assertion_prints_why_the_run_failed() -> None:
    network = VirtualNetwork()
    ScriptedServer(network, Move, "move_robot", faults=["move_robot:1:abort"])
    runner = VirtualRunner(MoveRobot("To the shelf", 2.0), network)
    assert runner.run() is Status.FAILURE
    assert "To the shelf: ABORTED: aborted by /move_robot; goal {distance: 2.0}" in repr(runner)
