"""A tree as lines of text, with py_trees' symbols."""

from __future__ import annotations

from collections.abc import Sequence

from bt_actions.events import Node
from bt_actions.render.look import COMPOSITES, NodeRow, gates_of, left_out, rows, word_of
from bt_actions.utilities.plain_text import clean


def text(nodes: Sequence[Node], *, encoding: str = "utf-8", depth: int | None = None) -> str:
    """Return a tree as lines of text, in plain ASCII where `encoding` has no box characters.

    With `depth`, only so many levels below the root.
    """
    fork, corner, bar = ("├─ ", "└─ ", "│  ")
    try:
        (fork + corner + bar).encode(encoding)
    except (UnicodeEncodeError, LookupError):
        fork, corner, bar = ("|- ", "`- ", "|  ")
    lines = []
    for row in rows(nodes, depth=depth):
        stem = "".join(bar if more else "   " for more in row.branches[:-1])
        if row.branches:
            stem += fork if row.branches[-1] else corner
        said = f"{stem}{_symbol(row)} {clean(row.node.name + _remark(row.node))}"
        lines.append(f"{said}  {left_out(row)}".rstrip())
    return "\n".join(lines) + "\n"


def _symbol(row: NodeRow) -> str:
    """Return py_trees' symbol: {-} sequence, {o} selector, [ ] without memory, /_/ parallel."""
    word = word_of(row.node)
    if word == "parallel":
        return "/_/"
    if word in COMPOSITES:
        sign = "o" if word == "fallback" else "-"
        return f"[{sign}]" if row.node.kind.startswith("reactive") else f"{{{sign}}}"
    return "-^-" if row.below else "-->"


def _remark(node: Node) -> str:
    parts = [node.kind]
    if node.server:
        parts = [f"{node.server}: {node.action}"]
    elif word_of(node) in ("sequence", "fallback"):
        parts = [node.kind.partition(", ")[2]]
    said = ", ".join(part for part in (*parts, *gates_of(node)) if part)
    return f"  ({said})" if said else ""
