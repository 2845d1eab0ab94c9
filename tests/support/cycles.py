"""A program that sets up, runs and shuts down again and again. ``python -m … HOW CYCLES``.

Prints a line of JSON with what the process holds after a quarter of the cycles, and after all, and
how much memory each cycle in between has added. Whatever else it prints is a complaint.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import itertools
import json
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from py_trees.common import Status
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from robot_control_interfaces.action import MoveRobot as MoveRobotAction
from std_msgs.msg import String

from bt_actions import MoveRobot, TreeRunner
from bt_actions.simulation import Script, ScriptedServer
from tests.support.trees import started
from tests.support.waiting import until

NAME = "/cycles/move"
OF_THE_PROCESS = {"bt_actions-rediscovery", "bt_actions-alarm"}
"""Threads that are begun when they are needed, and rest a while before they end: one of each."""
ENDS_IN = 10.0
"""Seconds that a thread has to end when it has been told to."""


def patience(cycles: int) -> float:
    """Seconds after which a process that hangs says where, and ends.

    A new participant sends nothing in its first second.
    """
    return 100.0 + 2.0 * cycles


def threads() -> int:
    """How many threads there are, Fast DDS's own too, without those of the process."""
    ours = {thread.name for thread in threading.enumerate()} & OF_THE_PROCESS
    return sum(1 for _ in Path("/proc/self/task").iterdir()) - len(ours)


def held() -> dict[str, float]:
    """What this process holds: threads, open files, memory in MB."""
    gc.collect()
    status = Path("/proc/self/status").read_text()
    resident = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return {
        "threads": threads(),
        "files": sum(1 for _ in Path("/proc/self/fd").iterdir()),
        "memory": int(resident.split()[1]) / 1024.0,
    }


def check(condition: bool, what: str) -> None:
    """Complain and end when it does not hold."""
    if not condition:
        sys.exit(what)


def on_a_node_of_its_own(cycle: int) -> None:
    """Context, node, executor and servers, all made and shut down."""
    leaf = MoveRobot("move", 0.0, action_name=NAME)
    with TreeRunner(leaf, executor="single" if cycle % 2 else "multi") as runner:
        serving = Node("serving", context=runner.node.context)
        server = ScriptedServer(serving, MoveRobotAction, NAME, Script(duration=0.0))

        def close() -> None:
            server.close()
            serving.destroy_node()

        runner.on_close(close)
        runner.executor.add_node(serving)
        check(runner.run(timeout=20.0) is Status.SUCCESS, f"cycle {cycle}: {leaf.outcome}")


def interrupted(cycle: int) -> None:
    """Interrupted before anything has begun; there is no server."""
    leaf = MoveRobot("move", 0.0, action_name=NAME)
    with started(leaf, executor="single" if cycle % 2 else "multi") as runner:
        runner.interrupt()
        check(runner.wait(20.0) is Status.INVALID, f"cycle {cycle}: {leaf.outcome}")


class User:
    """A user's own context, node and executor, in which trees are run."""

    def __init__(self) -> None:
        self.context = Context()
        self.context.init()
        self.node = Node("user", context=self.context)
        self.server = ScriptedServer(self.node, MoveRobotAction, NAME, Script(duration=0.0))
        self.heard = threading.Semaphore(0)
        self.publisher = self.node.create_publisher(String, "chatter", 10)
        self.node.create_subscription(String, "chatter", lambda _: self.heard.release(), 10)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin)
        self.thread.start()

    def cycle(self, cycle: int) -> None:
        """Run a tree here, and see that all is well after it."""
        leaf = MoveRobot("move", 0.0, action_name=NAME)
        with TreeRunner(leaf, node=self.node) as runner:
            check(runner.run(timeout=20.0) is Status.SUCCESS, f"cycle {cycle}: {leaf.outcome}")
        check(self.context.ok(), f"cycle {cycle}: the user's context was shut down")
        self.publisher.publish(String(data="still here?"))
        check(self.heard.acquire(timeout=5.0), f"cycle {cycle}: the user's node hears nothing")

    def close(self) -> None:
        """Shut all down in order."""
        self.server.close()
        self.executor.shutdown()
        self.thread.join()
        self.node.destroy_node()
        self.context.shutdown()


def main() -> None:
    """Run the cycles."""
    how, cycles = sys.argv[1], int(sys.argv[2])
    faulthandler.dump_traceback_later(patience(cycles), exit=True)
    user = User() if how == "user" else None
    alone = interrupted if how == "interrupted" else on_a_node_of_its_own
    one: Callable[[int], None] = user.cycle if user else alone
    warm = None
    memory: list[float] = []
    longest = 0.0
    for cycle in range(1, cycles + 1):
        began = time.monotonic()
        one(cycle)
        longest = max(longest, time.monotonic() - began)
        if cycle >= cycles // 4:
            after = held()
            warm = warm or after
            memory.append(after["memory"])
    assert warm is not None
    most = warm["threads"]
    with contextlib.suppress(AssertionError):  # which is made where this is read
        until(lambda: threads() <= most, ENDS_IN)
    after["threads"] = threads()
    if user:
        user.close()
    grown = [later - sooner for sooner, later in itertools.pairwise(memory)]
    print(json.dumps({"warm": warm, "after": after, "grown": grown, "longest": longest}))


if __name__ == "__main__":
    main()
