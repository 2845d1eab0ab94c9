"""`bt-actions run` until its first goal is at the server, beside a minimal rclpy script."""

from __future__ import annotations

import time
from statistics import median

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row

TIMES = 4
"""Processes in a round, whose median counts."""
ACTION = "work"
RUN = ["-m", "bt_actions.cli", "run", "benchmarks/one_goal.yaml"]
SCRIPT = """
import rclpy
from rclpy.action import ActionClient
from test_msgs.action import Fibonacci

rclpy.init()
node = rclpy.create_node("script")
client = ActionClient(node, Fibonacci, "work")
client.wait_for_server()
sent = client.send_goal_async(Fibonacci.Goal(order=0))
rclpy.spin_until_future_complete(node, sent)
result = sent.result().get_result_async()
rclpy.spin_until_future_complete(node, result)
rclpy.shutdown()
"""


def _to_first_goal(*arguments: str) -> Figures:
    return {"s": median(_once(arguments) for _ in range(TIMES))}


def _once(arguments: tuple[str, ...]) -> float:
    with processes.serving(ACTION) as server:
        began = time.monotonic()
        processes.seconds(arguments)
        if server.journal() != {ACTION: [0]}:
            raise processes.Lost(f"{arguments}: the server ran {server.journal()}")
        return server.first_at - began


FAMILY = Family(
    [
        Row(
            "7",
            "`bt-actions run` to its first goal at the server, which is up",
            "a minimal rclpy script",
            ("run", "s"),
            ("script", "s"),
            1.0,
            "s",
            is_difference=True,
        )
    ],
    {
        "script": lambda: _to_first_goal("-c", SCRIPT),
        "run": lambda: _to_first_goal(*RUN),
    },
)
