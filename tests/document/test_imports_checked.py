"""What a tree imports is checked against that tree: its variables, its types, its topics."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions.document import check_file

MOVE = "{{type: robot_control_interfaces/action/MoveRobot, server: m, timeout: 3 s, {}}}"
MAIN = """\
tree: t
import: lib.yaml
inputs: {far: INPUT}
outputs: {p: float64}
topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState}}
root:
  sequence: S
  children:
    - {check: $battery.percentage > 0.2}
    - {gripper: G}
    - {move: A}
    - {set: {p: 1.0}}
actions: {gripper: {type: robot_control_interfaces/action/Gripper, server: g, timeout: 3 s}}
"""


def found(folder: Path, library: str, kind: str = "float64") -> list[str]:
    """What is found in a tree and the library that it imports."""
    (folder / "main.yaml").write_text(MAIN.replace("INPUT", kind))
    (folder / "lib.yaml").write_text(library)
    return [
        f"{Path(one.file).name}:{one.line} {one.code} {one.message}"
        for one in check_file(folder / "main.yaml")
        if one.code != "BT308"
    ]


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ("expect: result.final_pose > $least", "BT202 there is no variable $least"),
        ("retry: {attempts: 2, when: $most > 1}", "BT202 there is no variable $most"),
        ("save: {q: $there}", "BT202 there is no variable $there"),
        ("goal: {distance: $far}", "BT204 a float64 is needed, and $far is a string"),
        ("expect: result.final_pose > $far",
         "BT206 a float64 is never compared with a string"),
        ("save: {p: result.message}", "BT204 'p' is a float64, and this is a string"),
        ("save: {battery: result.final_pose}",
         "BT204 'battery' is a topic: nothing can be written to it"),
    ],
)  # fmt: skip
def test_an_imported_action_that_does_not_fit_the_tree_is_told_at_the_import(
    tmp_path: Path, settings: str, expected: str
) -> None:
    library = f"actions:\n  move: {MOVE.format(settings)}\n"
    code, message = expected.split(" ", 1)
    told = f"main.yaml:2 {code} the imported action 'move': {message}"
    assert found(tmp_path, library, "string") == [told]


def test_it_says_where_the_action_was_written(tmp_path: Path) -> None:
    found(tmp_path, f"actions:\n  move: {MOVE.format('expect: $least > 1')}\n")
    one = check_file(tmp_path / "main.yaml")[0]
    assert one.related
    assert (Path(one.related.place.file).name, one.related.place.line) == ("lib.yaml", 2)


def test_nothing_is_said_of_an_imported_action_that_no_node_uses(tmp_path: Path) -> None:
    other = MOVE.format("goal: {distance: $elsewhere}")
    library = f"actions:\n  move: {MOVE.format('')}\n  other: {other}\n"
    assert found(tmp_path, library) == []


def test_a_type_that_is_not_installed_is_told_where_a_node_needs_it(tmp_path: Path) -> None:
    other = MOVE.format("").replace("MoveRobot", "Fly")
    library = f"actions:\n  move: {MOVE.format('')}\n  other: {other}\n"
    assert found(tmp_path, library) == []
    assert [(one.line, one.code) for one in check_file(tmp_path / "lib.yaml")] == [(3, "BT205")]
    missing = (
        "BT205 package 'robot_control_interfaces' has no action 'Fly'; it has Gripper, MoveRobot"
    )
    assert found(tmp_path, library.replace("MoveRobot", "Fly")) == [f"lib.yaml:2 {missing}"]


def test_nothing_is_said_of_settings_in_whose_place_each_node_has_its_own(tmp_path: Path) -> None:
    settings = "goal: {distance: $elsewhere}, expect: $least > 1, retry: {when: $most}"
    own = "goal: {distance: 1.0}, expect: true, retry: {when: true}"
    main = MAIN.replace("{move: A}", f"{{move: A, {own}}}")
    (tmp_path / "main.yaml").write_text(main.replace("INPUT", "float64"))
    (tmp_path / "lib.yaml").write_text(f"actions:\n  move: {MOVE.format(settings)}\n")
    assert [one.code for one in check_file(tmp_path / "main.yaml")] == ["BT308"]


def test_what_is_wrong_with_an_imported_action_by_itself_is_told_in_its_own_file(
    tmp_path: Path,
) -> None:
    move = MOVE.format("goal: {distnace: $far}, expect: result.nope > $far")
    library = f"actions:\n  move: {move}\n"
    told = found(tmp_path, library)
    assert [one.split(" ")[:2] for one in told] == [["lib.yaml:2", "BT203"]] * 2


def test_what_an_imported_action_reads_is_read(tmp_path: Path) -> None:
    found(tmp_path, f"actions:\n  move: {MOVE.format('expect: result.final_pose > $far')}\n")
    assert check_file(tmp_path / "main.yaml") == []


def test_a_whole_tree_may_be_imported_for_its_words(tmp_path: Path) -> None:
    """What is written below its root is its own: names are read with those of the importer."""
    (tmp_path / "a.yaml").write_text(
        "tree: a\nactions:\n  move:\n    type: robot_control_interfaces/action/MoveRobot\n"
        "    server: move_robot\n    timeout: 30 s\n    goal: {distance: $at}\n"
        "root:\n  sequence: S\n  children:\n    - set: {at: 1.0}\n"
        "    - retry: ever  # bt: ignore[BT304] it must not give up\n      child: {move: Go}\n"
    )
    (tmp_path / "t.yaml").write_text(
        "tree: t\nimport: a.yaml\nroot:\n  sequence: S\n  children:\n"
        "    - set: {at: 2.0}\n    - move: Go\n"
    )
    assert check_file(tmp_path / "a.yaml") == []
    assert check_file(tmp_path / "t.yaml") == []


SAYS = "{{publish: door, type: std_msgs/msg/{}}}"
OUTER = """\
tree: outer
topics: {{door: {{topic: r1/door, type: std_msgs/msg/Bool}}}}
root:
  sequence: S
  children:
    - check: $door.data
    - {}
    - {{subtree: main, namespace: r1}}
    - {{subtree: main, namespace: r2}}
"""


def test_a_name_that_a_subtree_uses_with_another_type_is_told_where_it_is_included(
    tmp_path: Path,
) -> None:
    (tmp_path / "main.yaml").write_text(f"tree: main\nroot: {SAYS.format('String')}\n")
    (tmp_path / "outer.yaml").write_text(OUTER.format(SAYS.format("Int32")))
    (one,) = check_file(tmp_path / "outer.yaml")
    inner = tmp_path / "main.yaml"
    assert (one.line, one.code) == (8, "BT217")
    assert one.message == (
        f"the topic 'r1/door' is std_msgs/msg/String in {inner}:2, and std_msgs/msg/Bool elsewhere"
    )
    assert one.related is not None
    assert one.related.place.line == 2


def test_imported_actions_of_one_server_with_two_types_are_told_where_the_second_is_used(
    tmp_path: Path,
) -> None:
    library = MOVE.format("").replace("server: m", "server: g")
    told = found(tmp_path, f"actions:\n  move: {library}\n")
    move, gripper = (f"robot_control_interfaces/action/{each}" for each in ("MoveRobot", "Gripper"))
    text = f"the action server 'g' is {move} in {tmp_path}/lib.yaml:2, and {gripper} elsewhere"
    assert told == [f"main.yaml:11 BT217 {text}"]
