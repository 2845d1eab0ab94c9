"""The runner in virtual time: to the end, in steps, interrupted, out of time."""

import math
from pathlib import Path

import py_trees
import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as Move

from bt_actions import MoveRobot, Outcome, TreeError, load_tree
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner


def test_it_stands_still_between_two_steps_and_drains_what_is_interrupted() -> None:
    network = VirtualNetwork()
    server = ScriptedServer(network, Move, "move_robot", Script(duration=60.0))
    runner = VirtualRunner(MoveRobot("To the shelf", 5.0), network)
    runner.start()
    assert runner.advance(10.0) is None
    assert runner.now == 10.0
    assert len(server.live_goals) == 1
    runner.interrupt()
    assert runner.advance(1.0) is Status.INVALID
    assert server.live_goals == []
    assert runner.outcomes == [("To the shelf", Outcome.CANCELED)]
    assert runner.run() is Status.SUCCESS, "it may run again"
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
