"""A process with Fibonacci servers as rclpy makes them, and a journal of the goals that they ran.

    python -m benchmarks.server NAME... [--result-timeout S] [--feedback S]

A goal is finished as soon as it is accepted; with --feedback after so many seconds, in which it
gives feedback twice a second. A line on standard input is answered by the journal; its end ends it.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from typing import Any

import rclpy
from rclpy.action import ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

HERTZ = 2.0


def main() -> None:
    """Serve."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="+")
    parser.add_argument("--result-timeout", type=float)
    parser.add_argument("--feedback", type=float, default=0.0)
    wanted = parser.parse_args()
    rclpy.init()
    node = Node("benchmark_server")
    journal: dict[str, list[int]] = {name: [] for name in wanted.names}
    first_at: list[float] = []

    def executing(name: str) -> Any:
        def execute(handle: Any) -> Any:
            if not first_at:
                first_at.append(time.monotonic())
            journal[name].append(handle.request.order)
            ends = time.monotonic() + wanted.feedback
            while time.monotonic() < ends:
                time.sleep(1.0 / HERTZ)
                handle.publish_feedback(Fibonacci.Feedback(sequence=[0, 1]))
            handle.succeed()
            return Fibonacci.Result(sequence=[0, 1])

        return execute

    settings: dict[str, Any] = {}
    executor: Executor = SingleThreadedExecutor()
    if wanted.result_timeout is not None:
        settings["result_timeout"] = wanted.result_timeout
    if wanted.feedback:
        settings["callback_group"] = ReentrantCallbackGroup()
        executor = MultiThreadedExecutor(2)
    for name in wanted.names:
        ActionServer(node, Fibonacci, name, executing(name), **settings)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    print("ready", flush=True)
    for _ in sys.stdin:
        print(json.dumps([journal, first_at]), flush=True)
    executor.shutdown()
    spinning.join()
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
