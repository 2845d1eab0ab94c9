"""What becomes of trees of BehaviorTree.CPP: `imports.txt` has them beside ours.

A block begins with `## ` and a sentence; XML follows, then `-->` and the YAML of its trees, then
what the report tells beyond what was converted. To add one, write the XML and the arrow, and run
`python -m tests.importing.test_importing`: it writes all outcomes, to be reviewed.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import pytest
from py_trees.common import Status

from bt_actions.document import check_file, load_tree
from bt_actions.document.formatting.format import format_source
from bt_actions.document.yaml.source import Source
from bt_actions.importing.convert import Imported, convert
from bt_actions.importing.kinds import KINDS
from bt_actions.importing.mapping import MapError, nav2, read_map
from bt_actions.importing.refused import rows
from bt_actions.importing.report import Verdict
from bt_actions.importing.stubs import MODULE

TABLE = Path(__file__).with_name("imports.txt")
PAGE = Path(__file__).parents[2] / "docs" / "import.md"
ARROW = "-->"


class Case(NamedTuple):
    """A tree there, and what becomes of it."""

    title: str
    xml: str
    expected: str


def read_table() -> list[Case]:
    cases = []
    for block in TABLE.read_text(encoding="utf-8").split("\n## ")[1:]:
        title, _, rest = block.partition("\n")
        xml, _, expected = rest.partition(f"\n{ARROW}\n")
        cases.append(Case(title, xml.strip("\n"), expected.strip("\n")))
    return cases


def imported(xml: str, folder: Path) -> Imported:
    file = folder / "main.xml"
    if not xml.startswith("<root"):
        xml = f'<root BTCPP_format="4">\n<BehaviorTree ID="Main">\n{xml}\n</BehaviorTree>\n</root>'
    file.write_text(xml, encoding="utf-8")
    return convert([file])


def outcome(xml: str, folder: Path) -> str:
    found = imported(xml, folder)
    texts = [text for name, text in found.files.items() if name.endswith(".yaml")]
    told = [
        f"{entry.what} {entry.name}: {entry.verdict}: {entry.why}"
        for entry in found.report
        if entry.verdict is not Verdict.CONVERTED
    ]
    return "\n".join([*texts, *told]).strip("\n")


@pytest.mark.parametrize("case", read_table(), ids=lambda case: case.title)
def test_a_tree_there_becomes_a_tree_here(case: Case, tmp_path: Path) -> None:
    assert outcome(case.xml, tmp_path) == case.expected


@pytest.mark.parametrize("case", read_table(), ids=lambda case: case.title)
def test_every_node_is_accounted_for_and_what_was_written_is_formatted(
    case: Case, tmp_path: Path
) -> None:
    found = imported(case.xml, tmp_path)
    told = sorted((entry.line, entry.column) for entry in found.report.nodes())
    trees, _, _ = case.xml.partition("<TreeNodesModel")
    nodes = re.findall(r"<(?!root|BehaviorTree|include)\w", trees)
    assert len(told) == len(set(told)) == len(nodes)
    for name, text in found.files.items():
        if name.endswith(".yaml"):
            assert format_source(Source(name, text)) == text


def test_what_was_written_twice_is_told_as_it_is_worse(tmp_path: Path) -> None:
    tree = '<SubTree ID="T" n="{n}"/>'
    found = imported(
        f"""<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
        <Timeout msec="9">{tree}</Timeout><PipelineSequence>{tree}</PipelineSequence>
        </Sequence></BehaviorTree><BehaviorTree ID="T">
        <RateController hz="1"><Script code="n := 1"/></RateController></BehaviorTree></root>""",
        tmp_path,
    )
    (rate,) = (each for each in found.report.nodes() if each.name == "RateController")
    assert rate.verdict is Verdict.DIFFERS


def test_what_is_refused_is_refused(tmp_path: Path) -> None:
    kinds = [name for name in rows() if name[0].isupper()]
    assert not {*kinds} & KINDS.keys() & nav2().leaves.keys()
    for kind in kinds:
        found = imported(f"<{kind}><AlwaysSuccess/></{kind}>", tmp_path)
        assert [entry.verdict for entry in found.report.nodes()] == [Verdict.REFUSED] * 2
        assert f"failure: {kind} was not imported" in found.files["Main.yaml"]
        (tmp_path / "Main.yaml").write_text(found.files["Main.yaml"], encoding="utf-8")
        assert [
            each for each in check_file(tmp_path / "Main.yaml") if each.severity == "error"
        ] == []


def test_the_page_tells_of_all_that_is_refused() -> None:
    page = PAGE.read_text(encoding="utf-8")
    told = re.findall(r"^\| `(\w+)` \| (.*) \| (.*) \|$", page, re.MULTILINE)
    assert [*told] == [(name, row.why, row.instead) for name, row in rows().items()]


def test_what_is_to_be_written_is_there_and_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)  # type: ignore[no-untyped-call]
    monkeypatch.delitem(sys.modules, MODULE, raising=False)
    found = imported('<Guard><OpenDoor speed="1.5" door="{door}"/></Guard>', tmp_path)
    for name, text in found.files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert check_file(tmp_path / "Main.yaml") == []
    root = load_tree(tmp_path / "Main.yaml", {"door": "front"})
    root.tick_once()
    assert (root.status, root.feedback_message) == (Status.FAILURE, "Guard is to be written")


def test_a_hundred_kilobytes_take_less_than_a_second(tmp_path: Path) -> None:
    node = '<Sequence><Script code="n := n + 1"/><Sleep msec="100" _skipIf="n > 3"/></Sequence>'
    xml = f"<Sequence>{node * (100_000 // len(node))}</Sequence>"
    taken = []
    for _ in range(3):
        began = time.process_time()
        imported(xml, tmp_path)
        taken.append(time.process_time() - began)
    assert min(taken) < 1.0


def test_a_map_says_what_leaves_are(tmp_path: Path) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "topics: {door: {topic: door, type: std_msgs/msg/Bool}}\n"
        "actions: {move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot}}\n"
        "constants: {FAST: 3}\n"
        "nodes:\n"
        "  MoveTo:\n"
        "    move:\n"
        "    goal: {distance: $distance}\n"
        "    save: {reached: result.final_pose}\n"
        "    ports: {distance: {type: float64, default: 1.5}}\n"
        "  IsOpen: {check: $door.data}\n",
        encoding="utf-8",
    )
    file = tmp_path / "main.xml"
    file.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>'
        '<IsOpen/><MoveTo name="There" distance="{far}" reached="{at}" colour="red"/><MoveTo/>'
        '<ScriptCondition code="at == FAST"/></Sequence></BehaviorTree></root>',
        encoding="utf-8",
    )
    found = convert([file], read_map(mapping))
    assert found.files == {
        "Main.yaml": "tree: Main\n"
        "inputs:\n"
        "  far: float64\n"
        "actions:\n"
        "  move:\n"
        "    type: robot_control_interfaces/action/MoveRobot\n"
        "    server: move_robot\n"
        "topics:\n"
        "  door: {topic: door, type: std_msgs/msg/Bool}\n"
        "root:\n"
        "  sequence: Sequence\n"
        "  children:\n"
        "    - check: $door.data\n"
        "    - move: There\n"
        "      goal: {distance: $far}\n"
        "      save: {at: result.final_pose}\n"
        "    - move: MoveTo\n"
        "      goal: {distance: 1.5}\n"
        "    - check: $at == 3\n"
    }
    (entry,) = (each for each in found.report if each.name == "colour")
    assert entry.verdict is Verdict.DROPPED
    (tmp_path / "Main.yaml").write_text(found.files["Main.yaml"], encoding="utf-8")
    assert [each for each in check_file(tmp_path / "Main.yaml") if each.severity == "error"] == []


def test_a_map_names_kinds_that_hold_nodes(tmp_path: Path) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "kinds:\n"
        "  paced: {python: leaves.Paced, inputs: {by: float64, at: std_msgs/msg/Float64},"
        " children: one}\n"
        "  both: {python: leaves.Both, children: many}\n"
        "topics: {at: {topic: at, type: std_msgs/msg/Float64}}\n"
        "nodes:\n"
        "  Controller: {paced: , with: {by: $distance, at: $at}, ports: {distance: float64}}\n"
        "  Both: {both: }\n",
        encoding="utf-8",
    )
    file = tmp_path / "main.xml"
    file.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><Controller distance="2.0"><Both>'
        "<AlwaysSuccess/><AlwaysFailure/></Both></Controller></BehaviorTree></root>",
        encoding="utf-8",
    )
    found = convert([file], read_map(mapping))
    _, root = found.files["Main.yaml"].split("root:\n")
    assert root == (
        "  paced: Controller\n"
        "  with: {by: 2.0, at: $at}\n"
        "  child:\n"
        "    both: Both\n"
        "    children:\n"
        "      - success: AlwaysSuccess\n"
        "      - failure: AlwaysFailure\n"
    )
    assert [each.name for each in found.report.nodes()] == [
        *("Controller", "Both", "AlwaysSuccess", "AlwaysFailure")
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[1]", "a map is a mapping of names"),
        ("leaves: {}", "unknown key 'leaves'"),
        ("nodes: {A: {}}", "A has no node"),
        ("nodes: {A: 1}", "A is a mapping of names"),
        ("nodes: {A: {success: , ports: 3}}", "the ports of A is a mapping of names"),
        ("a: [", "this is no YAML"),
    ],
)
def test_a_map_that_is_wrong_is_refused(text: str, said: str, tmp_path: Path) -> None:
    mapping = tmp_path / "map.yaml"
    mapping.write_text(text, encoding="utf-8")
    with pytest.raises(MapError, match=re.escape(said)):
        read_map(mapping)


if __name__ == "__main__":
    parts = ["# Trees of BehaviorTree.CPP, and what becomes of them. See test_importing.py.\n"]
    for each in read_table():
        with tempfile.TemporaryDirectory() as directory:
            expected = outcome(each.xml, Path(directory))
        parts.append(f"## {each.title}\n{each.xml}\n{ARROW}\n{expected}\n")
    TABLE.write_text("\n".join(parts), encoding="utf-8")
