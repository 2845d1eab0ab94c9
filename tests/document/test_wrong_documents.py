"""Each wrong document of `wrong_documents.txt` is answered at the exact place with the exact words.

A block begins with `## ` and a sentence; the document follows, then one line for each finding:
`>> line:column-end severity[code] message`. Hints are on a line of their own behind `??`. To add
one, write the document and run this file as a script: it writes what is missing, to be reviewed.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import pytest

from bt_actions.document import Finding, check_source, source_of
from bt_actions.document.findings.rules import RULES
from bt_actions.utilities.shorten import MESSAGE

TABLE = Path(__file__).with_name("wrong_documents.txt")


class Case(NamedTuple):
    """A wrong document and what is said about it."""

    title: str
    text: str
    expected: list[str]


def read_table() -> list[Case]:
    """All cases in the order of the file."""
    cases = []
    for block in TABLE.read_text(encoding="utf-8").split("\n## ")[1:]:
        title, _, rest = block.partition("\n")
        lines = rest.rstrip("\n").split("\n")
        text = [line for line in lines if not line.startswith((">> ", "?? "))]
        expected = [line for line in lines if line.startswith((">> ", "?? "))]
        cases.append(Case(title, "\n".join(text).rstrip("\n") + "\n", expected))
    return cases


def said(finding: Finding) -> list[str]:
    """A finding as the table has it."""
    where = f"{finding.line}:{finding.column}-"
    if finding.end_line != finding.line:
        where += f"{finding.end_line}:"
    lines = [f">> {where}{finding.end_column} {finding.severity}[{finding.code}] {finding.message}"]
    if finding.hint:
        lines.append(f"?? {re.sub('looked in .*', 'looked in ...', finding.hint)}")
    if finding.related:
        place = finding.related.place
        lines.append(f"?? {place.line}:{place.column} {finding.related.message}")
    return lines


def findings_of(text: str) -> list[str]:
    """What is said about a document."""
    found = check_source(source_of(text.encode(), "tree.yaml", TABLE.parent / "tree.yaml"))
    return [line for finding in found for line in said(finding)]


CASES = read_table()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)
def test_a_wrong_document_is_answered_with_the_exact_place_and_words(case: Case) -> None:
    assert case.expected, "run this file as a script to fill the table in"
    assert findings_of(case.text) == case.expected


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)
def test_what_is_said_of_a_mistake_is_three_lines_at_most(case: Case) -> None:
    for told in "\n".join(case.expected).split(">> ")[1:]:
        assert len(told) <= MESSAGE, told


def test_the_table_holds_at_least_eighty_documents_each_under_its_own_title() -> None:
    assert len(CASES) >= 80
    assert len({case.title for case in CASES}) == len(CASES)


def test_every_rule_that_a_text_alone_can_break_is_broken_in_the_table() -> None:
    broken = {line.split("[")[1].split("]")[0] for case in CASES for line in case.expected
              if line.startswith(">>")}  # fmt: skip
    need_files = {"BT100", "BT101", "BT105", "BT210"}
    assert set(RULES) - broken <= need_files


if __name__ == "__main__":
    parts = [TABLE.read_text(encoding="utf-8").split("\n## ")[0]]
    for one in CASES:
        lines = one.expected or findings_of(one.text)
        parts.append("\n".join([one.title, one.text.rstrip("\n"), *lines]) + "\n")
    TABLE.write_text("\n## ".join(parts), encoding="utf-8")
