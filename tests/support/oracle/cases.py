"""What BehaviorTree.CPP and Nav2's control nodes did with random trees of ours: the oracle's cases.

A file of JSON lines, packed by gzip. The first line tells which versions were asked; each other one
is a case: `xml`, the tree; `acts`, for each `Act id` how long each execution runs, in ticks of the
world, and how it ends (the last one again and again); `conds`, for each `Cond id` its answer at
each tick of the world (the last one again and again); `ticks`, how many there are; `dt`, the
milliseconds between two; `halt_after`, the ticks behind which the tree was halted; `init` and, by
tick, `set`, scripts that were run on the root's variables; `mode`, `exact` where a tick of the
world was a single one (else the tree was ticked again at once where a loop had another round).

`result.ticks` has for each tick `s`, how the root stood (R, S, F, K: skipped), and what the actions
did, in order: `before` the tick, by timers; in it, `e`; at its `halt`. `a1+` is started, `a1S` and
`a1F` ended, `a1x` halted. What conditions were asked, and which actions ticked on, is left out.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CASES = Path(__file__).parents[2] / "oracle" / "cases.jsonl.gz"
LATER = "RoundRobinMain"
"""RoundRobin of Nav2's main, in which a success of the last child is a failure.

The importer writes it as RoundRobin of Jazzy, and says so in its report; what its cases do is
counted apart.
"""
TOLD = "+SFx"
"""What of an action is compared."""


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick of the world."""

    status: str
    """Of the root: R, S or F. A root that is skipped has nothing to do: S."""
    events: str
    """What the actions did, in order."""
    halted: str = ""
    """What they did when the tree was halted behind it."""

    def __str__(self) -> str:
        halted = f", halted: {self.halted}" if self.halted else ""
        return f"{self.status} {self.events}{halted}".strip()


@dataclass(frozen=True, slots=True)
class Case:
    """One tree, its world, and what came of it."""

    id: str
    group: str
    kinds: tuple[str, ...]
    xml: str
    acts: dict[str, list[tuple[int, str]]]
    conds: dict[str, str]
    seconds: float
    """Between two ticks."""
    halts: frozenset[int]
    init: str
    scripts: dict[int, str]
    is_exact: bool
    expected: list[Tick]


def read(path: Path = CASES) -> Iterator[Case]:
    """Read the cases of a file."""
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        for line in lines:
            if "meta" not in (told := json.loads(line)):
                yield _case(told)


def _case(told: dict[str, Any]) -> Case:
    return Case(
        id=told["id"],
        group=told["group"],
        kinds=tuple(told["kinds"]),
        xml=told["xml"],
        acts=told.get("acts", {}),
        conds=told.get("conds", {}),
        seconds=told.get("dt", 100) / 1000.0,
        halts=frozenset(told.get("halt_after", ())),
        init=told.get("init", ""),
        scripts={int(tick): script for tick, script in told.get("set", {}).items()},
        is_exact=told.get("mode") == "exact",
        expected=[
            Tick(
                tick["s"].replace("K", "S"),
                _of_actions(f"{tick.get('before', '')} {tick['e']}"),
                _of_actions(tick.get("halt", "")),
            )
            for tick in told["result"]["ticks"]
        ],
    )


def _of_actions(events: str) -> str:
    return " ".join(each for each in events.split() if each[0] == "a" and each[-1] in TOLD)
