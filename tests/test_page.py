"""A tree as one HTML file: what it says of each node, and that it is sealed. Needs no browser."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from bt_actions import MoveRobot, Retry, Timeouts, load_tree
from bt_actions.behaviours.variables import Var
from bt_actions.document.cards import cards_of
from bt_actions.document.describing import nodes_of
from bt_actions.render.graphviz import RenderError
from bt_actions.render.look import rows
from bt_actions.render.page import MOST_NODES, open_depth
from bt_actions.render.page import page as page_of

ROOT = Path(__file__).parents[1]
TREE = """\
tree: fetch
inputs:
  at: {type: float64, default: 2.0, unit: m}
outputs:
  pose: float64
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: move_robot
    timeout: {result: 30 s, feedback: 2 s}
    retry: {attempts: 3, backoff: 500 ms, when: result.final_pose > 0.0}
root:
  sequence: Fetch
  children:
    # the way there
    - move: To the part
      goal: {distance: $at}          # from the input
      expect: result.final_pose == $at
      save: {pose: result.final_pose}
      busy: fail
      resources: [base, arm]
    - invert: Not
      child: {check: $at > 3.0}      # far
    - {retry: Again, attempts: 2, child: {success: done}}
  memory: false
"""


class _Reader(HTMLParser):
    """The elements of a page, and what stands in its scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.inside: dict[str, str] = {}
        self._open = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open = dict(attrs).get("type") or tag

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def handle_data(self, data: str) -> None:
        self.inside[self._open] = self.inside.get(self._open, "") + data

    @property
    def data(self) -> dict[str, Any]:
        return dict(json.loads(self.inside["application/json"]))


def page(root: Behaviour) -> str:
    return page_of(nodes_of(root), cards_of(root))


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (path := tmp_path / "fetch.yaml").write_text(TREE)
    return path


def card(text: str, name: str) -> SimpleNamespace:
    """What the page says about the first node of a name; its tables as dictionaries."""
    data = _Reader(text).data
    node = next(node for node in data["nodes"] if node["name"] == name)
    tables = (data["tables"][number] for number in node["tables"])
    found = {title: {key: value for key, value, *_ in lines} for title, lines in tables}
    return SimpleNamespace(**{**node, "tables": found})


def actions(nodes: int) -> Iterator[Behaviour]:
    for number in range(nodes):
        yield MoveRobot(f"Leg {number}", float(number), timeout=30.0, retry=Retry(3))


def test_a_card_tells_where_a_node_is_written_and_shows_its_lines(tree: Path) -> None:
    leaf = card(page(load_tree(tree)), "To the part")
    assert leaf.kind == "action"
    assert leaf.place == f"{tree}:16:7"
    assert leaf.yaml.splitlines() == [
        "move: To the part",
        "goal: {distance: $at}          # from the input",
        "expect: result.final_pose == $at",
        "save: {pose: result.final_pose}",
        "busy: fail",
        "resources: [base, arm]",
    ]


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("Fetch", ["sequence: Fetch", "children:", "  # the way there", "  - …", "memory: false"]),
        ("Not", ["invert: Not", "child: …"]),
        ("$at > 3.0", ["{check: $at > 3.0}      # far"]),
        ("Again", ["{retry: Again, attempts: 2, child: …}"]),
        ("done", ["{success: done}"]),
    ],
)
def test_the_lines_of_a_node_leave_its_children_out(
    name: str, lines: list[str], tree: Path
) -> None:
    assert card(page(load_tree(tree)), name).yaml.splitlines() == lines


