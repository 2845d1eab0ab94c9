"""A node that is gone sends nothing any more, whatever a tree that ticks on may want."""

from __future__ import annotations

from py_trees.trees import BehaviourTree

from bt_actions import End, MoveRobot, Outcome
from tests.support.processes import Host
from tests.support.waiting import until


def test_a_goal_of_a_node_whose_context_has_gone_is_never_sent(
    host: Host, name: str, domain: int
) -> None:
    """As after rclpy's SIGINT handler: the server was there at the last look."""
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
    context.shutdown()
    until(lambda: journal.count("canceled") == 1, what="the goal is canceled by the alarm")
    until(lambda: bool(trees[1].tick() or second.outcome), what="the second leaf ends")
    assert (second.outcome, second.end) == (Outcome.CANCELED, End.NEVER_STARTED)
    assert journal.count("received") == 1
    for tree in trees:
        tree.shutdown()
    host.close_server(name)
