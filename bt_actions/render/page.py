"""A tree as one HTML file that shows, for each node, its YAML, its policies and its types.

The layout is made in the reader's browser, not by Graphviz, because it changes with every fold; and
because a browser measures text with the font that it draws with. Here the tree becomes data: what
each node is called, looks like and says. page.html, page.css, page_layout.js and page.js show it.

The file loads nothing and sends nothing: its policy for the browser (CSP) allows this one script
and this one style, by their hashes. Text from a tree never becomes markup: in the page it is data,
which the script sets as text. Nothing in the page may depend on when or where it was made. Never
imports rclpy.
"""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from py_trees.behaviour import Behaviour

from bt_actions.behaviours.kinds import action_of, kind
from bt_actions.document import place_of
from bt_actions.render.card import Table, describe, interface_of, tables
from bt_actions.render.graphviz import RenderError
from bt_actions.render.look import NodeRow, direction_of, label, look, rows
from bt_actions.render.one_file import data_text, policy
from bt_actions.render.outline import text
from bt_actions.render.written import document_of, node_of, own_text
from bt_actions.utilities.plain_text import clean

MOST_NODES = 20_000
"""Nodes of the largest tree that a page is made of."""
OPEN_UP_TO = 40
"""Nodes that a page shows at first; a larger tree starts folded."""
UNFOLDED_UP_TO = 3000
"""Nodes that it shows when all is to be unfolded: about a second's work for a browser."""

_FOLDER = Path(__file__).parent
_PLACEHOLDER = re.compile(r"\{\{([a-z]+)\}\}")


def page(root: Behaviour, *, direction: str | None = None, depth: int | None = None) -> str:
    """Return `root` as a page; the same tree gives the same text.

    `direction` is "down" or "right"; None chooses by the number of leaves. `depth` is how many
    levels below the root it shows at first; None chooses by the number of nodes. Raises RenderError
    for a tree of more than MOST_NODES nodes.
    """
    nodes = list(rows(root))
    if len(nodes) > MOST_NODES:
        raise RenderError(
            f"a page of {len(nodes):,} nodes would be too slow; write .svg or .txt, with --depth"
        )
    style, script = _file("page.css"), _script()
    parts = {
        "policy": policy(script, style),
        "title": html.escape(clean(root.name)),
        "style": style,
        "script": script,
        "data": data_text(_data(nodes, direction, depth)),
        "outline": html.escape(text(root)),
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


def _data(nodes: Sequence[NodeRow], direction: str | None, depth: int | None) -> dict[str, object]:
    """Return what the script draws. Nodes of one action share their tables, by number."""
    shared: dict[Table, int] = {}
    types: dict[object, list[Table]] = {}
    numbers: dict[int, int] = {}
    shown = []
    for number, row in enumerate(nodes):
        node = row.node
        numbers[id(node)] = number
        source = node_of(node)
        said = list(tables(node, source, document_of(node)))
        interface = interface_of(node, source)
        if interface is not None:
            if interface not in types:
                types[interface] = list(describe(*interface))
            said += types[interface]
        shape, fill = look(node)
        name, under = label(node)
        one: dict[str, object] = {
            "parent": numbers[id(node.parent)] if row.depth else -1,
            "name": clean(node.name),
            "kind": kind(node) if action_of(node) is None else "action",
            "lines": name,
            "under": under,
            "shape": shape,
            "fill": fill,
            "tables": [shared.setdefault(table, len(shared)) for table in said],
        }
        place = place_of(node)
        more = {
            "place": None if place is None else str(place),
            "yaml": None if source is None else own_text(source),
        }
        shown.append(one | {key: value for key, value in more.items() if value})
    return {
        "down": direction_of(nodes, direction) == "down",
        "open": open_depth(nodes, OPEN_UP_TO) if depth is None else depth,
        "unfold": open_depth(nodes, UNFOLDED_UP_TO),
        "tables": list(shared),
        "nodes": shown,
    }


def _script() -> str:
    parts = (_file(name) for name in ("page_layout.js", "page.js"))
    return '\n"use strict";\n(() => {\n' + "\n".join(parts) + "})();\n"


def _file(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")
