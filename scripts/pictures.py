"""Draws the pictures in README.md and docs/ with `bt-actions render`'s own functions.

`python scripts/pictures.py` draws them; with `--check` it exits 1, and says so, when one is stale.

Where Graphviz puts things depends on the fonts of the machine, so a picture is not compared byte by
byte: it is fresh when it was made from the dot source that the tree has now (its hash stands in the
picture), and when what it shows, all but coordinates, is what is drawn now.
"""

from __future__ import annotations

import hashlib
import re
import sys
import tempfile
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour

from bt_actions import load_tree
from bt_actions.document.describing import nodes_of
from bt_actions.importing.convert import convert
from bt_actions.render import dot
from bt_actions.render.graphviz import draw

ROOT = Path(__file__).resolve().parent.parent
PICTURES = {
    ROOT / "docs/images/first_tree.svg": ROOT / "examples/first/first.yaml",
    ROOT / "docs/images/leaf_by_leaf.svg": ROOT / "docs/tutorials/leaf_by_leaf.md",
    ROOT / "docs/images/nav2_navigate.svg": ROOT / "tests/nav2/trees/replanning_and_recovery.xml",
    ROOT / "docs/images/own_action.svg": ROOT / "examples/dock/dock.yaml",
    ROOT / "docs/images/pick_and_place.svg": ROOT / "trees/pick_and_place.yaml",
}
"""Each picture, and the file of the tree that it shows."""
STAND_INS = ROOT / "tests/support/stand_ins"

_PLACED = {"cx", "cy", "d", "height", "points", "rx", "ry", "transform", "viewBox", "width"}
_PLACED |= {"x", "y"}


def source(picture: Path) -> str:
    """Return the dot source of a picture. No type is looked up: some are not installed here."""
    shown = PICTURES[picture]
    made = {".md": _there, ".xml": _imported, ".yaml": partial(load_tree, types=False)}
    return dot(nodes_of(made[shown.suffix](shown)))


def _imported(xml: Path) -> Behaviour:
    """Return a tree of Nav2's, as `bt-actions import` writes it."""
    with tempfile.TemporaryDirectory() as folder:
        ((name, text),) = convert([xml]).files.items()
        (tree := Path(folder) / name).write_text(text, encoding="utf-8")
        return load_tree(tree, {"goal": {}}, types=False)


def _there(page: Path) -> Behaviour:
    """Return the tree that the first program of py_trees_ros on a page makes."""
    _, program = page.read_text(encoding="utf-8").split("```python there\n", 1)
    made: dict[str, Any] = {"__name__": page.stem}
    sys.path.append(str(STAND_INS))
    exec(program.partition("rclpy.init()")[0], made)
    sys.path.remove(str(STAND_INS))
    root: Behaviour = made["root"]
    return root


def drawn(picture: Path) -> str:
    """Return a picture, with a note of what it was made from."""
    tree = PICTURES[picture].relative_to(ROOT)
    note = f"<!-- Made by `make docs` from {tree}. Do not edit. dot: {_digest(picture)} -->"
    image = draw(source(picture), "svg").decode()
    return re.sub(r"(?=<svg )", f"{note}\n", image, count=1)


def seen(image: str) -> list[tuple[str, str, tuple[tuple[str, str], ...]]]:
    """Return what an SVG shows: elements with texts and attributes, without coordinates."""
    return [
        (
            element.tag,
            (element.text or "").strip(),
            tuple(sorted(item for item in element.items() if item[0] not in _PLACED)),
        )
        for element in ET.fromstring(image).iter()
    ]


def is_fresh(picture: Path) -> bool:
    """Return whether a picture shows its tree as it is drawn now."""
    if not picture.is_file():
        return False
    image = picture.read_text(encoding="utf-8")
    return f"dot: {_digest(picture)} " in image and seen(image) == seen(drawn(picture))


def _digest(picture: Path) -> str:
    return hashlib.sha256(source(picture).encode()).hexdigest()[:16]


def main() -> int:
    """Draw the pictures, or check them."""
    stale = [picture for picture in PICTURES if not is_fresh(picture)]
    for picture in stale:
        if "--check" in sys.argv[1:]:
            print(f"{picture} is stale: run `make docs`", file=sys.stderr)
        else:
            picture.parent.mkdir(parents=True, exist_ok=True)
            picture.write_text(drawn(picture), encoding="utf-8")
    return 1 if stale and "--check" in sys.argv[1:] else 0


if __name__ == "__main__":
    sys.exit(main())
