"""Trees as text, dot, SVG and PNG, without a system Graphviz and without rclpy.

The page is in test_page.py.
"""

from __future__ import annotations

import os
import re
import struct
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel, Selector, Sequence
from py_trees.decorators import Inverter

from bt_actions import load_tree, render
from bt_actions.behaviours.kinds import kind
from bt_actions.document.describing import nodes_of

SVG = "{http://www.w3.org/2000/svg}"


class Action(Behaviour):
    """A leaf with what render looks for in an action leaf."""

    def __init__(self, name: str, server: str = "move_robot") -> None:
        super().__init__(name)
        self.server = server
        self.action_type = "robot_control_interfaces/action/MoveRobot"

    def update(self) -> Status:
        return Status.SUCCESS


@pytest.fixture
def root() -> Behaviour:
    return Selector(
        "Deliver",
        memory=True,
        children=[
            Sequence("Pick", memory=True, children=[Action("To the part"), Action("Grasp")]),
            Sequence("React", memory=False, children=[Inverter("not", Action("Home"))]),
            Parallel(
                "Both",
                policy=ParallelPolicy.SuccessOnAll(),
                children=[py_trees.behaviours.Success("a"), py_trees.behaviours.Failure("b")],
            ),
        ],
    )


@pytest.mark.parametrize(("policy", "words"), [
    ("", "parallel, all"),
    ("policy: all, ", "parallel, all"),
    ("policy: one, ", "parallel, one"),
    ("policy: {at_least: 1}, ", "parallel, one"),
    ("policy: {at_least: 2}, ", "parallel, at least 2"),
])  # fmt: skip
def test_a_parallel_says_how_many_children_must_succeed(
    tmp_path: Path, policy: str, words: str
) -> None:
    path = tmp_path / "tree.yaml"
    children = "[{success: }, {success: }, {success: }]"
    path.write_text(f"tree: t\nroot: {{parallel: Both, {policy}children: {children}}}\n")
    root = load_tree(path)
    assert kind(root) == words
    assert f"Both  ({words})" in render.text(nodes_of(root))


def test_levels_that_are_left_out_are_counted(root: Behaviour) -> None:
    assert render.text(nodes_of(root), depth=1).splitlines() == [
        "{o} Deliver",
        "├─ {-} Pick  + 2 more",
        "├─ [-] React  + 2 more",
        "└─ /_/ Both  (parallel, all)  + 2 more",
    ]
    assert render.text(nodes_of(root), depth=0) == "{o} Deliver  + 9 more\n"
    assert render.text(nodes_of(root), depth=3) == render.text(nodes_of(root))
    drawn = render.dot(nodes_of(root), depth=1)
    assert (drawn.count("[shape="), drawn.count("+ 2 more"), drawn.count("->")) == (4, 3, 3)
    assert render.dot(nodes_of(root), depth=3) == render.dot(nodes_of(root))


def wide_tree(nodes: int, children: int = 6) -> Behaviour:
    """A tree of `nodes` nodes, each inner one with up to `children` children."""
    made: list[Behaviour] = [Sequence("node 0", memory=True)]
    for number in range(1, nodes):
        inner = number * children + 1 < nodes
        node = Sequence(f"node {number}", memory=True) if inner else Action(f"leaf {number}")
        parent = made[(number - 1) // children]
        assert isinstance(parent, Sequence)
        parent.add_child(node)
        made.append(node)
    return made[0]


def test_text_shows_each_node_once_under_its_parent(root: Behaviour) -> None:
    assert render.text(nodes_of(root)).splitlines() == [
        "{o} Deliver",
        "├─ {-} Pick",
        "│  ├─ --> To the part  (move_robot: MoveRobot)",
        "│  └─ --> Grasp  (move_robot: MoveRobot)",
        "├─ [-] React",
        "│  └─ -^- not  (invert)",
        "│     └─ --> Home  (move_robot: MoveRobot)",
        "└─ /_/ Both  (parallel, all)",
        "   ├─ --> a  (success)",
        "   └─ --> b  (failure)",
    ]


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "no such encoding"])
def test_text_for_an_encoding_without_box_characters_is_ascii(
    root: Behaviour, encoding: str
) -> None:
    assert render.text(nodes_of(root), encoding=encoding).isascii()


