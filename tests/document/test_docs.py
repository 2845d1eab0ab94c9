"""docs/yaml.md and docs/rules.md say what the model says."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = runpy.run_path(str(ROOT / "scripts" / "yaml_doc.py"))


@pytest.mark.parametrize("path", sorted(SCRIPT["PAGES_BY_PATH"]), ids=lambda path: path.name)
def test_the_pages_in_docs_are_made_from_the_model_as_it_is(path: Path) -> None:
    made = SCRIPT["PAGES_BY_PATH"][path]()
    assert path.read_text(encoding="utf-8") == made, "stale: run `python scripts/yaml_doc.py`"
