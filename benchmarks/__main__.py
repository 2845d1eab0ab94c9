"""Measures all rows, prints them, and writes docs/performance.md.

    python -m benchmarks [--rows 1,3] [--rounds 5] [--short] [--page FILE]

--short measures the rows that CI holds us to, and fails where one is beyond its limit by more than
a quarter (the page: beyond three times its limit) in each of three tries. Without it, what is
missed is shown, and nothing fails.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
from dataclasses import replace
from pathlib import Path

from benchmarks import (
    chain,
    demo,
    first_goal,
    fleet,
    importing,
    loading,
    many_leaves,
    page,
    recording,
    run_tree,
    saving,
    ticking,
    waiting,
)
from benchmarks.harness import MANY, Family, Measured, hold_within, measure, table

FAMILIES = [
    chain.STOCK,
    chain.FORGETFUL,
    many_leaves.FAMILY,
    waiting.FAMILY,
    ticking.FAMILY,
    first_goal.FAMILY,
    demo.FAMILY,
    fleet.FAMILY,
    loading.FAMILY,
    importing.FAMILY,
    saving.FAMILY,
    run_tree.FAMILY,
    recording.CHAINS,
    recording.TICKED,
    page.FAMILY,
]
GATED = {"1", "2", "3", "4", "5", "8", "14", "15", "16", "17", "18", "19"}
COARSE = 3.0
"""Times its limit, from which on CI needs no more than a few rounds of a row."""
PAGE = """\
# How fast it is

Made by `make bench`, which measures all of this in one go; nothing here is written by hand.

Each row has a yardstick that is measured in the same run, in turns with ours, in processes of their
own. The value of a row is the median of {rounds} rounds (rows 1 to 4: of {more}), each of which
compares what was measured one after the other; in brackets are its lowest and its highest. Compare
values, not times: these
belong to the machine ({machine}; load {load} at the beginning).
Every goal of rows 1 to 5, 7 (but with `--sim`), 9 and 10 went to a server in another process, whose
journal showed that each ran once and in its order.

{table}

- An action in a chain is a Fibonacci goal that its server finishes as soon as it is accepted; what
  counts is the time from the first result to the last, taken where both sides meet: at rclpy's C++
  client. So are the moments of row 3; a goal is sent when it is handed to that client.
- Our side of rows 1 to 5 is `ActionBehaviour`s in a tree under `TreeRunner`, with nothing said; the
  other sends each goal in the callback of the result before it.
- In row 7 the server, the script and `bt-actions run`, but not `--sim`, have a Fast DDS profile in
  place of their own (benchmarks/quick_discovery.xml): it announces them every 10 ms for a second,
  then every 50 ms. With their own, discovery takes up to seconds, on either side. The script looks
  for its server four times a second, as rclpy does; that is in its time.
  A new node of ours holds its first goal back for 1.0 s after a server has come in sight, as a
  second server of the name may not be in sight yet; that second is in the first limit of row 7. In
  60 looks on a busy machine at two servers that were up, the second one followed the first within
  10 ms half of the time, after 1.2 s or more in a tenth, and after 2.95 s once.
- Rows 9 and 10 count the median of eight runs, after one that waits for discovery; in that one the
  runners' threads are made, too. A server with stock settings keeps what is over for 15 minutes, so
  that its status messages grow from run to run, which is dearest for the hand-written chains.
- Row 11 cannot be less than 0.45: PyYAML's C parser, which gives us its events, and py_trees' own
  constructors take that much of the yardstick's time. Of 100 nodes, a tenth is what any file takes.
  That is in its growth, too; so is that large trees outgrow the processor's cache, in both.
- In row 15 an action is told in seven events. The recorder and the view leave these events alone
  until the burst is over, or for half a second, and the chain of this row lasts a third of a
  second. A burst that lasts is slowed down: an interpreter does one thing at a time, and the
  recorder needs some 20 µs for an event (1.16 to 1.27 times the time of an action, measured where
  the recorder wrote every 50 ms). A second of work in each action makes of all that 0.02 %.
- Rows 17 to 19 are of the page of `bt-actions view` in headless Chromium: what its scripts take for
  a frame that paints; from an event in the run, through its recorder and the page's server, to the
  task behind the frame that shows the event; and from a press to the task behind the frame.
- In row 20 `bt-actions view` tells a run, while it is recorded, to twenty readers and to one that
  stopped reading, which are a process of their own. Not in CI: three processes on two cores.
- `make bench-short`, which CI calls, measures rows 1 to 5, 8 and 14 to 19, and fails where one is
  beyond its limit by more than a quarter (row 15: by two fifths, beside a chain by hand twice; rows
  16 to 19: three times) in each of three tries.
"""


def _machine() -> str:
    text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    models = [line.split(":", 1)[1].strip() for line in text.splitlines() if "model name" in line]
    cores = len(os.sched_getaffinity(0))
    model = models[0] if models else platform.machine()
    return f"{cores} cores of {model}, Python {platform.python_version()}"


def _wanted(rows: set[str]) -> list[Family]:
    families = []
    for family in FAMILIES:
        kept = [row for row in family.rows if row.number.split(",")[0] in rows]
        sides = {row.ours[0] for row in kept} | {row.theirs[0] for row in kept if row.theirs}
        if kept:
            needed = {name: side for name, side in family.sides.items() if name in sides}
            families.append(replace(family, rows=kept, sides=needed))
    return families


def _measured(families: list[Family], rounds: int) -> list[Measured]:
    found = [each for family in families for each in measure(family, rounds, _say)]
    return sorted(found, key=lambda each: int(each.row.number.split(",")[0]))


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main() -> int:
    """Measure; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--rows", help="their numbers, with commas between; all where left out")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--short", action="store_true", help="what CI holds us to")
    parser.add_argument("--page", type=Path, help="write the table there")
    wanted = parser.parse_args()
    every = {row.number.split(",")[0] for family in FAMILIES for row in family.rows}
    rows = {*wanted.rows.split(",")} if wanted.rows else GATED if wanted.short else every
    load = f"{os.getloadavg()[0]:.1f}"
    if wanted.short:
        left = set(rows)

        def again() -> list[Measured]:
            families = [
                each if min(row.slack for row in each.rows) < COARSE else replace(each, times=1)
                for each in _wanted(left)
            ]
            measured = _measured(families, wanted.rounds)
            print(table(measured), flush=True)
            left.intersection_update(
                each.row.number.split(",")[0] for each in measured if not each.holds(each.row.slack)
            )
            return measured

        missed = hold_within(again)
        for each in missed:
            print(f"row {each.row.number} is beyond its limit: {each.value:.3g}")
        return 1 if missed else 0
    measured = _measured(_wanted(rows), wanted.rounds)
    print(table(measured))
    if wanted.page:
        text = PAGE.format(
            rounds=wanted.rounds,
            more=wanted.rounds * MANY,
            machine=_machine(),
            load=load,
            table=table(measured),
        )
        wanted.page.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