def test_a_card_shows_every_policy_as_it_is_in_effect(tree: Path) -> None:
    tables = card(page(load_tree(tree)), "To the part").tables
    assert tables["Action"] == {
        "server": "move_robot",
        "type": "robot_control_interfaces/action/MoveRobot",
        "expect": "result.final_pose == $at",
        "save": "pose: result.final_pose",
        "busy": "fail",
        "resources": "arm, base",
    }
    assert tables["Timeouts"] == {
        "queue": "10 s",
        "server": "5 s",
        "accept": "5 s",
        "result": "30 s",
        "feedback": "2 s",
        "cancel": "5 s",
    }
    assert list(tables["Timeouts"]) == list(Timeouts.__dataclass_fields__)
    assert list(tables["Retry"]) == list(Retry.__dataclass_fields__)
    assert tables["Retry"]["attempts"] == "3"
    assert tables["Retry"]["backoff"] == "0.5 s"
    assert tables["Retry"]["when"] == "result.final_pose > 0.0"


def test_the_default_of_a_secret_is_on_no_card(tmp_path: Path) -> None:
    file = tmp_path / "t.yaml"
    file.write_text(
        "tree: t\ninputs: {pin: {type: int8, secret: true, default: 77}}\nroot: {log: $(pin)}\n"
    )
    (inputs,) = cards_of(load_tree(file))[0].tables
    assert [line.value for line in inputs.lines] == ["int8, •••"]


def test_a_tree_made_in_python_shows_what_there_is() -> None:
    def near(result: Any) -> bool:
        return bool(result)

    leaf = MoveRobot("Go", Var("there"), expect=near, save={"/at": "result.final_pose"})
    shown = card(page(leaf), "Go")
    assert (shown.yaml, shown.place) == ("", "")
    assert shown.tables["Action"]["goal"] == "{distance: $there}"
    assert shown.tables["Action"]["expect"].endswith("near (a function)")
    assert shown.tables["Action"]["save"] == "/at: result.final_pose"
    assert shown.tables["Action"]["resources"] == "move_robot (its server)"
    assert shown.tables["Timeouts"]["result"] == "none"
    assert shown.tables["MoveRobot.Goal"] == {"distance": "float64"}


def test_a_behaviour_of_somebody_else_shows_its_class() -> None:
    class Mine(py_trees.behaviours.Success):
        pass

    assert card(page(Mine("mine")), "mine").tables["Behaviour"]["class"].endswith(".Mine")
    assert card(page(py_trees.behaviours.Success("ours")), "ours").tables == {}


NASTY = (
    "</script><img src=x onerror=alert(1)>",
    "</title></style></noscript><script>alert(1)</script>",
    "<!--<script>",
    "]]>&lt;&amp;\"'`",
    "{{script}} {{data}} {{policy}}",
    "\u2028\u2029\x00\ud800 ünï 日本",
    "\\u003c/script\\u003e",
)


@pytest.mark.parametrize("name", NASTY)
def test_a_name_from_a_tree_never_becomes_markup(name: str) -> None:
    harmless = _Reader(page(Sequence("s", memory=True, children=[*actions(1)])))
    leaf = MoveRobot(name, 0.0, action_name=name, save={name: "result.final_pose"})
    text = page(Sequence(name, memory=True, children=[leaf]))
    nasty = _Reader(text)
    assert [tag for tag, _ in nasty.elements] == [tag for tag, _ in harmless.elements]
    assert nasty.inside["script"] == harmless.inside["script"]
    assert nasty.inside["style"] == harmless.inside["style"]
    shown = re.sub("[\x00-\x1f\u2028\u2029\ud800]+", " ", name)
    assert [node["name"] for node in nasty.data["nodes"]] == [shown, shown]
    assert not re.search("[<>&]", nasty.inside["application/json"])
    text.encode()  # a lone surrogate could not be written


