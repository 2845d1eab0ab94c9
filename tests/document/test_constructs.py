"""Constructs over actions in virtual time: goals that are stopped end before others begin."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from std_msgs.msg import Bool

from bt_actions.behaviours.composites import If, Recover
from bt_actions.events import GoalChanged
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner

Load = Callable[..., Behaviour]
HEAD = """
tree: t
topics: {near: {topic: near, type: std_msgs/msg/Bool, qos: latched}}
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 30 s}
  lift: {type: robot_control_interfaces/action/MoveRobot, server: lift, timeout: 30 s}
root:
"""


@pytest.fixture
def network() -> VirtualNetwork:
    """A robot and a lift: a goal takes as many seconds as its distance says, and aborts below 0."""
    network = VirtualNetwork()
    for name in ("move_robot", "lift"):
        script = Script(
            duration=lambda goal: abs(goal.distance),
            aborts=lambda goal: "backwards" if goal.distance < 0.0 else None,
        )
        ScriptedServer(network, MoveRobot, name, script, faults=[f"{name}:*:delay_cancel=1"])
    return network


def states(runner: VirtualRunner) -> list[str]:
    """What became of the goals, in order."""
    return [
        f"{runner.state.nodes[event.node].node.name} {event.state}"
        for event in runner.events
        if isinstance(event, GoalChanged) and event.state in ("EXECUTING", "DONE")
    ]


def test_a_tree_recovers_and_tells_its_rounds(load: Load, network: VirtualNetwork) -> None:
    root = load(f"""{HEAD}
  retry: R
  attempts: 3
  child: {{move: Back, goal: {{distance: -1.0}}}}
  recover: {{lift: Up, goal: {{distance: 1.0}}}}
""")
    assert isinstance(root, Recover)
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.FAILURE
    assert [name for name, _ in runner.outcomes] == ["Back", "Up", "Back", "Up", "Back"]
    assert "Back, round 3 of 3 of R" in repr(runner)


def test_the_other_branch_begins_when_the_goal_of_the_first_has_ended(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"""{HEAD}
  if: $near.data
  memory: false
  then: {{move: Slowly, goal: {{distance: 3.0}}}}
  else: {{lift: Up, goal: {{distance: 3.0}}}}
""")
    assert isinstance(root, If)
    network.publish("near", Bool(data=True), latched=True)
    runner = VirtualRunner(root, network)
    runner.start()
    runner.advance(1.0)
    network.publish("near", Bool(data=False), latched=True)
    runner.advance(0.5)
    assert root.feedback_message == "waiting for Slowly to end"
    assert runner.run() is Status.SUCCESS
    assert states(runner) == ["Slowly EXECUTING", "Slowly DONE", "Up EXECUTING", "Up DONE"]


def test_a_condition_waits_for_the_first_message_of_its_topic(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"{HEAD}  if: $near.data\n  then: {{success: A}}\n  else: {{failure: B}}\n")
    publisher = network.publisher(Bool, "near", latched=True)
    runner = VirtualRunner(root, network)
    runner.start()
    assert runner.advance(0.5) is None
    assert root.feedback_message == "waiting for a first message: $near"
    publisher.publish(Bool(data=True))
    assert runner.run() is Status.SUCCESS


def test_a_condition_whose_topic_is_silent_fails_and_chooses_nothing(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(f"{HEAD}  if: $near.data\n  then: {{success: A}}\n  else: {{success: B}}\n")
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.FAILURE
    assert root.feedback_message.startswith("nothing has come on /near yet ($near)")
