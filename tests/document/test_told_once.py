"""One mistake is told once, also where it spans files."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from bt_actions.document import check_file

MAIN = """
    tree: t
    import: [lib.yaml]
    root:
      sequence: S
      children:
        - move: A
        - check: $battery.percentage > 0.2
        - subtree: inner.yaml
          with: {home: 1.0}
          save: {x: final_pose}
        - check: $x > 1
"""
LIBRARY = """
    actions:
      move: {type: robot_control_interfaces/action/MoveRobot, server: m, timeout: 3 s}
    topics:
      battery: {topic: battery, type: sensor_msgs/msg/BatteryState}
"""
INNER = """
    tree: inner
    inputs: {home: float64}
    outputs: {final_pose: float64}
    root:
      set: {final_pose: $home}
"""


def found(folder: Path, **files: str | bytes) -> list[str]:
    """What is found in a tree of three files, some of them replaced."""
    for name, text in {"main": MAIN, "lib": LIBRARY, "inner": INNER, **files}.items():
        data = text if isinstance(text, bytes) else textwrap.dedent(text).encode()
        (folder / f"{name}.yaml").write_bytes(data)
    return [
        f"{Path(one.file).name}:{one.line} {one.code}" for one in check_file(folder / "main.yaml")
    ]


def test_the_tree_itself_is_clean(tmp_path: Path) -> None:
    assert found(tmp_path) == []


@pytest.mark.parametrize("word", ["inputs", "outputs"])
def test_a_table_that_is_misspelt_in_an_included_tree(tmp_path: Path, word: str) -> None:
    line = 3 if word == "inputs" else 4
    assert found(tmp_path, inner=INNER.replace(word, f"{word}x")) == [f"inner.yaml:{line} BT107"]


@pytest.mark.parametrize("word", ["actions", "topics"])
def test_a_table_that_is_misspelt_in_an_imported_file(tmp_path: Path, word: str) -> None:
    line = 2 if word == "actions" else 4
    assert found(tmp_path, lib=LIBRARY.replace(word, f"{word}x")) == [f"lib.yaml:{line} BT107"]


def test_an_included_file_that_is_no_text_is_told_where_that_stands(tmp_path: Path) -> None:
    assert found(tmp_path, inner=b"tree: inner\nroot: \xff\n") == ["inner.yaml:2 BT101"]


def test_an_imported_file_that_is_no_text_is_told_where_that_stands(tmp_path: Path) -> None:
    assert found(tmp_path, lib=b"actions: \xff\n") == ["lib.yaml:1 BT101"]


def test_an_included_file_that_cannot_be_opened_is_told_where_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "folder.yaml").mkdir()
    main = MAIN.replace("inner.yaml", "folder.yaml")
    assert found(tmp_path, main=main) == ["main.yaml:9 BT209"]


def test_a_file_that_is_no_yaml_is_told_where_that_stands(tmp_path: Path) -> None:
    assert found(tmp_path, lib="actions: [", inner="tree: [") == [
        "lib.yaml:1 BT102",
        "inner.yaml:1 BT102",
    ]
