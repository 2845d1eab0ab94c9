"""The place of a behaviour in its document, and the lines that made the behaviour.

The source is what a loaded tree keeps (the attributes NODE and LOADED): no file is read again. A
behaviour made in Python has nothing here.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour

from bt_actions.document.findings import LOADED, NODE

if TYPE_CHECKING:
    from bt_actions.document.reading.tree import Document, TreeNode

_MOST_CHARACTERS = 4000
_FAR = 1 << 30
_Position = tuple[int, int]
"""Line and column, both from 1."""


def node_of(behaviour: Behaviour) -> TreeNode | None:
    """Return the node of a document that `behaviour` was made from."""
    return getattr(behaviour, NODE, None)


def document_of(behaviour: Behaviour) -> Document | None:
    """Return the tree whose inputs and outputs are `behaviour`'s: a loaded root, or a subtree."""
    document: Document | None = getattr(getattr(behaviour, LOADED, None), "document", None)
    node = node_of(behaviour)
    return document or (None if node is None else node.included)


def own_text(node: TreeNode) -> str:
    """Return the document's text of `node`, comments too, with its children left out as "…"."""
    start, end = (node.node.line, node.node.column), (node.node.end_line, node.node.end_column)
    lines = node.source.lines
    rest = _between(lines, end, (end[0], _FAR))
    if rest.lstrip().startswith("#"):
        end = (end[0], _FAR)
    below = [
        ((child.node.line, child.node.column), (child.node.end_line, child.node.end_column))
        for child in node.children
    ]
    inside = [(first, last) for first, last in below if start <= first and last <= end]
    if inside:
        head = _between(lines, start, min(inside)[0])
        tail = _between(lines, max(last for _, last in inside), end)
        text = f"{head}…{re.sub(r'^[ ]*#.*', '', tail)}"  # the comment is the last child's
    else:
        text = _between(lines, start, end)
    text = re.sub(rf"^ {{0,{start[1] - 1}}}", "", text, flags=re.MULTILINE).rstrip()
    return text if len(text) <= _MOST_CHARACTERS else f"{text[: _MOST_CHARACTERS - 1]}…"


def _between(lines: list[str], start: _Position, end: _Position) -> str:
    part = lines[start[0] - 1 : end[0]]
    if part:
        part[-1] = part[-1][: end[1] - 1]
        part[0] = part[0][start[1] - 1 :]
    return "\n".join(part)
