"""A node that is gone sends nothing any more, whatever a tree that ticks on may want."""

from __future__ import annotations

from typing import Any

import pytest
from py_trees.common import Status
from py_trees.trees import BehaviourTree

from bt_actions import End, MoveRobot, Outcome
from bt_actions.goals.terms import Now, State
from bt_actions.ros.host import host as process
from bt_actions.ros.node_participant import traffic_of
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


def test_a_process_that_ends_begins_nothing_any_more(
    host: Host, name: str, node: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = host.open(name)
    leaf = MoveRobot("m", 0.1, action_name=name)
    tree = BehaviourTree(leaf)
    tree.setup(node=node)
    monkeypatch.setattr(process, "closing", True)
    until(lambda: bool(tree.tick() or leaf.outcome), what="the leaf ends")
    assert (leaf.outcome, leaf.end) == (Outcome.CANCELED, End.NEVER_STARTED)
    assert journal.count("received") == 0
    tree.shutdown()
    host.close_server(name)


def test_a_goal_that_cannot_be_minded_keeps_no_other_from_its_deadline(
    host: Host, name: str, node: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = host.open(name)
    broken = MoveRobot("a", 50.0, action_name=name, busy="share")
    sound = MoveRobot("b", 50.0, action_name=name, busy="share", timeout=0.5)
    leaves = [broken, sound]
    for leaf in leaves:
        leaf.setup(node=node)

    def both_execute() -> bool:
        for leaf in leaves:
            leaf.tick_once()
        return all(leaf.progress().state == "EXECUTING" for leaf in leaves)

    until(both_execute, 20.0)

    def fails(now: Any) -> None:
        raise AssertionError("a mistake")

    (handle,) = broken.open_handles()
    with monkeypatch.context() as patched:
        patched.setattr(handle.goal, "due", fails)
        until(lambda: sound.drained, what="the other's deadline takes effect")
    assert journal.count("canceled") == 1
    for leaf in leaves:
        leaf.stop(Status.INVALID)
    traffic_of(node).drain(broken.open_handles())
    assert journal.count("canceled") == 2
    for leaf in leaves:
        leaf.shutdown()
    host.close_server(name)


def test_a_deadline_that_passes_while_it_is_looked_at_is_judged_at_the_next_look(
    host: Host, name: str, node: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or what has arrived in time, and was not taken in yet, would come too late."""
    host.open(name)
    leaf = MoveRobot("m", 50.0, action_name=name, timeout=30.0)
    leaf.setup(node=node)
    until(lambda: leaf.progress().state == "EXECUTING", 20.0, meanwhile=leaf.tick_once)
    (handle,) = leaf.open_handles()
    node_clock = traffic_of(node).participant
    with process.lock:  # the alarm does not look meanwhile
        now = node_clock.now()
        due = Now(now.steady + 31.0, now.ros + 31.0)
        moments = [now]
        with monkeypatch.context() as patched:
            patched.setattr(node_clock, "now", lambda: moments.pop() if moments else due)
            handle.endpoint.poll(handle)
        assert handle.goal.state is State.EXECUTING
    leaf.stop(Status.INVALID)
    leaf.shutdown()
    host.close_server(name)
