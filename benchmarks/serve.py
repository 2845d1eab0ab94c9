"""A gate: an empty tree through RunTree, beside a hand-written Fibonacci action.

    python benchmarks/serve.py [--goals 30] [--rounds 5] [--slack 1.0]

Exits with 1 when the ratio of the round trips (goal, acceptance, result) is above its limit times
the slack. Both servers are processes of their own, `bt-actions serve` and a node as the tutorials
have it; one hand-written client sends to both in turn, one goal after the other. The ratio is of
the medians of a round, and the median over the rounds counts: a machine that is slower for a while
makes both slower. Each round has new servers, because rclpy's clients are slower with each goal
that a server remembers, which would hide what is measured.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import rclpy
from bt_actions_interfaces.action import RunTree
from rclpy.action import ActionClient, ActionServer
from rclpy.action.server import ServerGoalHandle
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

AT_MOST = 2.0
MORE_ROUNDS = 3
"""Times as many rounds where the ratio does not hold."""
WARM = 3
"""Goals that are not counted: the first ones wait for discovery."""
PATIENCE = 30.0
SPACE = f"/benchmark_{os.getpid()}"


def serve_by_hand(space: str) -> None:
    """Serve a Fibonacci action until killed."""
    rclpy.init()
    node = Node("fibonacci", namespace=space)

    def execute(handle: ServerGoalHandle) -> Fibonacci.Result:
        handle.succeed()
        return Fibonacci.Result(sequence=[0, 1])

    ActionServer(node, Fibonacci, "fibonacci", execute)
    print("ready", flush=True)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


def round_trip(executor: Executor, client: ActionClient, goal: object) -> float:
    """Milliseconds from a goal to its result."""
    began = time.perf_counter()
    sent = client.send_goal_async(goal)
    executor.spin_until_future_complete(sent, timeout_sec=PATIENCE)
    ended = sent.result().get_result_async()
    executor.spin_until_future_complete(ended, timeout_sec=PATIENCE)
    took = time.perf_counter() - began
    assert ended.result().status == 4, ended.result()
    return 1e3 * took


def measure(goals: int) -> tuple[float, float]:
    """The medians of one round, in ms: by hand, and RunTree."""
    main = "import sys; from bt_actions.cli import main; sys.exit(main())"
    with tempfile.TemporaryDirectory() as folder, Context() as context:
        (Path(folder) / "empty.yaml").write_text("tree: empty\nroot: {success: }\n")
        trees = [sys.executable, "-c", main, "serve", "--trees", folder, "--namespace", SPACE]
        by_hand = [sys.executable, __file__, "--serve", SPACE]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        servers = [subprocess.Popen(each, **pipes) for each in (by_hand, trees)]
        node = Node("client", namespace=SPACE, context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        try:
            for server in servers:
                assert server.stdout.readline(), f"{server.args} ended"
            sides = (
                (ActionClient(node, Fibonacci, "fibonacci"), Fibonacci.Goal(order=1)),
                (ActionClient(node, RunTree, "run_tree"), RunTree.Goal(tree="empty")),
            )
            for client, _ in sides:
                assert client.wait_for_server(PATIENCE)
            taken = [[round_trip(executor, *side) for side in sides] for _ in range(WARM + goals)]
        finally:
            for server in servers:
                server.terminate()
            for server in servers:
                server.wait(PATIENCE)
    hand, tree = zip(*taken[WARM:], strict=True)
    return median(hand), median(tree)


def ratio(rounds: list[tuple[float, float]]) -> float:
    """RunTree in times of the hand-written action."""
    return median(tree / hand for hand, tree in rounds)


def main() -> int:
    """Measure, print, and judge."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--goals", type=int, default=30)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--slack", type=float, default=1.0)
    parser.add_argument("--serve", metavar="SPACE", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.serve:
        serve_by_hand(args.serve)
        return 0
    for number in (args.rounds, MORE_ROUNDS * args.rounds):
        rounds = [measure(args.goals) for _ in range(number)]
        found = ratio(rounds)
        holds = found <= AT_MOST * args.slack
        for name, side in (("a Fibonacci action by hand", 0), ("an empty tree through RunTree", 1)):
            print(f"{name:58} {median(each[side] for each in rounds):8.2f} ms")
        verdict = "holds" if holds else "DOES NOT HOLD"
        print(f"{'RunTree, in times of the action by hand':58} {found:8.2f}    "
              f"at most {AT_MOST:g}: {verdict}", flush=True)  # fmt: skip
        if holds:
            return 0
    return 1


if __name__ == "__main__":
    sys.exit(main())