def test_a_page_loads_and_sends_nothing(tree: Path) -> None:
    text = page(load_tree(tree))
    reader = _Reader(text)
    allowed = {"http://www.w3.org/2000/svg"}  # the name of a language, not an address
    assert set(re.findall(r"\w+://[^\"'\s)]*", text)) == allowed
    for tag, attributes in reader.elements:
        assert tag not in {"link", "img", "iframe", "object", "embed", "base", "image", "use"}
        assert not {"src", "href", "srcset", "action", "style"} & set(attributes)
        assert not [name for name in attributes if name.startswith("on")]
    assert not re.search(r"url\(|@import", reader.inside["style"])
    forbidden = r"innerHTML|insertAdjacent|document\.write|\beval\b|Function\(|fetch|XMLHttp"
    forbidden += r"|WebSocket|EventSource|sendBeacon|import|localStorage|cookie|location"
    assert not re.search(forbidden, reader.inside["script"])


def test_the_policy_of_a_page_allows_its_own_script_and_style_only(tree: Path) -> None:
    reader = _Reader(page(load_tree(tree)))
    (policy,) = (
        attributes["content"] or ""
        for tag, attributes in reader.elements
        if tag == "meta" and attributes.get("http-equiv") == "Content-Security-Policy"
    )
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    for kind in ("script", "style"):
        digest = hashlib.sha256(reader.inside[kind].encode()).digest()
        assert rules[f"{kind}-src"] == f"'sha256-{base64.b64encode(digest).decode()}'"
    assert rules["default-src"] == rules["base-uri"] == rules["form-action"] == "'none'"


def test_the_same_tree_is_the_same_page_in_every_process(tree: Path) -> None:
    code = (
        "import sys; from bt_actions import load_tree; from tests.test_page import page;"
        "load_tree(sys.argv[1]) if len(sys.argv) > 2 else None;"
        "sys.stdout.buffer.write(page(load_tree(sys.argv[1])).encode())"
    )
    pages = {page(load_tree(tree)).encode(), page(load_tree(tree)).encode()}
    for seed, more in (("1", []), ("2", ["twice"])):
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-c", code, str(tree), *more]
        pages.add(subprocess.run(command, env=environment, check=True, capture_output=True).stdout)
    assert len(pages) == 1


def test_a_page_of_2000_actions_is_small_because_they_share_what_they_say() -> None:
    text = page(Sequence("Long", memory=True, children=list(actions(2000))))
    data = _Reader(text).data
    assert len(data["nodes"]) == 2001
    assert len(text) < 1_000_000
    assert sum(title == "Timeouts" for title, _ in data["tables"]) == 1


def test_a_tree_too_large_for_a_browser_is_refused_with_a_way_out() -> None:
    root = Sequence("s", memory=True)
    root.add_children([py_trees.behaviours.Success("x") for _ in range(MOST_NODES)])
    with pytest.raises(RenderError, match=r"write \.svg or \.txt"):
        page(root)


def test_without_a_script_the_tree_is_there_as_text(tree: Path) -> None:
    reader = _Reader(page(load_tree(tree)))
    assert "noscript" in [tag for tag, _ in reader.elements]
    assert "--&gt; To the part  (move_robot: MoveRobot)" in page(load_tree(tree))


@pytest.mark.parametrize(
    ("children", "depth"), [([], 1), ([39], 1), ([3, 2, 2], 3), ([9, 3, 2], 2), ([50, 1], 1)]
)
def test_a_large_tree_starts_folded_where_it_can_be_taken_in(
    children: list[int], depth: int
) -> None:
    root = Sequence("root", memory=True)
    level = [root]
    for number in children:
        below = [[Sequence("node", memory=True) for _ in range(number)] for _ in level]
        for parent, nodes in zip(level, below, strict=True):
            parent.add_children(nodes)
        level = [node for nodes in below for node in nodes]
    assert open_depth(list(rows(nodes_of(root))), 40) == depth


def test_a_node_that_another_is_merged_into_shows_its_own_lines(tmp_path: Path) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(
        "tree: t\nroot:\n  sequence: S\n  children:\n"
        "    - &first\n      log: one\n      level: warn\n"
        "    - <<: *first\n      level: error\n"
    )
    text = page(load_tree(path))
    assert "level: warn" in text
    assert "level: error" in text
