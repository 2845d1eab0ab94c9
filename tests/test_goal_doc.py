"""docs/goal.md says what the table says."""

from __future__ import annotations

import runpy
from pathlib import Path

from bt_actions.goals.terms import Event, State

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = runpy.run_path(str(ROOT / "scripts" / "goal_doc.py"))


def test_the_page_in_docs_is_made_from_the_table_as_it_is() -> None:
    stored = (ROOT / "docs" / "goal.md").read_text(encoding="utf-8")
    assert stored == SCRIPT["page"](), "stale: run `python scripts/goal_doc.py`"


def test_every_state_and_event_is_explained() -> None:
    page = SCRIPT["page"]()
    assert all(f"### {state.name}\n" in page for state in State)
    assert all(f"| {event.name} | {event.value} |" in page for event in Event)
