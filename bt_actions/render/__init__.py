"""A tree as text, dot, SVG, PNG or a page for the browser.

The Graphviz libraries inside the pygraphviz wheel lay out and draw SVG and PNG in this process: no
`dot` on the PATH. page.py makes the page.

A tree comes as the values that the first event of a run has of its nodes: of a recorded run, or of
a loaded tree (`bt_actions.document.describing.nodes_of`).
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bt_actions.events import Node
from bt_actions.render.graphviz import RenderError, draw
from bt_actions.render.look import (
    DOWN_UP_TO,
    NodeRow,
    direction_of,
    label,
    left_out,
    look,
    rows,
)
from bt_actions.render.outline import text
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.whole_file import replace_file

if TYPE_CHECKING:
    from bt_actions.document.cards import Card

__all__ = [
    "DOWN_UP_TO",
    "FORMATS",
    "NodeRow",
    "RenderError",
    "content",
    "dot",
    "form_of",
    "rows",
    "text",
    "write",
]

FORMATS = ("txt", "dot", "svg", "png", "html")

_STYLE = (
    '  graph [ordering=out, bgcolor="transparent", nodesep=0.15, ranksep=0.4, pad=0.1];',
    '  node [style=filled, color="#4d5866", fontcolor="#14181f", margin="0.12,0.05"];',
    '  node [fontname="Helvetica,Arial,sans-serif", fontsize=11];',
    '  edge [color="#7d8794", arrowsize=0.6];',
)


def dot(nodes: Sequence[Node], *, direction: str | None = None, depth: int | None = None) -> str:
    """Return a tree in Graphviz' dot language.

    `direction` is "down" or "right"; None chooses by the number of leaves. With `depth`, only so
    many levels below the root.
    """
    shown = list(rows(nodes, depth=depth))
    lines = [
        f"digraph {_quoted(nodes[0].name)} {{",
        f"  rankdir={'TB' if direction_of(shown, direction) == 'down' else 'LR'};",
        *_STYLE,
    ]
    numbers = {row.node.id: number for number, row in enumerate(shown)}
    for number, row in enumerate(shown):
        shape, fill = look(row)
        lines.append(
            f'  n{number} [shape={shape}, fillcolor="{fill}", '
            f"label=<{_label(row)}>, tooltip={_quoted(_tooltip(row.node))}];"
        )
        if row.node.parent is not None:
            lines.append(f"  n{numbers[row.node.parent]} -> n{number};")
    return "\n".join([*lines, "}", ""])


def content(
    nodes: Sequence[Node],
    form: str,
    *,
    direction: str | None = None,
    depth: int | None = None,
    cards: Sequence[Card] = (),
) -> bytes:
    """Return the bytes of a file of a tree in one of FORMATS; a page shows the nodes' cards, too.

    With `depth`, only so many levels below the root; a page has all of them, and starts folded.
    Raises RenderError for any other format, and for a tree that cannot be drawn.
    """
    if form == "txt":
        return text(nodes, depth=depth).encode()
    if form == "dot":
        return dot(nodes, direction=direction, depth=depth).encode()
    if form == "html":
        from bt_actions.render.page import page  # here: few calls want one, all load this file

        return page(nodes, cards, direction=direction, depth=depth).encode()
    if form in FORMATS:
        return draw(dot(nodes, direction=direction, depth=depth), form)
    raise RenderError(f"unknown format {form!r}; there are {', '.join(FORMATS)}")


def form_of(path: Path) -> str:
    """Return the format that `path`'s suffix asks for.

    Raises RenderError for a suffix that is none of FORMATS.
    """
    form = path.suffix.lower().removeprefix(".")
    if form not in FORMATS:
        known = ", ".join(f".{name}" for name in FORMATS)
        raise RenderError(f"{path}: cannot tell the format from the suffix; there are {known}")
    return form


def write(
    nodes: Sequence[Node],
    path: Path,
    *,
    direction: str | None = None,
    depth: int | None = None,
    cards: Sequence[Card] = (),
) -> None:
    """Write a tree to `path` in the format of its suffix: the whole file, or no change.

    Raises RenderError when the suffix is unknown, or the file cannot be drawn or written.
    """
    data = content(nodes, form_of(path), direction=direction, depth=depth, cards=cards)
    try:
        replace_file(path, data)
    except OSError as error:
        raise RenderError(f"{path}: cannot be written: {error.strerror or error}") from error


def _label(row: NodeRow) -> str:
    name, under = label(row.node)
    small = "<br/>".join(html.escape(line) for line in (*under, left_out(row)) if line)
    large = "<br/>".join(html.escape(line) for line in name)
    return f'{large}<br/><font point-size="8.5">{small}</font>'


def _tooltip(node: Node) -> str:
    file, _, line = node.place.rpartition(":")[0].rpartition(":")
    return f"{clean(node.name)} ({Path(file).name}:{line})" if file else clean(node.name)


def _quoted(name: str) -> str:
    return '"' + clean(name).replace("\\", "\\\\").replace('"', '\\"') + '"'
