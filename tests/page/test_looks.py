"""Pictures and pages draw a node alike: one table, and two readers of it that say the same."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bt_actions import render
from bt_actions.events import Node, RunBegan
from bt_actions.render.look import label, look, rows, table
from tests.page.conftest import Served
from tests.page.test_feed import told_of
from tests.support import browser as chromium
from tests.support.recordings import record

pytestmark = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")
KINDS = ["sequence", "reactive sequence", "fallback", "reactive fallback", "parallel, all"]
KINDS += ["parallel, at least 2", "for_each", "my_own"]
NAMES = ["To the part", "", " a  b ", "x" * 60, "one two three four five six seven eight nine"]
NAMES += ["a word and " + "y" * 40 + " behind", "ünï 日本"]
ROOT = Node(1, None, "Root", "sequence")
NODES = [
    ROOT,
    *(Node(10 + at, 1, NAMES[at % len(NAMES)], kind) for at, kind in enumerate(KINDS)),
    *(Node(30 + at, 10 + at, name, "success") for at, name in enumerate(NAMES)),
    Node(50, 1, "Go", "move_robot", "tree.yaml:3:5", "/arm/move_robot", "MoveRobot"),
]
TELL = """
const { look, label } = window.looks, { looks } = window.looks.TABLE;
return page.run.order.map((node) => {
  const { shape, fill } = look(node), { lines, under } = label(node);
  return [node.number, shape, fill, lines, under];
});
"""


def test_a_page_and_graphviz_give_a_node_the_same_shape_colour_and_words(
    served: Served, window: chromium.Browser
) -> None:
    events = told_of()
    began = next(each for each in events if isinstance(each, RunBegan))
    record([replace(began, nodes=tuple(NODES)), *events[1:2]])
    window.open(f"{served.address}&view=graph")
    window.wait_for("window.page?.shown")
    window.run("import('/looks.js').then((found) => { window.looks = found; })")
    assert window.wait_for("window.looks")
    wanted = [[row.node.id, *look(row), *label(row.node)] for row in rows(NODES)]
    assert window.run(TELL) == wanted
    drawing = render.dot(NODES)
    assert all(f'shape={shape}, fillcolor="{fill}"' in drawing for _, shape, fill, *_ in wanted)
    of_css = "return getComputedStyle(document.body).getPropertyValue(`--k-${arguments[0]}`)"
    for name, each in table()["looks"].items():
        assert window.run(of_css, name) == each["fill"]
    fills = (
        "[...document.querySelectorAll('#shapes .shape')].map((one) => one.getAttribute('fill'))"
    )
    assert window.run(f"return {fills}") == [fill for _, _, fill, *_ in wanted]
