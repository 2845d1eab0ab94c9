"""Trees of BehaviorTree.CPP, imported, do what they did there, tick by tick.

Here a tenth of the cases is played; `make oracle` plays all.
"""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from bt_actions.importing.kinds import KINDS
from tests.support.oracle.cases import CASES, LATER, Case, read
from tests.support.oracle.comparing import difference, listed
from tests.support.oracle.importing import NotYet

SAYABLE = 300
"""How many of each tenth of the cases hold nothing refused, and words that there are."""


def surprises(cases: list[Case], folder: Path) -> tuple[int, list[str]]:
    """How many cases were played, and where one differs that is not listed, or agrees that is."""
    known, found, played = listed(), [], 0
    for case in cases:
        if LATER in case.kinds:
            continue
        try:
            told = difference(case, folder)
        except NotYet:
            continue
        played += 1
        if case.id not in known:
            found += [told] if told else []
        elif not told:
            found.append(f"{case.id} agrees: take it off the list")
    return played, found


def test_a_tenth_of_the_cases_agree_or_are_listed(tmp_path: Path) -> None:
    played, found = surprises(list(read())[::10], tmp_path)
    assert found == []
    assert played >= SAYABLE


def test_a_tree_that_is_imported_wrongly_is_found_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(KINDS, "ReactiveSequence", KINDS["Sequence"])
    reactive = [case for case in read() if case.kinds == ("ReactiveSequence",)]
    assert any(difference(case, tmp_path) for case in reactive[:20])


def test_the_file_of_cases_says_what_was_asked() -> None:
    with gzip.open(CASES, "rt", encoding="utf-8") as lines:
        assert '"behaviortree_cpp":"4.10.0 ' in next(lines)
