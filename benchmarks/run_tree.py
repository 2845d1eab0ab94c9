"""An empty tree through RunTree, beside a Fibonacci action: the round trip of a goal.

One hand-written client sends to both in turns, one goal after the other. A round has new servers:
rclpy's clients are slower with each goal that a server remembers.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from bt_actions_interfaces.action import RunTree
from rclpy.action import ActionClient
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row

GOALS, WARM = 30, 3
"""Those that are counted, and those before them, which wait for discovery."""
PATIENCE = 30.0
ACTION = "work"


def both() -> Figures:
    """The client of both."""
    rclpy.init()
    node = Node("client")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    clients = ActionClient(node, Fibonacci, ACTION), ActionClient(node, RunTree, "run_tree")
    for client in clients:
        assert client.wait_for_server(PATIENCE)
    taken = [
        (_round_trip(executor, clients[0], Fibonacci.Goal(order=number)),
         _round_trip(executor, clients[1], RunTree.Goal(tree="empty")))
        for number in range(WARM + GOALS)
    ]  # fmt: skip
    rclpy.shutdown()
    hand, tree = zip(*taken[WARM:], strict=True)
    return {"hand": median(hand), "tree": median(tree)}


def _round_trip(executor: Executor, client: ActionClient, goal: Any) -> float:
    """Milliseconds from a goal to its result."""
    began = time.perf_counter()
    sent = client.send_goal_async(goal)
    executor.spin_until_future_complete(sent, timeout_sec=PATIENCE)
    ended = sent.result().get_result_async()
    executor.spin_until_future_complete(ended, timeout_sec=PATIENCE)
    took = time.perf_counter() - began
    assert ended.result().status == 4, ended.result()
    return 1e3 * took


def _side() -> Figures:
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "empty.yaml"
        tree.write_text("tree: empty\nroot: {success: Nothing to do}\n", encoding="utf-8")
        trees = subprocess.Popen(
            [sys.executable, "-m", "bt_actions.cli", "serve", "--trees", folder],
            env=processes.environment(),
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        try:
            assert trees.stdout is not None
            assert trees.stdout.readline(), "bt-actions serve has ended"
            goals = {ACTION: range(WARM + GOALS)}
            return processes.accounted("run_tree", "both", goals, server=(ACTION,))
        finally:
            trees.terminate()
            trees.wait(PATIENCE)


FAMILY = Family(
    [
        Row(
            "14",
            "an empty tree through RunTree, from goal to result",
            "a Fibonacci action by hand",
            ("both", "tree"),
            ("both", "hand"),
            2.0,
        )
    ],
    {"both": _side},
)

if __name__ == "__main__":
    processes.answer({"both": both})
