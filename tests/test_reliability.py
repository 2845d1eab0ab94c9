"""docs/reliability.md, which `make chaos` writes: what its rows say, and that none is missing."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from bt_actions.goals.attempts import AttemptRecord
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Outcome, Timeouts
from bt_actions.goals.terms import Now
from tests.support.reliability import (
    Record,
    family,
    first_paragraph,
    names,
    rounded,
    sentence,
    stood,
    write,
)

ROOT = Path(__file__).parents[1]
REPORT = ROOT / "docs" / "reliability.md"
NOW = Now(100.0, 1000.0)


def attempt(outcome: Outcome, end: End) -> AttemptRecord:
    goal = Goal(b"\x01" * 16, "/move", Timeouts(), NOW)
    goal.end = end
    return AttemptRecord(1, outcome, "", 1000.0, 1002.5, None, goal)


SUCCEEDED = attempt(Outcome.SUCCEEDED, End.SUCCEEDED)
CANCELED = attempt(Outcome.CANCELED, End.CANCELED)
LOST = attempt(Outcome.SERVER_LOST, End.SERVER_GONE)


def test_every_scenario_has_its_row_in_the_report() -> None:
    """Run `make chaos` where it has not: its names are those of the tests in tests/scenarios."""
    collect = ["-m", "pytest", "--collect-only", "-q", "-m", "", "tests/scenarios"]
    listed = subprocess.run(
        [sys.executable, *collect], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    found = re.findall(r"^(tests/scenarios/\w+\.py)::(?:\w+::)?(test_.*)$", listed, re.MULTILINE)
    pages = {page: ast.get_docstring(ast.parse((ROOT / page).read_text())) for page, _ in found}
    wanted = [(family(pages[page]), sentence(name)) for page, name in found]
    assert f"\n{len(wanted)} tests collected" in listed
    assert Counter(names(REPORT.read_text(encoding="utf-8"))) == Counter(wanted)


def test_what_a_report_is_about_is_read_back_from_it(tmp_path: Path) -> None:
    path = tmp_path / "report.md"
    rows = [("Signals", "A signal (SIGINT|SIGTERM)"), ("Signals", "Two"), ("A fork", "One")]
    write(path, [Record(*row, did="a | b", verdict="passed") for row in rows])
    assert names(path.read_text(encoding="utf-8")) == rows


def test_a_report_begins_with_what_came_out(tmp_path: Path) -> None:
    path = tmp_path / "report.md"
    unknown = Record("It's a fork", "One", outcome="STALLED, end UNKNOWN", verdict="passed")
    taken = Record("Signals", "Two", shows="accepted; **1 executed twice**", verdict="passed")
    write(path, [unknown, taken, Record("Signals", "Three", verdict="skipped: no network")])
    begins = path.read_text(encoding="utf-8").partition("\n## ")[0]
    assert "3 scenarios: 2 held, 0 did not, 1 were skipped." in begins
    assert "In 1 the end of a goal was not known" in begins
    assert "In 1 a second\nserver" in begins
    assert "| [It's a fork](#its-a-fork) | 1 | 1 |\n| [Signals](#signals) | 2 | 1 |" in begins


@pytest.mark.parametrize(
    ("visits", "told"),
    [
        ([], ""),
        ([[SUCCEEDED]], "SUCCEEDED"),
        ([[LOST]], "SERVER_LOST, end SERVER_GONE"),
        ([[LOST, SUCCEEDED]], "SERVER_LOST, end SERVER_GONE, then SUCCEEDED"),
        ([[LOST, LOST, SUCCEEDED]], "2 × SERVER_LOST, end SERVER_GONE, then SUCCEEDED"),
        ([[CANCELED], [], [SUCCEEDED], [CANCELED]], "2 × CANCELED; SUCCEEDED"),
    ],
    ids=["none", "one", "its end", "tried again", "and again", "several"],
)
def test_an_outcome_that_nobody_tells_is_that_of_the_leaves(
    visits: list[list[AttemptRecord]], told: str
) -> None:
    assert stood(visits) == told
    record = Record("family", "scenario", visits=visits)
    record.read()
    assert record.outcome == told
    said = Record("family", "scenario", visits=visits, outcome="exit code 0")
    said.read()
    assert said.outcome == "exit code 0"


def test_a_time_that_was_allowed_is_told_and_one_beyond_it_fails() -> None:
    record = Record("family", "scenario", verdict="passed")
    record.took(3.2, 5.0)
    assert record.row == "| scenario | – | – | held | about 3 s (allowed: 5 s) |"
    with pytest.raises(AssertionError, match=r"took 5.10 s, allowed are 5 s"):
        record.took(5.1, 5.0)
    assert [rounded(each) for each in (0.9, 1.3, 11.6)] == [
        "under 1 s",
        "about 1.5 s",
        "about 12 s",
    ]


def test_a_docstring_and_a_name_become_text() -> None:
    assert family("The server: killed, or\nnot.") == "The server: killed, or"
    assert first_paragraph("SIGKILL,\n    and more.\n\n    The rest.") == "SIGKILL, and more"
    assert first_paragraph(None) == ""
    assert sentence("test_two_servers[a_b-1]") == "Two servers (a b-1)"
