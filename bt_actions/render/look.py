"""The look of a node, for every picture and page of a tree: words, shape, colours.

static/looks.js holds the table, and tells a page the same of a node. Draws and lays out nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from bt_actions.events import Node
from bt_actions.utilities.plain_text import clean

DOWN_UP_TO = 16
"""Leaves up to which a picture grows down, as py_trees draws; a wider one grows to the right."""
GATES = ("only_if", "only_while")
COMPOSITES = ("sequence", "fallback", "parallel")
STATIC = Path(__file__).parent / "static"
"""The modules that a drawn tree and the page of a run share."""


@dataclass(frozen=True, slots=True)
class NodeRow:
    """One node of a tree in reading order."""

    node: Node
    depth: int
    branches: tuple[bool, ...]
    """For each level below the root: whether the line goes on below this node."""
    below: int
    """Nodes below this one."""
    is_folded: bool = False
    """Whether these are left out."""


def rows(nodes: Sequence[Node], *, depth: int | None = None) -> Iterator[NodeRow]:
    """Yield every node in reading order, parents first; not bounded by recursion.

    `nodes` are those of a RunBegan, parents first. With `depth`, only nodes of so many levels below
    the root; one that has more below tells how many.
    """
    children: dict[int | None, list[Node]] = {}
    for node in nodes:
        children.setdefault(node.parent, []).append(node)
    below = dict.fromkeys((node.id for node in nodes), 0)
    for node in reversed(nodes):
        if node.parent is not None:
            below[node.parent] += below[node.id] + 1
    waiting = [NodeRow(nodes[0], 0, (), below[nodes[0].id])]
    while waiting:
        row = waiting.pop()
        if row.depth == depth:
            yield replace(row, is_folded=row.below > 0)
            continue
        yield row
        inner = children.get(row.node.id, [])
        waiting.extend(
            NodeRow(child, row.depth + 1, (*row.branches, child is not inner[-1]), below[child.id])
            for child in reversed(inner)
        )


def direction_of(nodes: Iterable[NodeRow], direction: str | None = None) -> str:
    """Return "down" or "right": `direction` itself, or by the number of leaves where it is None."""
    if direction is not None:
        return direction
    leaves = sum(row.is_folded or not row.below for row in nodes)
    return "down" if leaves <= DOWN_UP_TO else "right"


def left_out(row: NodeRow) -> str:
    """Return the words for the nodes below `row` that a picture leaves out, or ""."""
    return f"+ {row.below:,} more" if row.is_folded else ""


def label(node: Node) -> tuple[list[str], list[str]]:
    """Return the lines of a node's name, and the smaller ones below: its kind, or its action."""
    lines, most = [""], table()["letters"]
    for word in clean(node.name).split():
        for at in range(0, len(word), most):
            part = word[at : at + most]
            line = f"{lines[-1]} {part}".strip()
            if len(line) > most or at:
                lines.append(part)
            else:
                lines[-1] = line
    under = [node.server, node.action] if node.server else [node.kind]
    return lines, [clean(line) for line in (*under, *gates_of(node)) if line]


def gates_of(node: Node) -> list[str]:
    """Return the conditions of a node, without which it is left out."""
    return [f"{key} {node.settings[key]!s}" for key in GATES if key in node.settings]


def word_of(node: Node) -> str:
    """Return the composite that a node is, one of COMPOSITES; of any other node its kind."""
    return node.kind.removeprefix("reactive ").partition(",")[0]


def look(row: NodeRow) -> tuple[str, str]:
    """Return the shape of a node, as py_trees draws it, and its fill, lightened."""
    word = word_of(row.node)
    if row.node.server:
        name = "action"
    elif word in COMPOSITES:
        name = word
    else:
        name = "decorator" if row.below else "leaf"
    found = table()["looks"][name]
    return found["shape"], found["fill"]


@lru_cache
def table() -> Any:
    """Return the table of looks."""
    text = (STATIC / "looks.js").read_text("utf-8").partition("TABLE = ")[2]
    return json.JSONDecoder().raw_decode(text)[0]
