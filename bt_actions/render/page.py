"""A tree as one HTML file that shows, for each node, its YAML, its policies and its types.

The reader's browser makes the layout, not Graphviz: the layout changes with every fold, and only a
browser measures text with the font that it draws with. Here the tree becomes data: the names and
words of each node. page.html, page.css, page.js and the modules in static/ show it.

Text from a tree never becomes markup: in the page it is data, which the script sets as text.
Nothing in the page may depend on the time or the place of its making.
"""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.events import Node
from bt_actions.render.graphviz import RenderError
from bt_actions.render.look import STATIC, NodeRow, direction_of, gates_of, rows
from bt_actions.render.one_file import data_text, policy, script
from bt_actions.render.outline import text
from bt_actions.utilities.plain_text import clean

if TYPE_CHECKING:
    from bt_actions.document.cards import Card, Table

MOST_NODES = 20_000
"""Nodes of the largest tree that has a page."""
OPEN_UP_TO = 40
"""Nodes that a page shows at first; a larger tree starts folded."""
UNFOLDED_UP_TO = 3000
"""Nodes that a page shows at "unfold all": about a second's work for a browser."""

_FOLDER = Path(__file__).parent
_PLACEHOLDER = re.compile(r"\{\{([a-z]+)\}\}")


def page(
    nodes: Sequence[Node],
    cards: Sequence[Card] = (),
    *,
    direction: str | None = None,
    depth: int | None = None,
) -> str:
    """Return a tree as a page; the same tree gives the same text.

    `direction` is "down" or "right"; None chooses by the number of leaves. `depth` is how many
    levels below the root it shows at first; None chooses by the number of nodes. Raises RenderError
    for a tree of more than MOST_NODES nodes.
    """
    if len(nodes) > MOST_NODES:
        raise RenderError(
            f"a page of {len(nodes):,} nodes would be too slow; write .svg or .txt, with --depth"
        )
    style = (STATIC / "drawing.css").read_text("utf-8") + _file("page.css")
    code = script("page", _modules())
    parts = {
        "policy": policy(code, style),
        "title": html.escape(clean(nodes[0].name)),
        "style": style,
        "script": code,
        "data": data_text(_data(nodes, cards, direction, depth)),
        "outline": html.escape(text(nodes)),
    }
    return _PLACEHOLDER.sub(lambda found: parts[found[1]], _file("page.html"))


def open_depth(nodes: Sequence[NodeRow], most: int) -> int:
    """Return the deepest level down to which there are at most `most` nodes; 1 at least."""
    levels = Counter(row.depth for row in nodes)
    shown, depth = 1, 0
    while levels[depth + 1] and shown + levels[depth + 1] <= most:
        depth += 1
        shown += levels[depth]
    return max(depth, 1)


def _data(
    nodes: Sequence[Node], cards: Sequence[Card], direction: str | None, depth: int | None
) -> dict[str, object]:
    """Return what the script draws. Nodes of one action share their tables, by number."""
    shared: dict[Table, int] = {}
    places = {node.id: place for place, node in enumerate(nodes)}
    shown = [
        {
            "parent": -1 if node.parent is None else places[node.parent],
            "name": clean(node.name),
            "kind": clean(node.kind),
            "server": clean(node.server),
            "type": clean(node.action),
            "gates": gates_of(node),
            "place": node.place,
            "yaml": card.yaml if card is not None else "",
            "tables": [shared.setdefault(each, len(shared)) for each in card.tables]
            if card is not None
            else [],
        }
        for node, card in zip_longest(nodes, cards)
    ]
    levels = list(rows(nodes))
    return {
        "down": direction_of(levels, direction) == "down",
        "open": open_depth(levels, OPEN_UP_TO) if depth is None else depth,
        "unfold": open_depth(levels, UNFOLDED_UP_TO),
        "tables": list(shared),
        "nodes": shown,
    }


def _modules() -> dict[str, str]:
    paths = (*STATIC.glob("*.js"), *_FOLDER.glob("*.js"))
    return {path.stem: path.read_text("utf-8") for path in paths}


def _file(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")
