"""Trees in the shape of Nav2's have nothing wrong: its types need not be installed."""

from __future__ import annotations

from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.composites import InTurn, Pipeline, Recover
from bt_actions.document import check_file, load_tree

FOLDER = Path(__file__).with_name("nav2")
TREES = sorted(path for path in FOLDER.glob("*.yaml") if path.stem != "nav2")


@pytest.mark.parametrize("path", TREES, ids=lambda path: path.stem)
def test_nothing_is_said_of_it(path: Path) -> None:
    assert check_file(path, types=False) == []


def test_it_is_made_of_what_it_says() -> None:
    root = load_tree(FOLDER / "navigate_to_pose.yaml", {"goal": {}}, types=False)
    found: dict[str, Behaviour] = {node.name: node for node in root.iterate()}
    assert isinstance(root, Recover)
    assert isinstance(found["Follow what is planned each second"], Pipeline)
    assert isinstance(found["Recovery actions"], InTurn)
    follow = found["The path"]
    assert isinstance(follow, ActionBehaviour)
    assert follow.on_change == "replace"
