"""A large tree that is ticked, beside py_trees' own BehaviourTree.tick. No ROS."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from py_trees.trees import BehaviourTree

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row
from bt_actions.running.loop import TickLoop
from bt_actions.testing import VirtualNetwork
from bt_actions.testing.backend import VirtualBackend
from bt_actions.utilities.stepping import Done

LEAVES = 999
TICKS = 50


def _waiting() -> Behaviour:
    """All leaves run, and go on running."""
    root = py_trees.composites.Parallel("all", ParallelPolicy.SuccessOnAll(synchronise=False))
    root.add_children([py_trees.behaviours.Running(f"leaf {n}") for n in range(LEAVES)])
    return root


def _walked() -> Behaviour:
    """Each leaf takes two ticks, one leaf after the other."""
    root = py_trees.composites.Sequence("all", memory=True)
    kind = py_trees.behaviours.TickCounter
    root.add_children([kind(f"leaf {n}", 1, Status.SUCCESS) for n in range(LEAVES)])
    return root


def _ms(job: Callable[[], object]) -> float:
    began = time.perf_counter()
    job()
    return 1e3 * (time.perf_counter() - began)


def yardstick() -> Figures:
    """BehaviourTree.tick."""
    tree = BehaviourTree(_waiting())
    tree.setup()
    first = _ms(tree.tick)
    steady = median(_ms(tree.tick) for _ in range(TICKS))
    walked = BehaviourTree(_walked())
    walked.setup()

    def walk() -> None:
        while walked.root.status is not Status.SUCCESS:
            walked.tick()

    return {"first": first, "steady": steady, "walk": _ms(walk)}


def ours() -> Figures:
    """The steps of a run's loop."""
    loop = _loop(_waiting())
    first = _ms(lambda: loop.step(0.0))
    steady = median(_ms(lambda at=at: loop.step(float(at))) for at in range(1, TICKS + 1))
    walked = _loop(_walked())

    def walk() -> None:
        while not isinstance(walked.step(0.0), Done):
            pass

    return {"first": first, "steady": steady, "walk": _ms(walk)}


def _loop(root: Behaviour) -> TickLoop:
    tree = BehaviourTree(root)
    tree.setup()
    loop = TickLoop(tree, VirtualBackend(VirtualNetwork()), wake=lambda: None)
    loop.begin(0.0)
    return loop


def _row(part: str, work: str, at_most: float) -> Row:
    where = ("ours", part), ("yardstick", part)
    return Row(f"6, {part}", work, "BehaviourTree.tick", *where, at_most)


FAMILY = Family(
    [
        _row("steady", "a tick of 1,000 nodes that all run", 1.02),
        _row("first", "their first tick, setup in a run included", 1.3),
        _row("walk", "999 leaves, one after the other", 0.08),
    ],
    {
        "yardstick": lambda: processes.side("ticking", "yardstick"),
        "ours": lambda: processes.side("ticking", "ours"),
    },
)

if __name__ == "__main__":
    processes.answer({"yardstick": yardstick, "ours": ours})
