"""The look of a node, for every picture and page of a tree: words, shape, colours.

Shapes are py_trees' own (octagon: fallback, box: sequence, parallelogram: parallel, ellipse:
decorators and leaves). Draws and lays out nothing, never changes a tree, imports no rclpy.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from py_trees.behaviour import Behaviour
from py_trees.composites import Composite, Parallel, Selector, Sequence
from py_trees.decorators import Decorator

from bt_actions.behaviours.kinds import action_of, kind
from bt_actions.utilities.plain_text import clean

DOWN_UP_TO = 16
"""Leaves up to which a picture grows down, as py_trees draws; a wider one grows to the right."""

_LABEL_WIDTH = 28
_LOOKS = (
    (Selector, "octagon", "#8ee3ea"),
    (Sequence, "box", "#ffc46b"),
    (Parallel, "parallelogram", "#ffe070"),
    ((Composite, Decorator), "ellipse", "#f4f4fc"),
    (Behaviour, "ellipse", "#d4d8dd"),
)


@dataclass(frozen=True, slots=True)
class Row:
    """One node of a tree in reading order."""

    node: Behaviour
    depth: int
    branches: tuple[bool, ...]
    """For each level below the root: does the line go on below this node?"""
    folded: int = 0
    """Nodes below this one that are left out."""


def rows(root: Behaviour, *, depth: int | None = None) -> Iterator[Row]:
    """Yield every node below and including `root`, parents first; not bounded by recursion.

    With `depth`, only nodes of so many levels below the root; who has more below tells how many.
    """
    waiting = [Row(root, 0, ())]
    while waiting:
        row = waiting.pop()
        if row.depth == depth:
            yield replace(row, folded=sum(1 for _ in rows(row.node)) - 1)
            continue
        yield row
        last = len(row.node.children) - 1
        waiting.extend(
            Row(child, row.depth + 1, (*row.branches, index != last))
            for index, child in reversed(list(enumerate(row.node.children)))
        )


def direction_of(nodes: Iterable[Row], direction: str | None = None) -> str:
    """Return "down" or "right": `direction` itself, or by the number of leaves where it is None."""
    if direction is not None:
        return direction
    return "down" if sum(not row.node.children for row in nodes) <= DOWN_UP_TO else "right"


def left_out(row: Row) -> str:
    """Return what a picture says of the nodes below `row` that it does not show, or nothing."""
    return f"+ {row.folded:,} more" if row.folded else ""


def label(node: Behaviour) -> tuple[list[str], list[str]]:
    """Return the lines of a node's name, and the smaller ones below: its kind, or its action."""
    name = clean(node.name) or " "
    action = action_of(node)
    under = [kind(node)] if action is None else list(action)
    return textwrap.wrap(name, _LABEL_WIDTH) or [name], [clean(line) for line in under if line]


def look(node: Behaviour) -> tuple[str, str]:
    """Return the shape of a node, as py_trees draws it, and its fill, lightened."""
    if action_of(node) is not None:
        return "ellipse", "#bfd7ff"
    return next((shape, fill) for kinds, shape, fill in _LOOKS if isinstance(node, kinds))
