"""The nodes of a YAML text, which know their range. Knows nothing of behaviour trees.

Scalars are read as YAML 1.2 has them (`on` and `yes` are texts). `compose.py` makes the nodes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from yaml import Mark

from bt_actions.document.findings import Span

_NUMBER_START = frozenset("0123456789+-.")
NULLS = frozenset({"", "~", "null", "Null", "NULL"})
_WORDS: dict[str, object] = dict.fromkeys(NULLS) | {
    "true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False,
}  # fmt: skip
_INTEGER = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"([-+]?)\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_MAX_DIGITS = 400


class Node:
    """A range of the text; lines and columns count from 1, the end is one past the last."""

    __slots__ = ("begin", "end")
    begin: Mark  # marks count from 0
    end: Mark

    @property
    def line(self) -> int:
        return self.begin.line + 1

    @property
    def column(self) -> int:
        return self.begin.column + 1

    @property
    def end_line(self) -> int:
        return self.end.line + 1

    @property
    def end_column(self) -> int:
        return self.end.column + 1


class Scalar(Node):
    """A text; `plain` where the text is written without quotes or a block's sign."""

    __slots__ = ("plain", "text")
    text: str
    plain: bool

    @property
    def value(self) -> object:
        """The value by the core schema of YAML 1.2: None, a bool, an int, a float or a text."""
        text = self.text
        if not self.plain:
            return text
        if text in _WORDS:
            return _WORDS[text]
        return _number(text) if text[0] in _NUMBER_START else text


class Listing(Node):
    """A sequence of nodes."""

    __slots__ = ("flow", "items")
    items: list[Node]
    flow: bool


class Mapping(Node):
    """Pairs in the order of the text; no key is there twice."""

    __slots__ = ("flow", "pairs")
    pairs: list[tuple[Scalar, Node]]
    flow: bool

    def get(self, key: str) -> Node | None:
        """Return the value of a key, or None."""
        for name, value in self.pairs:
            if name.text == key:
                return value
        return None


class Alias(Node):
    """``*name``, where `compose_written` leaves the alias standing."""

    __slots__ = ("name",)
    name: str


def walk(root: Node) -> Iterator[Node]:
    """Yield a node and all nodes in it, keys too; a node that an alias repeats comes once."""
    stack, seen = [root], set[int]()
    while stack:
        node = stack.pop()
        if id(node) in seen:
            continue
        yield node
        if isinstance(node, Listing):
            seen.add(id(node))
            stack.extend(node.items)
        elif isinstance(node, Mapping):
            seen.add(id(node))
            for pair in node.pairs:
                stack.extend(pair)


def span_of(node: Node) -> Span:
    """Return the range of a node."""
    return Span(node.line, node.column, node.end_line, node.end_column)


def start_of(node: Node) -> Span:
    """Return the range of a node's first character."""
    return Span(node.line, node.column, node.line, node.column + 1)


def beyond_floats(node: Scalar) -> bool:
    """Return whether a scalar is a finite number beyond the range of float64."""
    value = node.value
    return isinstance(value, float) and math.isinf(value) and "inf" not in node.text.lower()


def data_of(node: Node) -> object:
    """Return a node as plain data: a dollar sign has no meaning in the data.

    A node that an alias repeats becomes one object. Raises ValueError for a number beyond the range
    of float64.
    """
    return _data_of(node, {})


def _data_of(node: Node, known: dict[int, object]) -> object:
    if isinstance(node, Scalar):
        if beyond_floats(node):
            raise ValueError(f"{node.text} does not fit a float64")
        return node.value
    if id(node) not in known:
        if isinstance(node, Listing):
            known[id(node)] = [_data_of(item, known) for item in node.items]
        else:
            assert isinstance(node, Mapping)
            known[id(node)] = {key.text: _data_of(value, known) for key, value in node.pairs}
    return known[id(node)]


def _number(text: str) -> object:
    if len(text) > _MAX_DIGITS:
        return text
    if _INTEGER.fullmatch(text):
        return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    special = _SPECIAL.fullmatch(text)
    if special is not None:
        return float((special[1] or "") + ("inf" if "i" in text.lower() else "nan"))
    return text
