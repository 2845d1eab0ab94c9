"""Trees from a text, without a file and without ROS."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.document import load_tree

Load = Callable[..., Behaviour]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Write files and load the first: ``load(text, inputs={...}, other_yaml=text)``."""

    def write_and_load(
        text: str, inputs: dict[str, object] | None = None, **files: str
    ) -> Behaviour:
        for name, content in {"main": text, **files}.items():
            (tmp_path / f"{name}.yaml").write_text(textwrap.dedent(content), encoding="utf-8")
        return load_tree(tmp_path / "main.yaml", inputs)

    return write_and_load


def tick(root: Behaviour, times: int = 50) -> Status:
    """Tick until the tree has ended, or so many times."""
    for _ in range(times):
        root.tick_once()
        if root.status is not Status.RUNNING:
            break
    return root.status
