"""Fifty robots that pick and place: as one tree, as fifty runners, and as hand-written chains."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median

import py_trees
import rclpy
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from test_msgs.action import Fibonacci

from benchmarks import by_hand, processes
from benchmarks.harness import Family, Figures, Row
from bt_actions import ActionBehaviour, TreeRunner

ROBOTS = 50
STEPS = ["gripper", "move", "gripper", "move", "gripper"]
RUNS = 9
"""The first does not count: it waits for discovery."""


def _actions(robot: int) -> list[str]:
    return [f"r{robot}/{step}" for step in STEPS]


def _status(word: str) -> float:
    text = Path("/proc/self/status").read_text(encoding="ascii")
    return float(re.findall(rf"^{word}:\s*(\d+)", text, re.MULTILINE)[0])


def _robot(number: int) -> Behaviour:
    root = py_trees.composites.Sequence(f"robot {number}", memory=True)
    leaves = enumerate(_actions(number))
    root.add_children(
        [ActionBehaviour(name, Fibonacci, name, {"order": at}) for at, name in leaves]
    )
    return root


class _Usage:
    """Memory and threads of this process since it was made."""

    def __init__(self) -> None:
        self._before = _status("VmRSS")

    def figures(self, times: list[float]) -> Figures:
        """Also the milliseconds of a run, the median of those that count."""
        memory = (_status("VmRSS") - self._before) / 1e3 / ROBOTS
        ms = 1e3 * median(times[1:])
        return {"all": ms, "MB a robot": memory, "threads": _status("Threads")}


def _timed(run: Callable[[], None]) -> list[float]:
    times = []
    for _ in range(RUNS):
        began = time.perf_counter()
        run()
        times.append(time.perf_counter() - began)
    return times


def _warm() -> None:
    """Import, and load the middleware, before memory counts."""
    rclpy.init()
    rclpy.create_node("warm").destroy_node()
    rclpy.shutdown()


def hand() -> Figures:
    """A chain of callbacks for each robot, on one node."""
    _warm()
    usage = _Usage()
    with by_hand.spun_node() as node:
        chains = [by_hand.Chain(node, _actions(robot)) for robot in range(ROBOTS)]

        def run() -> None:
            over = threading.Semaphore(0)
            for chain in chains:
                chain.run(range(len(STEPS)), lambda: over.release())
            for _ in chains:
                if not over.acquire(timeout=by_hand.PATIENCE):
                    raise RuntimeError("a goal was lost")

        figures = usage.figures(_timed(run))
        for chain in chains:
            chain.close()
    return figures


def tree() -> Figures:
    """One tree, and one runner."""
    _warm()
    usage = _Usage()
    root = py_trees.composites.Parallel("all", ParallelPolicy.SuccessOnAll(synchronise=True))
    root.add_children(map(_robot, range(ROBOTS)))
    with TreeRunner(root) as runner:
        return usage.figures(_timed(lambda: _succeeds([runner.run(timeout=120.0)])))


def runners() -> Figures:
    """A runner for each robot, with nothing said."""
    _warm()
    usage = _Usage()
    fleet = [TreeRunner(_robot(robot)) for robot in range(ROBOTS)]

    threads = []

    def run() -> None:
        for runner in fleet:
            runner.start()
        threads.append(_status("Threads"))
        _succeeds(runner.wait(120.0) for runner in fleet)

    figures = {**usage.figures(_timed(run)), "threads": max(threads)}
    for runner in fleet:
        runner.shutdown()
    return figures


def _succeeds(statuses: Iterable[Status]) -> None:
    assert {*statuses} == {Status.SUCCESS}


def _side(name: str) -> Figures:
    goals: dict[str, list[int]] = {}
    for _ in range(RUNS):
        for robot in range(ROBOTS):
            for at, action in enumerate(_actions(robot)):
                goals.setdefault(action, []).append(at)
    return processes.accounted("fleet", name, goals, server=[*goals])


_WORK = f"{ROBOTS} robots × pick-and-place"
FAMILY = Family(
    [
        Row(
            "9",
            f"{_WORK} in one tree",
            f"{ROBOTS} hand-written chains",
            ("tree", "all"),
            ("hand", "all"),
            1.15,
        ),
        Row("9, memory", "its memory a robot", "", ("tree", "MB a robot"), None, 1.8, "MB"),
        Row(
            "10",
            f"the same as {ROBOTS} TreeRunners",
            "one tree",
            ("runners", "all"),
            ("tree", "all"),
            1.3,
        ),
        Row("10, memory", "its memory a robot", "", ("runners", "MB a robot"), None, 3.0, "MB"),
        Row(
            "10, threads",
            f"its threads, those of C++ too, with {ROBOTS} to tick on",
            "one tree",
            ("runners", "threads"),
            ("tree", "threads"),
            ROBOTS,
            "threads",
            is_difference=True,
        ),
    ],
    {name: lambda name=name: _side(name) for name in ("hand", "tree", "runners")},
)

if __name__ == "__main__":
    processes.answer({"hand": hand, "tree": tree, "runners": runners})
