"""What it costs to wait for a goal that takes long, with feedback twice a second."""

from __future__ import annotations

import time

from py_trees.common import Status
from test_msgs.action import Fibonacci

from benchmarks import by_hand, processes
from benchmarks.harness import Family, Figures, Row
from benchmarks.wire import Wire
from bt_actions import ActionBehaviour, TreeRunner

SECONDS = 20.0
ACTION = "work"


def _cpu(wire: Wire) -> Figures:
    """Of this whole process, from the sending of the goal to its result."""
    [sent], [taken] = wire.sent, wire.taken
    return {"CPU": taken - sent}


def hand() -> Figures:
    """A node with one client."""
    wire = Wire(time.process_time)
    with by_hand.spun_node() as node:
        chain = by_hand.Chain(node, [ACTION], feedback=lambda message: None)
        chain.run_all([0])
        chain.close()
    return _cpu(wire)


def tree() -> Figures:
    """One leaf."""
    wire = Wire(time.process_time)
    root = ActionBehaviour("goal", Fibonacci, ACTION, {"order": 0})
    with TreeRunner(root) as runner:
        assert runner.run(timeout=60.0) is Status.SUCCESS, root.feedback_message
    return _cpu(wire)


def _side(name: str) -> Figures:
    server = (ACTION, "--feedback", SECONDS)
    return processes.accounted("waiting", name, {ACTION: [0]}, server=server)


FAMILY = Family(
    [
        Row(
            "5",
            f"CPU while waiting {SECONDS:g} s, feedback at 2 Hz",
            "an rclpy node with one ActionClient",
            ("tree", "CPU"),
            ("hand", "CPU"),
            2.0,
            "s",
        )
    ],
    {"hand": lambda: _side("hand"), "tree": lambda: _side("tree")},
)

if __name__ == "__main__":
    processes.answer({"hand": hand, "tree": tree})
