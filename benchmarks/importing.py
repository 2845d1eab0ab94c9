"""Whole processes: `import bt_actions`, and `check` of a tiny file, beside `import py_trees`."""

from __future__ import annotations

from statistics import median

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row

TIMES = 5
"""Processes in a round, whose median counts."""


def _process(*arguments: str) -> Figures:
    return {"process": 1e3 * median(processes.seconds(arguments) for _ in range(TIMES))}


def _row(part: str, work: str, at_most: float) -> Row:
    where = (part, "process"), ("py_trees", "process")
    return Row(f"12, {part}", work, "`import py_trees`", *where, at_most, is_difference=True)


FAMILY = Family(
    [
        _row("import", "`import bt_actions`, the whole process", 20.0),
        _row("check", "`bt-actions check` of a tiny file, the whole process", 60.0),
    ],
    {
        "py_trees": lambda: _process("-c", "import py_trees"),
        "import": lambda: _process("-c", "import bt_actions"),
        "check": lambda: _process("-m", "bt_actions.cli", "check", "benchmarks/tiny.yaml"),
    },
)
