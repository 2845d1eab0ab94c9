"""`bt-actions run` until its first goal is at the server, beside a minimal rclpy script.

With the Fast DDS profiles of their own, discovery takes 0.1 to 2.7 s, on either side, which would
be all that is seen. So all of them, but for --sim, have quick_discovery.xml.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from statistics import median
from unittest.mock import patch

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row

TIMES = 4
"""Processes in a round, whose median counts: with five rounds twenty in all."""
ACTION = "work"
QUICK = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).with_name("quick_discovery.xml"))}
RUN = ["-m", "bt_actions.cli", "run"]
SIMULATED = ["run", "trees/pick_and_place.yaml", "--sim", "--speed", "10"]
SCRIPT = """
import time
import rclpy
from rclpy.action import ActionClient
from test_msgs.action import Fibonacci

rclpy.init()
node = rclpy.create_node("script")
client = ActionClient(node, Fibonacci, "work")
time.sleep(WAIT)
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
    with patch.dict(os.environ, QUICK), processes.serving(ACTION) as server:
        began = time.monotonic()
        processes.seconds(arguments)
        if server.journal() != {ACTION: [0]}:
            raise processes.Lost(f"{arguments}: the server ran {server.journal()}")
        return server.first_at - began


def _to_simulated() -> Figures:
    took = (processes.side("first_goal", "simulated", time.monotonic()) for _ in range(TIMES))
    return {"s": median(each["s"] for each in took)}


def simulated(began: float) -> Figures:
    """With servers in this process, until the first goal is handed over."""
    from benchmarks.wire import Wire
    from bt_actions.cli.program import main

    wire = Wire(time.monotonic)
    if code := main(SIMULATED):
        raise processes.Lost(f"{SIMULATED} ended with {code}")
    return {"s": wire.sent[0] - began}


def _row(ours: str, theirs: str, work: str, yardstick: str, at_most: float) -> Row:
    sides = (ours, "s"), (theirs, "s")
    return Row(f"7, {ours}", work, yardstick, *sides, at_most, "s", is_difference=True)


_SCRIPT = "a minimal rclpy script"
FAMILY = Family(
    [
        _row("run", "script", "`bt-actions run` to its first goal at a server", _SCRIPT, 1.1),
        _row("--sim", "script", "the same with `--sim`, where nobody else can be", _SCRIPT, 0.25),
        _row("later", "sleeps", "the same, 1.2 s after it began", f"{_SCRIPT} that sleeps", 0.25),
    ],
    {
        "script": lambda: _to_first_goal("-c", SCRIPT.replace("WAIT", "0.0")),
        "run": lambda: _to_first_goal(*RUN, "benchmarks/one_goal.yaml"),
        "--sim": _to_simulated,
        "sleeps": lambda: _to_first_goal("-c", SCRIPT.replace("WAIT", "1.2")),
        "later": lambda: _to_first_goal(*RUN, "benchmarks/later_goal.yaml"),
    },
)

if __name__ == "__main__":
    processes.answer({"simulated": simulated})
