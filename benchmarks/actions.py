"""Milliseconds per action: our tree beside hand-written rclpy, in one run, against one server.

    python benchmarks/actions.py [--goals 300] [--rounds 5] [--executor multi|single]

The server (test_msgs/Fibonacci, finished as soon as it is accepted) runs in a process of its own.
Both sides send one goal after the other, each as soon as the result before it is there. Rounds
alternate, and only the ratio of the medians means anything on a busy machine.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import threading
import time

import py_trees
from py_trees.common import Status
from rclpy.action import ActionClient, ActionServer
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

from bt_actions import ActionBehaviour, TreeRunner

NAME = "benchmark"


def serve() -> None:
    """Serve until standard input is closed."""
    context = Context()
    context.init()
    node = Node("benchmark_server", context=context)

    def execute(handle: object) -> Fibonacci.Result:
        handle.succeed()
        return Fibonacci.Result()

    ActionServer(node, Fibonacci, NAME, execute, result_timeout=2)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    print("ready", flush=True)
    sys.stdin.read()
    executor.shutdown()
    spinning.join()
    node.destroy_node()
    context.shutdown()


def by_hand(kind: str, goals: int) -> float:
    """Return the seconds that `goals` goals take with callbacks on rclpy's own client."""
    context = Context()
    context.init()
    node = Node("by_hand", context=context)
    executor = _executor(kind, context)
    executor.add_node(node)
    client = ActionClient(node, Fibonacci, NAME)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    client.wait_for_server()
    finished = threading.Event()
    left = goals

    def send() -> None:
        client.send_goal_async(Fibonacci.Goal(order=1)).add_done_callback(accepted)

    def accepted(future: object) -> None:
        future.result().get_result_async().add_done_callback(done)

    def done(_future: object) -> None:
        nonlocal left
        left -= 1
        send() if left else finished.set()

    began = time.perf_counter()
    send()
    if not finished.wait(60.0):
        raise RuntimeError("hand-written rclpy lost a goal (rclpy #1123)")
    took = time.perf_counter() - began
    executor.shutdown()
    spinning.join()
    client.destroy()
    node.destroy_node()
    context.shutdown()
    return took


def by_tree(kind: str, goals: int) -> float:
    """Return the seconds that as many leaves take in one sequence."""
    root = py_trees.composites.Sequence("goals", memory=True)
    root.add_children(
        [ActionBehaviour(f"goal {n}", Fibonacci, NAME, {"order": 1}) for n in range(goals + 1)]
    )
    began = 0.0

    def first_is_done(event: object) -> None:
        nonlocal began
        if not began and root.children[0].outcome is not None:
            began = time.perf_counter()  # the first goal also waited for discovery

    with TreeRunner(root, executor=kind) as runner:
        runner.observe(first_is_done)
        status = runner.run(timeout=120.0)
        took = time.perf_counter() - began
    if status is not Status.SUCCESS:
        raise RuntimeError(f"the tree ended in {status}: {root.tip().feedback_message}")
    return took


def _executor(kind: str, context: Context) -> SingleThreadedExecutor | MultiThreadedExecutor:
    if kind == "single":
        return SingleThreadedExecutor(context=context)
    return MultiThreadedExecutor(num_threads=2, context=context)


def main() -> None:
    """Run both sides in turns and print a line a round, then the ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--executor", choices=["multi", "single"], default="multi")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    wanted = parser.parse_args()
    if wanted.serve:
        serve()
        return
    command = [sys.executable, __file__, "--serve"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
        server.stdout.readline()
        hand, tree = [], []
        for number in range(1, wanted.rounds + 1):
            hand.append(1e3 * by_hand(wanted.executor, wanted.goals) / wanted.goals)
            tree.append(1e3 * by_tree(wanted.executor, wanted.goals) / wanted.goals)
            print(f"round {number}: by hand {hand[-1]:.2f} ms, tree {tree[-1]:.2f} ms an action")
        server.stdin.close()
    ratio = statistics.median(tree) / statistics.median(hand)
    print(f"{wanted.executor}: tree / by hand = {ratio:.2f}")


if __name__ == "__main__":
    main()
