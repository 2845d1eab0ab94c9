"""Measures the sides of a family in turns, A B A B, and makes rows of the figures.

Only what two sides took one after the other is compared: a machine that is slower for a while makes
both slower. A row's value is the median over the rounds. Knows of no ROS.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

Figures = Mapping[str, float]
"""What one process took, by name."""
Round = Mapping[str, Figures]
"""By side."""
Where = tuple[str, str]
"""A side, and the name of its figure."""
TRIES = 3
MANY = 3
"""Rounds for each that is asked for, of a family that is quick and varies."""


@dataclass(frozen=True)
class Row:
    """One promise: what is measured, beside what, and how much it may be."""

    number: str
    work: str
    yardstick: str
    ours: Where
    theirs: Where | None
    """None: ours is the value."""
    at_most: float
    unit: str = "ms"
    """Of the figures; and of the value, unless that is a ratio."""
    is_difference: bool = False
    slack: float = 1.25
    """How many times the limit CI lets pass: its machines are noisy."""

    @property
    def is_ratio(self) -> bool:
        """Whether its value is one of ours to theirs."""
        return self.theirs is not None and not self.is_difference

    def value(self, took: Round) -> float:
        """Return what is compared with the limit."""
        ours = took[self.ours[0]][self.ours[1]]
        if self.theirs is None:
            return ours
        theirs = took[self.theirs[0]][self.theirs[1]]
        return ours - theirs if self.is_difference else ours / theirs


@dataclass(frozen=True)
class Family:
    """Sides that are measured in turns, and the rows that are read off them."""

    rows: Sequence[Row]
    sides: Mapping[str, Callable[[], Figures]]
    times: int = 1
    """Its rounds, for each that is asked for."""


@dataclass(frozen=True)
class Measured:
    """A row, and what each round of its family took."""

    row: Row
    rounds: Sequence[Round]

    @property
    def value(self) -> float:
        """The median over the rounds."""
        return median(map(self.row.value, self.rounds))

    def holds(self, slack: float = 1.0) -> bool:
        """Whether it is within the limit, times `slack`."""
        return self.value <= self.row.at_most * slack

    def cells(self) -> list[str]:
        """Return it as a row of the table."""
        row, values = self.row, [*map(self.row.value, self.rounds)]
        sign, unit = ("+ " if row.is_difference else ""), (" ×" if row.is_ratio else f" {row.unit}")
        value = f"{sign if self.value >= 0.0 else ''}{self.value:.3g}"
        return [
            row.number,
            row.work,
            row.yardstick,
            f"{self._median(row.ours)} {row.unit}",
            f"{self._median(row.theirs)} {row.unit}" if row.theirs else "",
            f"{value}{unit} ({min(values):.3g} to {max(values):.3g})",
            f"≤ {sign}{row.at_most:g}{unit}",
            "holds" if self.holds() else "**missed**",
        ]

    def _median(self, where: Where) -> str:
        shown = median(took[where[0]][where[1]] for took in self.rounds)
        return f"{shown:,.0f}" if shown >= 1000 else f"{shown:.3g}"


HEAD = ["#", "work", "yardstick", "ours", "the yardstick's", "value (spread)", "limit", ""]


def measure(family: Family, rounds: int, say: Callable[[str], None]) -> list[Measured]:
    """Measure so many rounds, times the family's; `say` is told of each."""
    taken: list[Round] = []
    rounds *= family.times
    for number in range(1, rounds + 1):
        taken.append({name: side() for name, side in family.sides.items()})
        values = (f"{row.number}: {row.value(taken[-1]):.3g}" for row in family.rows)
        say(f"round {number} of {rounds}: {', '.join(values)}")
    return [Measured(row, taken) for row in family.rows]


def table(measured: Sequence[Measured]) -> str:
    """Return the rows as a table in Markdown."""
    rows = [HEAD, ["---"] * len(HEAD), *(each.cells() for each in measured)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows)


def hold_within(measure_again: Callable[[], list[Measured]]) -> list[Measured]:
    """Measure until all holds within its slack, three times at most; return what never did."""
    missed: dict[str, Measured] = {}
    for number in range(TRIES):
        now = {each.row.number: each for each in measure_again() if not each.holds(each.row.slack)}
        missed = now if not number else {key: now[key] for key in missed if key in now}
        if not missed:
            break
    return [*missed.values()]
