"""A tree in the shape of Nav2's, from its XML to its end, against scripted servers."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot

from bt_actions import load_tree
from bt_actions.importing.convert import convert
from bt_actions.importing.mapping import read_map
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner

XML = """
<root BTCPP_format="4"><BehaviorTree ID="Navigate">
  <RecoveryNode number_of_retries="2" name="Navigate">
    <PipelineSequence name="Follow what is planned">
      <RateController hz="1.0"><Plan to="{goal}" path="{path}"/></RateController>
      <Follow path="{path}" error_code_id="{code}"/>
    </PipelineSequence>
    <ReactiveFallback>
      <GoalUpdated/>
      <RoundRobin name="Recover">
        <Sequence><ScriptCondition code="code < 9"/><Clear/></Sequence>
        <Spin/>
      </RoundRobin>
    </ReactiveFallback>
  </RecoveryNode>
</BehaviorTree></root>
"""
MAP = """
actions:
  plan: {type: robot_control_interfaces/action/MoveRobot, server: plan, timeout: 9 s}
  follow: {type: robot_control_interfaces/action/MoveRobot, server: follow, timeout: 60 s}
  clear: {type: robot_control_interfaces/action/MoveRobot, server: clear, timeout: 9 s}
  spin: {type: robot_control_interfaces/action/MoveRobot, server: spin, timeout: 9 s}
nodes:
  Plan:
    plan:
    goal: {distance: $to}
    save: {path: result.final_pose}
    ports: {to: float64, path: float64}
  Follow:
    follow:
    goal: {distance: $path}
    on_change: replace
    save_on_failure: {error_code_id: result.status}
    ports: {path: float64, error_code_id: uint8}
  Clear: {clear: }
  Spin: {spin: }
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "navigate.xml").write_text(XML, encoding="utf-8")
    (tmp_path / "map.yaml").write_text(MAP, encoding="utf-8")
    found = convert([tmp_path / "navigate.xml"], read_map(tmp_path / "map.yaml"))
    for name, text in found.files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path / "Navigate.yaml"


def played(tree: Path, *faults: str) -> tuple[Status | None, Counter[str]]:
    """How a run ends, and how many goals each server got."""
    network = VirtualNetwork()
    seconds = {"plan": 0.1, "follow": 4.5, "clear": 0.5, "spin": 0.5}
    servers = [
        ScriptedServer(
            network,
            MoveRobot,
            name,
            Script(duration=duration),
            faults=[each for each in faults if each.startswith(f"{name}:")],
        )
        for name, duration in seconds.items()
    ]
    runner = VirtualRunner(load_tree(tree, {"goal": 2.0}), network)
    status = runner.run()
    assert runner.unaccounted == []
    assert not any(server.live_goals for server in servers)
    return status, Counter(name for name, _ in runner.outcomes)


def test_it_plans_each_second_while_it_follows(tree: Path) -> None:
    status, goals = played(tree)
    assert status is Status.SUCCESS
    assert goals == {"Plan": 5, "Follow": 1}


def test_it_recovers_and_follows_again(tree: Path) -> None:
    status, goals = played(tree, "follow:1:abort")
    assert status is Status.SUCCESS
    assert goals["Follow"] == 2
    assert (goals["Clear"], goals["Spin"]) == (1, 0)


def test_it_gives_up_after_its_last_attempt(tree: Path) -> None:
    status, goals = played(tree, "follow:1:abort", "follow:2:abort", "follow:3:abort")
    assert status is Status.FAILURE
    assert goals["Follow"] == 3
    assert (goals["Clear"], goals["Spin"]) == (1, 1), "in turn"


def test_a_run_that_is_stopped_while_it_follows_leaves_no_goal_behind(tree: Path) -> None:
    network = VirtualNetwork()
    servers = [
        ScriptedServer(network, MoveRobot, name, Script(duration=duration))
        for name, duration in (("plan", 0.1), ("follow", 60.0))
    ]
    runner = VirtualRunner(load_tree(tree, {"goal": 2.0}), network)
    runner.start()
    runner.advance(10.0)
    runner.interrupt()
    assert runner.run() is Status.INVALID
    assert runner.unaccounted == []
    assert not any(server.live_goals for server in servers)
