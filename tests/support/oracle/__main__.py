"""How many cases of the oracle agree, by group and kind: python -m tests.support.oracle [FILE].

Behind them stands how many scripts do, of its file of scripts or of `--scripts FILE`. With `--show
KIND`, also the cases of that kind that differ (`any` for all). Fails where fewer agree than `BARS`
says of those that hold nothing refused, and where a case of our own file is not listed and differs,
or is listed and agrees.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.support.oracle import scripts
from tests.support.oracle.cases import CASES, LATER, read
from tests.support.oracle.comparing import difference, listed
from tests.support.oracle.importing import NotYet

BARS = {"once": 0.99, "exact": 0.89}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.support.oracle")
    parser.add_argument("file", nargs="?", type=Path, default=CASES)
    parser.add_argument("--show", metavar="KIND", default="")
    parser.add_argument("--scripts", type=Path, default=scripts.SCRIPTS)
    arguments = parser.parse_args()
    agree, differ, not_yet = Counter[str](), Counter[str](), Counter[str]()
    differing, played = set[str](), set[str]()
    with tempfile.TemporaryDirectory() as directory:
        for case in read(arguments.file):
            mode = "exact" if case.is_exact else "once"
            rows = (f"in all, {mode}", f"{case.group}, {mode}", *case.kinds)
            if LATER in case.kinds:
                rows = (f"{LATER}, as Jazzy's",)
            try:
                found = difference(case, Path(directory))
            except NotYet as missing:
                not_yet[str(missing)] += 1
                continue
            (differ if found else agree).update(rows)
            if LATER not in case.kinds:
                played.add(case.id)
                differing |= {case.id} if found else set()
            if found and arguments.show in ("any", *case.kinds):
                print(case.xml, case.acts, case.conds, found, sep="\n  ")
    for row in sorted(agree | differ, key=lambda row: ("," not in row, row)):
        print(f"{row:28} {agree[row]:6} agree {differ[row]:6} differ")
    told = [scripts.difference(each) for each in scripts.read(arguments.scripts)]
    print(f"{'scripts':28} {told.count(''):6} agree {len(told) - told.count(''):6} differ")
    print(f"refused, or not yet: {not_yet.total()}")
    for why, number in not_yet.most_common():
        print(f"{number:6} {why}")
    surprises = (differing ^ listed().keys()) & played if arguments.file == CASES else set()
    if surprises:
        print(f"not as differences.txt says: {' '.join(sorted(surprises))}")
    rates = {mode: _rate(agree[f"in all, {mode}"], differ[f"in all, {mode}"]) for mode in BARS}
    print(", ".join(f"{mode}: {rate:.2%}" for mode, rate in rates.items()))
    return int(bool(surprises) or any(rates[mode] < bar for mode, bar in BARS.items()))


def _rate(agree: int, differ: int) -> float:
    return agree / (agree + differ) if agree + differ else 1.0


if __name__ == "__main__":
    sys.exit(main())
