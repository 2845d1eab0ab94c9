"""Where the comments of a text are. A '#' that stands in a text of the document begins none.

Asks what was composed, so that it agrees with libyaml: a '#' is a comment's wherever it stands in
no scalar.
"""

from __future__ import annotations

import re
from bisect import bisect
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar
from bt_actions.document.yaml.source import Source

__all__ = ["Comment", "block_header", "comments_of", "content_of", "scalars_of"]

_LATER = (float("inf"), 0.0)
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


def content_of(scalar: Scalar, source: Source) -> str:
    """What is written on the first line of a scalar, behind its anchor and its tag."""
    written = (source.line(scalar.line) or "")[scalar.column - 1 :]
    while (match := _PROPERTY.match(written)) is not None:
        written = written[match.end() :]
    return written


def block_header(scalar: Scalar, source: Source) -> str:
    """``|`` or ``>-`` and the like, where a scalar is a block; else nothing."""
    written = "" if scalar.plain else content_of(scalar, source)
    return written.split(" ")[0].split("\t")[0] if written[:1] in ("|", ">") else ""


def comments_of(source: Source, scalars: Iterable[Scalar]) -> Iterator[Comment]:
    """The comments of a text, in its order, given all of its scalars."""
    lines = source.commented
    texts = sorted(
        _range(scalar, source)
        for scalar in scalars
        if not lines.isdisjoint(range(scalar.line, scalar.end_line + 1))
    )
    for number in sorted(lines):
        line = source.lines[number - 1]
        for at in (at for at, char in enumerate(line, 1) if char == "#"):
            before = bisect(texts, ((number, at), _LATER))
            if not before or texts[before - 1][1] <= (number, at):
                yield Comment(number, at, line[at - 1 :].rstrip(), not line[: at - 1].strip())
                break


def _range(scalar: Scalar, source: Source) -> tuple[tuple[int, int], tuple[float, float]]:
    """Where a scalar begins and ends; behind the header of a block a comment may stand."""
    is_block = block_header(scalar, source) != ""
    begin = (scalar.line + 1, 0) if is_block else (scalar.line, scalar.column)
    return begin, (scalar.end_line, scalar.end_column)
