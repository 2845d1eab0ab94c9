"""docs/python.md says what the docstrings say, of every public name."""

from __future__ import annotations

import runpy
from pathlib import Path

import bt_actions
from bt_actions import testing

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = runpy.run_path(str(ROOT / "scripts" / "python_doc.py"))


def test_the_page_in_docs_is_made_from_the_docstrings_as_they_are() -> None:
    stored = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    assert stored == SCRIPT["page"](), "stale: run `make docs`"


def test_every_public_name_is_on_the_page() -> None:
    named = [name for names in SCRIPT["GROUPS"].values() for name in names]
    assert named == bt_actions.__all__
    assert all(f"### {name}\n" in SCRIPT["page"]() for name in named)


def test_what_is_left_out_is_there_to_be_left_out() -> None:
    for hidden in SCRIPT["BY_OURSELVES"]:
        kind, _, name = hidden.partition(".")
        assert name in vars(getattr(bt_actions, kind, None) or getattr(testing, kind))
