"""A chain of goals without work, each sent as soon as the result before it is there."""

from __future__ import annotations

import py_trees
from py_trees.common import Status
from test_msgs.action import Fibonacci

from benchmarks import by_hand, processes
from benchmarks.harness import MANY, Family, Figures, Row
from benchmarks.wire import Wire
from bt_actions import ActionBehaviour, TreeRunner

GOALS = 151
"""The first is not counted."""
ACTION = "work"
SAME = "hand-written rclpy, MultiThreadedExecutor(4)"


def hand() -> Figures:
    """Callbacks on rclpy's own client."""
    wire = Wire()
    with by_hand.spun_node() as node:
        chain = by_hand.Chain(node, [ACTION])
        chain.run_all(range(GOALS))
        chain.close()
    return wire.figures(GOALS)


def tree() -> Figures:
    """As many leaves in one sequence."""
    wire = Wire()
    root = py_trees.composites.Sequence("goals", memory=True)
    root.add_children(
        [ActionBehaviour(f"goal {n}", Fibonacci, ACTION, {"order": n}) for n in range(GOALS)]
    )
    with TreeRunner(root) as runner:
        assert runner.run(timeout=120.0) is Status.SUCCESS, root.tip().feedback_message
    return wire.figures(GOALS)


def _family(rows: list[Row], *settings: object) -> Family:
    def run(name: str) -> Figures:
        expected = {ACTION: range(GOALS)}
        return processes.accounted("chain", name, expected, server=(ACTION, *settings))

    sides = {name: lambda name=name: run(name) for name in ("hand", "tree")}
    return Family(rows, sides, MANY)


def _row(number: str, work: str, figure: str, at_most: float) -> Row:
    return Row(number, work, SAME, ("tree", figure), ("hand", figure), at_most)


STOCK = _family(
    [
        _row("1", "an action in a chain of 150, server with stock settings", "an action", 0.75),
        _row("3, p50", "result taken to next goal sent", "p50", 1.5),
        _row("3, p99", "result taken to next goal sent", "p99", 1.5),
    ]
)
FORGETFUL = _family(
    [_row("2", "the same, server with `result_timeout` 0.05 s", "an action", 0.95)],
    *("--result-timeout", 0.05),
)

if __name__ == "__main__":
    processes.answer({"hand": hand, "tree": tree})
