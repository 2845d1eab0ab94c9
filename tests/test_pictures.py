"""The pictures in README.md and docs/ show the trees as they are, as render draws them now."""

from __future__ import annotations

import re
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = runpy.run_path(str(ROOT / "scripts" / "pictures.py"))
PICTURES: dict[Path, Path] = SCRIPT["PICTURES"]
SCREENSHOTS: set[Path] = runpy.run_path(str(ROOT / "scripts" / "screenshots.py"))["PICTURES"]
is_fresh: Callable[[Path], bool] = SCRIPT["is_fresh"]
drawn: Callable[[Path], str] = SCRIPT["drawn"]


@pytest.fixture
def picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A picture of a copy of a tree."""
    (tree := tmp_path / "tree.yaml").write_text(
        "tree: t\nroot:\n  sequence: Work\n  children:\n    - success: a\n    - failure: b\n"
    )
    path = tmp_path / "tree.svg"
    names: dict[str, Any] = is_fresh.__globals__  # type: ignore[attr-defined]
    monkeypatch.setitem(names, "ROOT", tmp_path)
    monkeypatch.setitem(PICTURES, path, tree)
    path.write_text(drawn(path))
    return path


@pytest.mark.parametrize("path", sorted(PICTURES), ids=lambda path: path.name)
def test_a_picture_shows_its_tree_as_it_is_drawn_now(path: Path) -> None:
    assert is_fresh(path), f"{path} is stale: run `make docs`"


def test_every_picture_that_a_page_shows_is_made_by_a_script() -> None:
    shown = set()
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
            shown.add((page.parent / target).resolve())
    assert shown == PICTURES.keys() | SCREENSHOTS
    kept = {path for path in (ROOT / "docs" / "images").rglob("*") if path.is_file()}
    assert kept == PICTURES.keys() | SCREENSHOTS


def test_the_screenshots_are_small() -> None:
    assert sum(path.stat().st_size for path in SCREENSHOTS) < 1_500_000
    moving = (ROOT / "docs" / "images" / "page.webp").read_bytes()
    assert moving.count(b"ANMF") > 10


def test_a_picture_stays_fresh_where_the_fonts_are_others(picture: Path) -> None:
    image = picture.read_text()
    moved = re.sub(r'(?<= )(c?[xy]|r[xy])="[^"]*"', r'\1="1.5"', image)
    moved = re.sub(r'points="[^"]*"', 'points="0,0"', moved)
    assert moved != image
    picture.write_text(moved)
    assert is_fresh(picture)


def test_a_picture_is_stale_when_its_tree_changes(picture: Path) -> None:
    tree = PICTURES[picture]
    tree.write_text(tree.read_text().replace("success: a", "success: another"))
    assert not is_fresh(picture)
