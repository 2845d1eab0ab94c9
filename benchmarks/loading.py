"""Trees of 100 to 100,000 nodes: parsed, checked and built, beside PyYAML's C loader alone.

Python's garbage collector is off for both.
"""

from __future__ import annotations

import gc
import math
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from statistics import median

import yaml

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row
from bt_actions.document import load_tree

SIZES = [100, 1_000, 10_000, 100_000]
BLOCK = 50
"""Nodes under one sequence."""
HEAD = """\
tree: large
inputs: {go: {type: float64, default: 1.0}}
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 5 s}
root:
  sequence: All
  children:
"""


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


def _seconds(job: Callable[[], object]) -> float:
    """How long a job takes; what the job before it left behind is cleared away first."""
    gc.collect()
    gc.disable()
    try:
        began = time.perf_counter()
        kept = job()
        took = time.perf_counter() - began
    finally:
        gc.enable()
    del kept
    return took


def both() -> Figures:
    """Each size, in turns."""
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tree.yaml"
        for size in SIZES:
            text = text_of(size)
            path.write_text(text, encoding="utf-8")
            times = max(1, min(20, 10_000 // size))
            took = [
                (_seconds(lambda: yaml.load(text, Loader=yaml.CSafeLoader)),  # noqa: B023
                 _seconds(lambda: load_tree(path)))
                for _ in range(times + 1)
            ]  # fmt: skip
            parsing, loading = zip(*took[1 if times > 1 else 0 :], strict=True)
            figures[f"parse {size}"] = 1e3 * median(parsing)
            figures[f"load {size}"] = 1e3 * median(loading)
    grown = figures[f"load {size}"] / figures[f"load {SIZES[0]}"]
    figures["exponent"] = math.log(grown) / math.log(size / SIZES[0])
    return figures


def memory() -> Figures:
    """What a built tree keeps."""
    size = SIZES[2]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tree.yaml"
        path.write_text(text_of(SIZES[0]), encoding="utf-8")
        load_tree(path)  # what is imported and kept for all trees
        path.write_text(text_of(size), encoding="utf-8")
        tracemalloc.start()
        kept = load_tree(path)
        gc.collect()
        figures = {"kB a node": tracemalloc.get_traced_memory()[0] / 1e3 / size}
        del kept
    return figures


def _row(size: int) -> Row:
    return Row(
        f"11, {size:,}",
        f"load (parse, check, build) of {size:,} nodes",
        "PyYAML's CSafeLoader",
        ("both", f"load {size}"),
        ("both", f"parse {size}"),
        2.0,
    )


FAMILY = Family(
    [
        *map(_row, SIZES),
        Row(
            "11, growth",
            f"the exponent of its growth, from {SIZES[0]} to {SIZES[-1]:,} nodes",
            "",
            ("both", "exponent"),
            None,
            1.02,
            "",
        ),
        Row("11, memory", "what it keeps", "", ("memory", "kB a node"), None, 4.0, "kB a node"),
    ],
    {
        "both": lambda: processes.side("loading", "both"),
        "memory": lambda: processes.side("loading", "memory"),
    },
)

if __name__ == "__main__":
    processes.answer({"both": both, "memory": memory})
