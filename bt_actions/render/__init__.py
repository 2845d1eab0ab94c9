"""A tree as text, dot, SVG, PNG or a page for the browser.

Layout and drawing of SVG and PNG use the Graphviz libraries inside the pygraphviz wheel, in this
process: no `dot` on the PATH. The page is made in page.py.

Never ticks, sets up or changes a tree, and never imports rclpy.
"""

from __future__ import annotations

import html
from pathlib import Path

from py_trees.behaviour import Behaviour

from bt_actions.behaviours.kinds import action_of, kind
from bt_actions.document import place_of
from bt_actions.render.graphviz import RenderError, draw
from bt_actions.render.look import (
    DOWN_UP_TO,
    Row,
    direction_of,
    label,
    left_out,
    look,
    rows,
)
from bt_actions.render.outline import text
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.whole_file import replace_file

__all__ = [
    "DOWN_UP_TO",
    "FORMATS",
    "RenderError",
    "Row",
    "action_of",
    "content",
    "dot",
    "form_of",
    "kind",
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


def dot(root: Behaviour, *, direction: str | None = None, depth: int | None = None) -> str:
    """Return `root` in Graphviz' dot language.

    `direction` is "down" or "right"; None chooses by the number of leaves. With `depth`, only so
    many levels below the root.
    """
    nodes = list(rows(root, depth=depth))
    lines = [
        f"digraph {_quoted(root.name)} {{",
        f"  rankdir={'TB' if direction_of(nodes, direction) == 'down' else 'LR'};",
        *_STYLE,
    ]
    numbers = {id(row.node): number for number, row in enumerate(nodes)}
    for number, row in enumerate(nodes):
        shape, fill = look(row.node)
        lines.append(
            f'  n{number} [shape={shape}, fillcolor="{fill}", '
            f"label=<{_label(row)}>, tooltip={_quoted(_tooltip(row.node))}];"
        )
        parent = row.node.parent
        if row.depth and parent is not None:
            lines.append(f"  n{numbers[id(parent)]} -> n{number};")
    return "\n".join([*lines, "}", ""])


def content(
    root: Behaviour, form: str, *, direction: str | None = None, depth: int | None = None
) -> bytes:
    """Return the bytes of a file of `root` in one of FORMATS.

    With `depth`, only so many levels below the root; a page has all of them, and starts folded.
    Raises RenderError for any other format, and when it cannot be drawn.
    """
    if form == "txt":
        return text(root, depth=depth).encode()
    if form == "dot":
        return dot(root, direction=direction, depth=depth).encode()
    if form == "html":
        from bt_actions.render.page import page  # here: few calls want one, all load this file

        return page(root, direction=direction, depth=depth).encode()
    if form in FORMATS:
        return draw(dot(root, direction=direction, depth=depth), form)
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
    root: Behaviour, path: Path, *, direction: str | None = None, depth: int | None = None
) -> None:
    """Write `root` to `path` in the format of its suffix: the whole file, or no change.

    Raises RenderError when the suffix is unknown, or the file cannot be drawn or written.
    """
    data = content(root, form_of(path), direction=direction, depth=depth)
    try:
        replace_file(path, data)
    except OSError as error:
        raise RenderError(f"{path}: cannot be written: {error.strerror or error}") from error


def _label(row: Row) -> str:
    name, under = label(row.node)
    small = "<br/>".join(html.escape(line) for line in (*under, left_out(row)) if line)
    large = "<br/>".join(html.escape(line) for line in name)
    return f'{large}<br/><font point-size="8.5">{small}</font>'


def _tooltip(node: Behaviour) -> str:
    place = place_of(node)
    if place is None:
        return clean(node.name)
    return f"{clean(node.name)} ({Path(place.file).name}:{place.line})"


def _quoted(name: str) -> str:
    return '"' + clean(name).replace("\\", "\\\\").replace('"', '\\"') + '"'
