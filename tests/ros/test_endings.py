"""A node that is gone sends nothing any more, whatever a tree that ticks on may want."""

from __future__ import annotations

from typing import Any

import pytest
from py_trees.trees import BehaviourTree

from bt_actions import End, MoveRobot, Outcome
from bt_actions.ros.host import host as process
from tests.support.processes import Host
from tests.support.waiting import until


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ("its context", [("info", "ROS is shut down; canceling its goals")]),
        ("the node", [("warning", "the node is gone; canceling what it left")]),
    ],
)
def test_a_goal_of_a_node_that_has_gone_is_never_sent(
    host: Host, name: str, domain: int, how: str, told: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after rclpy's SIGINT handler: the server was there at the last look."""
    said: list[tuple[str, str]] = []
    for level in ("info", "warning"):
        monkeypatch.setattr(
            process.log, level, lambda text, level=level: said.append((level, text))
        )
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    journal = host.open(name)
    context = Context()
    context.init(domain_id=domain)
    node = Node("ending", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    first, second = (MoveRobot(letter, 5.0, action_name=name) for letter in "ab")
    trees = [BehaviourTree(leaf) for leaf in (first, second)]
    for tree in trees:
        tree.setup(node=node)

    def running() -> bool:
        executor.spin_once(timeout_sec=0.01)
        trees[0].tick()
        return first.progress().state == "EXECUTING"

    until(running, 20.0)
    if how == "the node":
        executor.remove_node(node)
        node.destroy_node()
    else:
        context.shutdown()
    until(lambda: journal.count("canceled") == 1, what="the goal is canceled by the alarm")
    until(lambda: bool(trees[1].tick() or second.outcome), what="the second leaf ends")
    assert (second.outcome, second.end) == (Outcome.CANCELED, End.NEVER_STARTED)
    assert journal.count("received") == 1
    assert [each for each in said if each[1].startswith(name)] == [
        (level, f"{name}: {text}") for level, text in told
    ]
    for tree in trees:
        tree.shutdown()
    context.try_shutdown()
    host.close_server(name)
