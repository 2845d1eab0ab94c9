"""A tree as lines of text, with py_trees' symbols. Never ticks, sets up or changes a tree."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.composites import Composite, Parallel, Selector, Sequence
from py_trees.decorators import Decorator

from bt_actions.behaviours.kinds import action_of, kind
from bt_actions.render.look import left_out, rows
from bt_actions.utilities.plain_text import clean


def text(root: Behaviour, *, encoding: str = "utf-8", depth: int | None = None) -> str:
    """Return `root` as lines of text, in plain ASCII where `encoding` has no box characters.

    With `depth`, only so many levels below the root.
    """
    fork, corner, bar = ("├─ ", "└─ ", "│  ")
    try:
        (fork + corner + bar).encode(encoding)
    except (UnicodeEncodeError, LookupError):
        fork, corner, bar = ("|- ", "`- ", "|  ")
    lines = []
    for row in rows(root, depth=depth):
        stem = "".join(bar if more else "   " for more in row.branches[:-1])
        if row.branches:
            stem += fork if row.branches[-1] else corner
        said = f"{stem}{_symbol(row.node)} {clean(row.node.name + _remark(row.node))}"
        lines.append(f"{said}  {left_out(row)}".rstrip())
    return "\n".join(lines) + "\n"


def _symbol(node: Behaviour) -> str:
    """py_trees' text symbols: {-} sequence, {o} selector, [ ] without memory, /_/ parallel."""
    if isinstance(node, Parallel):
        return "/_/"
    if isinstance(node, Selector | Sequence):
        inner = "o" if isinstance(node, Selector) else "-"
        return f"{{{inner}}}" if node.memory else f"[{inner}]"
    if isinstance(node, Composite | Decorator) or node.children:
        return "-^-"
    return "-->"


def _remark(node: Behaviour) -> str:
    action = action_of(node)
    if action is not None:
        return f"  ({action[0]}: {action[1]})"
    if isinstance(node, Selector | Sequence):
        return ""
    return f"  ({kind(node)})"
