"""What all forms of values have in common: the protocol, and how wrong forms are reported."""

from __future__ import annotations

import re
from typing import Protocol

from bt_actions.document.findings.elsewhere import notation_here
from bt_actions.document.language.values import BAD, Computed, read_value
from bt_actions.document.yaml.mistaken import report_braces
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar, span_of
from bt_actions.document.yaml.source import Source

__all__ = [
    "Schema",
    "Shape",
    "is_computed",
    "or_variable",
    "read_computed",
    "words_for",
    "wrong_form",
]

Schema = dict[str, object]
_ALONE = re.compile(r"\$\(\s*([^()$]*?)\s*\)")


class Shape(Protocol):
    """A form of a value."""

    @property
    def words(self) -> str:
        """What is needed, as a message and the reference say it: ``a duration, such as 5 s``."""

    def read(self, node: Node, source: Source) -> object:
        """The value, or BAD after reporting what is wrong."""

    def schema(self) -> Schema:
        """JSON Schema for it."""


def words_for(node: Node) -> str:
    """What a node is, as a message says it."""
    if isinstance(node, Mapping):
        return "a mapping"
    if isinstance(node, Listing):
        return "a list"
    assert isinstance(node, Scalar)
    value = node.value
    if value is None:
        return "nothing"
    if isinstance(value, str):
        return repr(value) if len(value) <= 40 else f"{value[:37]!r}..."
    return node.text if len(node.text) <= 40 else f"{node.text[:37]}..."


def wrong_form(shape: Shape, node: Node, source: Source, *, hint: str | None = None) -> object:
    """Report that a node is not of a form."""
    if report_braces(node, source):
        return BAD
    if (
        hint is None
        and isinstance(node, Scalar)
        and "text" in shape.words
        and not isinstance(node.value, str)
    ):
        hint = f'to mean the text, write "{node.text}"' if node.text else None
    if hint is None and isinstance(node, Scalar):
        hint = notation_here(node.text)
    message = f"{shape.words} is needed, not {words_for(node)}"
    source.report("BT109", span_of(node), message, hint=hint)
    return BAD


def is_computed(node: Node) -> bool:
    """Whether a node is `$name` or computed."""
    return isinstance(node, Scalar) and node.text.startswith(("$", "= "))


def read_computed(shape: Shape, node: Node, source: Source) -> object:
    """What is computed in the place of a value of a form; a text with `$(name)` in it is not."""
    value = read_value(node, source)
    if value is BAD or isinstance(value, Computed):
        return value
    assert isinstance(node, Scalar)
    alone = _ALONE.fullmatch(node.text)
    hint = f"write '${alone[1]}'" if alone else "write '$name', or '= ' before an expression"
    return wrong_form(shape, node, source, hint=f"$(...) stands inside a text: {hint}")


def or_variable(schema: Schema, values: bool) -> Schema:
    """A schema that lets a variable stand for the value, where `values` says so."""
    if not values:
        return schema
    return {"anyOf": [schema, {"type": "string", "pattern": r"^(\$[A-Za-z_]|= )"}]}
