"""`save` of four million numbers, beside setting the array itself on the blackboard."""

from __future__ import annotations

import array
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

from py_trees.blackboard import Blackboard
from test_msgs.action import Fibonacci

from benchmarks import processes
from benchmarks.harness import Family, Figures, Row
from bt_actions.document import load_tree

TREE = """
tree: t
outputs: {many: "int32[]"}
root:
  action: Get
  type: test_msgs/action/Fibonacci
  server: get
  save: {many: result.sequence}
"""
TIMES = 200


def _us(job: Callable[[], object]) -> float:
    began = time.perf_counter()
    job()
    return 1e6 * (time.perf_counter() - began)


def both() -> Figures:
    """Both in one process, in turns."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "t.yaml"
        path.write_text(TREE, encoding="utf-8")
        leaf: Any = load_tree(path)
    result = Fibonacci.Result(sequence=array.array("i", [7]) * 4_000_000)

    key, reading = next(iter(leaf.save)), leaf._reading  # noqa: SLF001 - what a success does

    def save() -> None:
        reading.read(result)

    times = [(_us(lambda: Blackboard.set(key, result.sequence)), _us(save)) for _ in range(TIMES)]
    alone, saved = zip(*times, strict=True)
    return {"set": median(alone), "save": median(saved)}


FAMILY = Family(
    [
        Row(
            "13",
            "`save` of 4 million numbers",
            "setting the array itself on the blackboard",
            ("both", "save"),
            ("both", "set"),
            1.2,
            "µs",
        )
    ],
    {"both": lambda: processes.side("saving", "both")},
)

if __name__ == "__main__":
    processes.answer({"both": both})
