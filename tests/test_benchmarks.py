"""What benchmarks/ makes of what was measured; the measuring itself is for `make bench`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.harness import Family, Figures, Measured, Row, hold_within, measure, table
from benchmarks.loading import text_of

RATIO = Row("1", "a goal", "by hand", ("tree", "ms"), ("hand", "ms"), 1.5)
MORE = Row("2", "a start", "by hand", ("tree", "ms"), ("hand", "ms"), 2.0, is_difference=True)
ALONE = Row("3", "memory", "", ("tree", "ms"), None, 3.0, "MB")


def taken(*rounds: tuple[float, float]) -> list[dict[str, Figures]]:
    return [{"tree": {"ms": tree}, "hand": {"ms": hand}} for tree, hand in rounds]


def test_sides_are_measured_in_turns() -> None:
    order: list[str] = []

    def side(name: str) -> Figures:
        order.append(name)
        return {"ms": 1.0}

    sides = {name: lambda name=name: side(name) for name in ("hand", "tree")}
    said: list[str] = []
    [measured] = measure(Family([RATIO], sides, times=2), 3, said.append)
    assert order == ["hand", "tree"] * 6
    assert len(measured.rounds) == len(said) == 6


@pytest.mark.parametrize(("row", "value"), [(RATIO, 2.0), (MORE, 1.0), (ALONE, 4.0)])
def test_a_value_is_the_median_of_what_was_compared_within_a_round(row: Row, value: float) -> None:
    rounds = taken((2.0, 1.0), (4.0, 3.0), (90.0, 2.0), (8.0, 4.0), (2.0, 2.0))
    assert Measured(row, rounds).value == value


def test_what_is_beyond_its_limit_is_shown_as_missed() -> None:
    shown = table([Measured(RATIO, taken((1.4, 1.0))), Measured(MORE, taken((4.5, 2.0)))])
    assert "| 1.4 × (1.4 to 1.4) | ≤ 1.5 × | holds |" in shown
    assert "| + 2.5 ms (2.5 to 2.5) | ≤ + 2 ms | **missed** |" in shown


@pytest.mark.parametrize(
    ("tries", "missed"),
    [([1.8], []), ([1.9, 1.8], []), ([1.9, 1.9, 1.8], []), ([1.9, 1.9, 1.9], ["1"])],
)
def test_only_what_is_beyond_its_limit_and_the_slack_in_each_try_fails(
    tries: list[float], missed: list[str]
) -> None:
    values: Iterator[float] = iter(tries)
    failed = hold_within(lambda: [Measured(RATIO, taken((next(values), 1.0)))])
    assert [each.row.number for each in failed] == missed
    assert next(values, None) is None


def test_the_tree_that_is_loaded_has_so_many_nodes() -> None:
    written = text_of(1000)
    assert sum(written.count(f"- {kind}: ") for kind in ("move", "check")) == 1000
