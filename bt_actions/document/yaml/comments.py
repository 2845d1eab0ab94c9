"""Where the comments of a text are. A '#' that stands in a text of the document begins none.

Asks what was composed, so that it agrees with libyaml: a '#' is a comment's wherever it stands in
no scalar.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar
from bt_actions.document.yaml.source import Source

_PROPERTY = re.compile(r"[&!]\S*\s+")


class Comment(NamedTuple):
    """A comment, from its '#' on; `alone` when nothing stands before it. Line and column from 1."""

    line: int
    column: int
    text: str
    alone: bool


def scalars_of(root: Node) -> Iterator[Scalar]:
    """Every scalar below a node, keys too; what an alias repeats comes once."""
    stack = [root]
    seen: set[int] = set()
    while stack:
        node = stack.pop()
        if isinstance(node, Scalar):
            yield node
        elif id(node) in seen:
            continue
        elif isinstance(node, Listing):
            seen.add(id(node))
            stack.extend(node.items)
        elif isinstance(node, Mapping):
            seen.add(id(node))
            for key, value in node.pairs:
                stack += [key, value]


def block_header(scalar: Scalar, source: Source) -> str:
    """``|`` or ``>-`` and the like, where a scalar is a block; else nothing."""
    if scalar.plain:
        return ""
    written = (source.line(scalar.line) or "")[scalar.column - 1 :]
    while (match := _PROPERTY.match(written)) is not None:
        written = written[match.end() :]
    if written[:1] not in ("|", ">"):
        return ""
    return written.split(" ")[0].split("\t")[0]


def comments_of(source: Source, scalars: Iterable[Scalar]) -> Iterator[Comment]:
    """The comments of a text, in its order, given all of its scalars."""
    marked = {number for number, line in enumerate(source.lines, 1) if "#" in line}
    texts: dict[int, list[tuple[int, float]]] = {}
    for scalar in scalars:
        if marked.isdisjoint(range(scalar.line, scalar.end_line + 1)):
            continue
        for number, start, end in _parts(scalar, source):
            if number in marked:
                texts.setdefault(number, []).append((start, end))
    for number in sorted(marked):
        line = source.lines[number - 1]
        at = _first_outside(line, texts.get(number, ()))
        if at >= 0:
            yield Comment(number, at + 1, line[at:].rstrip(), not line[:at].strip())


def _parts(scalar: Scalar, source: Source) -> Iterator[tuple[int, int, float]]:
    """The part of each line that belongs to a scalar, as columns from 0; the end is outside."""
    first, last = scalar.line, scalar.end_line
    if first == last:
        yield first, scalar.column - 1, scalar.end_column - 1
        return
    header = block_header(scalar, source)
    if header:
        at = (source.line(first) or "").find(header, scalar.column - 1)
        yield first, scalar.column - 1, at + len(header)
    else:
        yield first, scalar.column - 1, float("inf")
    for line in range(first + 1, last):
        yield line, 0, float("inf")
    if scalar.end_column > 1:
        yield last, 0, float("inf") if header else scalar.end_column - 1


def _first_outside(line: str, texts: Iterable[tuple[int, float]]) -> int:
    """Where the first '#' stands that is in none of the ranges, or -1."""
    at = line.find("#")
    while at >= 0 and any(start <= at < end for start, end in texts):
        at = line.find("#", at + 1)
    return at