def test_dot_gives_py_trees_shapes_and_shows_server_and_type_of_an_action(root: Behaviour) -> None:
    dot = render.dot(nodes_of(root))
    for shape, name in [
        ("octagon", "Deliver"),
        ("box", "Pick"),
        ("parallelogram", "Both"),
        ("ellipse", "not"),
        ("ellipse", "Grasp"),
    ]:
        assert re.search(rf"shape={shape}, [^\n]*label=<{name}<br/>", dot), name
    assert re.search(r"label=<Grasp<br/>[^\n]*move_robot<br/>MoveRobot", dot)
    assert dot.count(" -> ") == 9


@pytest.mark.parametrize(
    "name", ['a "b" <c> & d', "back\\slash", "bell\x07 and\nbreak", "ünï 日本"]
)
def test_any_name_can_be_drawn(name: str) -> None:
    drawing = ET.fromstring(render.content(nodes_of(Sequence(name, memory=True)), "svg"))
    shown = "".join(text.text or "" for text in drawing.iter(f"{SVG}text"))
    assert re.sub(r"[\s\x07]", "", name) in re.sub(r"\s", "", shown)


def test_svg_holds_every_name_and_centres_each_in_its_shape(root: Behaviour) -> None:
    drawing = ET.fromstring(render.content(nodes_of(root), "svg"))
    texts = [text.text for text in drawing.iter(f"{SVG}text")]
    assert {node.name for node in root.iterate()} <= set(texts)
    assert {text.get("text-anchor") for text in drawing.iter(f"{SVG}text")} == {"middle"}
    for group in drawing.iter(f"{SVG}g"):
        ellipse = group.find(f"{SVG}ellipse")
        if ellipse is not None:
            assert {text.get("x") for text in group.iter(f"{SVG}text")} == {ellipse.get("cx")}


def test_png_is_a_png_of_some_size(root: Behaviour) -> None:
    width, height = png_size(render.content(nodes_of(root), "png"))
    assert width > 600
    assert height > 200


def png_size(data: bytes) -> tuple[int, int]:
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def test_drawing_needs_no_dot_on_the_path_and_imports_no_rclpy(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from py_trees.composites import Sequence;"
        "from bt_actions import render; from bt_actions.document.describing import nodes_of;"
        "render.write(nodes_of(Sequence('s', memory=True)), Path('a.png'));"
        "render.write(nodes_of(Sequence('s', memory=True)), Path('a.svg'));"
        "sys.exit('rclpy' in sys.modules)"
    )
    checkout = Path(__file__).parent.parent
    environment = os.environ | {"PATH": "/nowhere", "PYTHONPATH": str(checkout)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "a.svg"]


@pytest.mark.parametrize("form", render.FORMATS)
def test_a_tree_of_1000_nodes_is_drawn_in_every_format(form: str, tmp_path: Path) -> None:
    path = tmp_path / f"tree.{form}"
    render.write(nodes_of(wide_tree(1000)), path)
    assert path.stat().st_size > 10_000
    if form == "png":
        assert max(png_size(path.read_bytes())) < 32_768


def test_a_chain_deeper_than_the_recursion_limit_is_drawn() -> None:
    root = Sequence("0", memory=True)
    last = root
    for number in range(1, 3000):
        child = Sequence(str(number), memory=True)
        last.add_child(child)
        last = child
    assert len(render.text(nodes_of(root)).splitlines()) == 3000
    assert render.dot(nodes_of(root)).count(" -> ") == 2999


def test_a_png_too_small_to_read_is_refused_with_a_way_out() -> None:
    large = wide_tree(10_000)
    with pytest.raises(render.RenderError, match=r"fewer levels of it \(--depth\)"):
        render.content(nodes_of(large), "png")
    assert render.content(nodes_of(large), "png", depth=2).startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["tree.pdf", "tree", ".svg", "tree.svg.gz"])
def test_an_unknown_suffix_is_an_error_that_names_the_known_ones(name: str, tmp_path: Path) -> None:
    with pytest.raises(render.RenderError, match=r"\.txt, \.dot, \.svg, \.png, \.html"):
        render.write(nodes_of(Sequence("s", memory=True)), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_without_pygraphviz_text_and_dot_still_work(
    root: Behaviour, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pygraphviz", None)
    with pytest.raises(render.RenderError, match="pip install pygraphviz"):
        render.content(nodes_of(root), "svg")
    assert render.content(nodes_of(root), "txt")
    assert render.content(nodes_of(root), "dot")
