"""A gate: checking and building a large tree, as ratios to parsing its text with PyYAML's C loader.

    python benchmarks/check.py [--nodes 10000] [--large 100000] [--rounds 5] [--slack 1.0]

Exits with 1 when a ratio is above its limit times the slack, which is for machines that others use
at the same time. All jobs run in one process, in turn, round after
round. A ratio is taken within each round, of jobs that ran one after the other, and the median over
the rounds counts: a machine that is slower for a while makes both slower. Python's garbage
collector is off for all of them, the parser's own run too.
"""

from __future__ import annotations

import argparse
import gc
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import yaml

from bt_actions.document import check_file, load_tree

BLOCK = 100
"""Nodes under one sequence."""
MORE_ROUNDS = 3
"""Times as many rounds where a ratio does not hold."""
HEAD = """\
tree: large
inputs: {go: {type: float64, default: 1.0}}
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 5 s}
root:
  sequence: All
  children:
"""


@dataclass(frozen=True)
class Round:
    """How many seconds each job took, one after the other in this order."""

    parse: float
    check: float
    load: float
    """Checks and builds."""
    check_large: float
    times_larger: float
    """Nodes of the large tree, in nodes of the other."""

    @property
    def build(self) -> float:
        return self.load - self.check


@dataclass(frozen=True)
class Promise:
    """A ratio, and what it may be at most."""

    says: str
    of: Callable[[Round], float]
    at_most: float

    def measured(self, rounds: list[Round]) -> float:
        """The median over the rounds."""
        return median(map(self.of, rounds))

    def holds(self, rounds: list[Round], slack: float = 1.0) -> bool:
        return self.measured(rounds) <= self.at_most * slack


PROMISES = [
    Promise("check, in times of the parser alone", lambda took: took.check / took.parse, 3.0),
    Promise("build to py_trees, in times of the check", lambda took: took.build / took.check, 1.0),
    Promise(
        "check of a node of the large tree, in times of one here",
        lambda took: took.check_large / took.check / took.times_larger,
        2.0,
    ),
]


def text_of(nodes: int) -> str:
    """A clean tree of about so many nodes, with goals, results that are saved, and checks."""
    lines = [HEAD]
    for block in range(nodes // BLOCK):
        lines.append(f"    - sequence: Block {block}\n      children:\n")
        for at in range(BLOCK // 2):
            name = f"p{block}_{at}"
            lines.append(
                f"        - move: Go {block} {at}\n"
                f"          goal: {{distance: $go}}\n"
                f"          save: {{{name}: result.final_pose}}\n"
                f"        - check: ${name} > {at}\n"
            )
    return "".join(lines)


def seconds(job: Callable[[], object]) -> float:
    """How long a job takes; what the job before it left behind is cleared away first."""
    gc.collect()
    gc.disable()
    try:
        started = time.perf_counter()
        kept = job()
        took = time.perf_counter() - started
    finally:
        gc.enable()
    del kept
    return took


def measure(nodes: int, large: int, rounds: int) -> list[Round]:
    """So many rounds."""
    with tempfile.TemporaryDirectory() as folder:
        path, large_path = Path(folder) / "tree.yaml", Path(folder) / "large.yaml"
        text = text_of(nodes)
        path.write_text(text, encoding="utf-8")
        large_path.write_text(text_of(large), encoding="utf-8")
        assert check_file(path) == []
        return [
            Round(
                parse=seconds(lambda: yaml.load(text, Loader=yaml.CSafeLoader)),
                check=seconds(lambda: check_file(path)),
                load=seconds(lambda: load_tree(path)),
                check_large=seconds(lambda: check_file(large_path)),
                times_larger=large / nodes,
            )
            for _ in range(rounds)
        ]


def table(rounds: list[Round], nodes: int, large: int) -> list[str]:
    """What was measured, and what it means."""
    jobs = {
        f"parse {nodes:,} nodes": [took.parse for took in rounds],
        f"check {nodes:,} nodes": [took.check for took in rounds],
        f"build {nodes:,} nodes": [took.build for took in rounds],
        f"check {large:,} nodes": [took.check_large for took in rounds],
    }
    lines = [f"{job:58} {median(took):8.3f} s" for job, took in jobs.items()]
    for promise in PROMISES:
        verdict = "holds" if promise.holds(rounds) else "DOES NOT HOLD"
        measured, limit = promise.measured(rounds), promise.at_most
        lines.append(f"{promise.says:58} {measured:8.2f}    at most {limit:g}: {verdict}")
    return lines


def main() -> int:
    """Measure, print, and judge."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--nodes", type=int, default=10_000)
    parser.add_argument("--large", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--slack", type=float, default=1.0)
    args = parser.parse_args()
    for number in (args.rounds, MORE_ROUNDS * args.rounds):
        rounds = measure(args.nodes, args.large, number)
        print("\n".join(table(rounds, args.nodes, args.large)), flush=True)
        if all(promise.holds(rounds, args.slack) for promise in PROMISES):
            return 0
    return 1


if __name__ == "__main__":
    sys.exit(main())
