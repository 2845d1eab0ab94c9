"""Many leaves on one action, beside one that is repeated."""

from __future__ import annotations

import itertools

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from test_msgs.action import Fibonacci

from benchmarks import processes
from benchmarks.harness import MANY, Family, Figures, Row
from benchmarks.wire import Wire
from bt_actions import ActionBehaviour, TreeRunner

LEAVES, TIMES = 31, 5
GOALS = LEAVES * TIMES
ACTION = "work"


def _run(root: Behaviour, times: int) -> Figures:
    wire = Wire()
    repeat = py_trees.decorators.Repeat("again", root, num_success=times)
    with TreeRunner(repeat) as runner:
        assert runner.run(timeout=120.0) is Status.SUCCESS
    return wire.figures(GOALS)


def _leaves(number: int) -> list[ActionBehaviour]:
    orders = itertools.count()
    goal = lambda: {"order": next(orders)}  # noqa: E731
    return [ActionBehaviour(f"leaf {n}", Fibonacci, ACTION, goal) for n in range(number)]


def one() -> Figures:
    """One leaf, repeated."""
    return _run(_leaves(1)[0], GOALS)


def many() -> Figures:
    """Many, in a sequence that is repeated."""
    root = py_trees.composites.Sequence("leaves", memory=True)
    root.add_children(_leaves(LEAVES))
    return _run(root, TIMES)


def _side(name: str) -> Figures:
    return processes.accounted("many_leaves", name, {ACTION: range(GOALS)}, server=(ACTION,))


FAMILY = Family(
    [
        Row(
            "4",
            f"{LEAVES} leaves on one action, an action",
            "one leaf",
            ("many", "an action"),
            ("one", "an action"),
            1.05,
        )
    ],
    {"one": lambda: _side("one"), "many": lambda: _side("many")},
    MANY,
)

if __name__ == "__main__":
    processes.answer({"one": one, "many": many})
