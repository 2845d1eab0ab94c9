"""Nothing is said of the right documents of `right_documents.txt`: a checker must not cry wolf.

A block begins with `## ` and a sentence; the document follows.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.document import check_source, source_of

TABLE = Path(__file__).with_name("right_documents.txt")
CASES = [
    block.partition("\n")[::2] for block in TABLE.read_text(encoding="utf-8").split("\n## ")[1:]
]


@pytest.mark.parametrize(("title", "text"), CASES, ids=[title for title, _ in CASES])
def test_nothing_is_said_of_a_right_document(title: str, text: str) -> None:
    assert check_source(source_of(text.encode(), "tree.yaml", TABLE.parent / "tree.yaml")) == []
