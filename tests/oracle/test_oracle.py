"""Trees of BehaviorTree.CPP, said in our language, do what they did there, tick by tick."""

from __future__ import annotations

import gzip
from itertools import islice
from pathlib import Path

import pytest

from tests.support.oracle import writing
from tests.support.oracle.cases import CASES, Case, read
from tests.support.oracle.comparing import difference, listed, sayable

SAYABLE = 1703
"""How many of the 4,000 cases the language can say; grows with each construct."""


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return list(sayable(read()))


def surprises(cases: list[Case], file: Path) -> list[str]:
    """Where a case differs that is not listed, or one agrees that is."""
    known, found = listed(), []
    for case in cases:
        told = difference(case, file)
        if case.id not in known:
            found += [told] if told else []
        elif not told:
            found.append(f"{case.id} agrees: take it off the list")
    return found


def test_so_many_cases_can_be_said(cases: list[Case]) -> None:
    assert len(cases) == SAYABLE


def test_the_first_200_cases_agree_or_are_listed(cases: list[Case], tmp_path: Path) -> None:
    assert surprises(cases[:200], tmp_path / "tree.yaml") == []


@pytest.mark.slow
def test_all_cases_agree_or_are_listed(cases: list[Case], tmp_path: Path) -> None:
    assert surprises(cases, tmp_path / "tree.yaml") == []
    assert listed().keys() <= {case.id for case in cases}


def test_a_tree_that_is_said_wrongly_is_found_out(
    cases: list[Case], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        writing, "KINDS", {**writing.KINDS, "ReactiveSequence": writing.KINDS["Sequence"]}
    )
    reactive = [case for case in cases if case.kinds == ("ReactiveSequence",)]
    found = [difference(case, tmp_path / "tree.yaml") for case in islice(reactive, 20)]
    assert any(found)


def test_the_file_of_cases_says_what_was_asked() -> None:
    with gzip.open(CASES, "rt", encoding="utf-8") as lines:
        assert '"behaviortree_cpp":"4.10.0 ' in next(lines)
