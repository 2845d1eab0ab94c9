"""The gates in benchmarks/ fail when what they promise does not hold."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
CHECK = runpy.run_path(str(BENCHMARKS / "check.py"))
WITHIN = {"parse": 1.0, "check": 2.9, "load": 5.3, "check_large": 57.0, "times_larger": 10.0}


def rounds(**took: float) -> list[Any]:
    """Two rounds as told, and one in which everything but the parser was slow."""
    usual = {**WITHIN, **took}
    odd = {**usual, "check": 9.0, "load": 30.0, "check_large": 300.0}
    return [CHECK["Round"](**each) for each in (usual, odd, usual)]


def kept(**took: float) -> list[bool]:
    """Which of the promises about parser, build and growth are kept."""
    return [promise.holds(rounds(**took)) for promise in CHECK["PROMISES"]]


def test_what_is_within_its_limits_holds() -> None:
    assert kept() == [True, True, True]


@pytest.mark.parametrize(
    ("took", "holds"),
    [
        ({"parse": 0.9}, [False, True, True]),
        ({"load": 5.9}, [True, False, True]),
        ({"check_large": 60.0}, [True, True, False]),
    ],
)
def test_what_is_beyond_a_limit_does_not(took: dict[str, float], holds: list[bool]) -> None:
    assert kept(**took) == holds


@pytest.mark.parametrize(
    ("parse", "slack", "code"), [(1.0, "1", 0), (0.9, "1", 1), (0.9, "1.25", 0), (0.7, "1.25", 1)]
)
def test_the_gate_fails_with_exit_code_1(
    parse: float,
    slack: str,
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    took = rounds(parse=parse)
    monkeypatch.setitem(CHECK["main"].__globals__, "measure", lambda *_: took)
    monkeypatch.setattr("sys.argv", ["check.py", "--slack", slack])
    assert CHECK["main"]() == code
    assert ("DOES NOT HOLD" in capsys.readouterr().out) is (parse < 1.0)


def test_every_job_is_measured() -> None:
    measured = CHECK["measure"](200, 400, 2)
    assert len(measured) == 2
    for took in measured:
        for seconds in (took.parse, took.check, took.load, took.check_large):
            assert 0.0 < seconds < float("inf")
        assert took.times_larger == 2.0


def test_the_tree_that_is_measured_has_so_many_nodes() -> None:
    written = CHECK["text_of"](1000)
    assert sum(written.count(f"- {kind}: ") for kind in ("move", "check")) == 1000


@pytest.mark.parametrize(
    ("tree", "slack", "code"), [(1.9, "1", 0), (2.1, "1", 1), (2.1, "1.25", 0), (2.6, "1.25", 1)]
)
@pytest.mark.ros
def test_run_tree_costs_twice_as_much_as_an_action_by_hand_at_most(
    tree: float,
    slack: str,
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    serve = runpy.run_path(str(BENCHMARKS / "serve.py"))
    taken = iter([(1.0, tree), (2.0, 90.0), (3.0, 3.0 * tree)] * 4)
    monkeypatch.setitem(serve["main"].__globals__, "measure", lambda goals: next(taken))
    monkeypatch.setattr("sys.argv", ["serve.py", "--rounds", "3", "--slack", slack])
    assert serve["main"]() == code
    assert ("DOES NOT HOLD" in capsys.readouterr().out) is bool(code)
