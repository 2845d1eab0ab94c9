"""The forms of single values: texts, names, numbers, durations, choices, expressions, type names.

A form reports mistakes to the source and then gives BAD; a form knows nothing else of the document.
The file begins with the parts that all forms share: the protocol, and the report of a wrong form.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from typing import Literal, Protocol

from bt_actions.document.findings.elsewhere import notation_here
from bt_actions.document.language.types import meant_type
from bt_actions.document.language.values import BAD, Computed, read_expression, read_value
from bt_actions.document.yaml.mistaken import (
    report_braces,
    warn_bare_duration,
    warn_cut,
    warn_quotes,
)
from bt_actions.document.yaml.nodes import NULLS, Listing, Mapping, Node, Scalar, span_of
from bt_actions.document.yaml.source import Source, spoken
from bt_actions.utilities.suggest import did_you_mean
from bt_actions.utilities.units import DURATION_UNITS, parse_duration

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_MARKED = re.compile(r"\$(?:[({]+\s*)?[A-Za-z_]")
"""A variable in a text or an expression, also in the notation of other tools."""
GREATEST = sys.float_info.max
_NAME_LIMIT = 200
Schema = dict[str, object]
_ALONE = re.compile(r"\$\(\s*([^()$]*?)\s*\)")


class Shape(Protocol):
    """A form of a value."""

    @property
    def words(self) -> str:
        """The form in words, for messages and the reference: ``a duration, such as 5 s``."""

    def read(self, node: Node, source: Source) -> object:
        """Return the value, or BAD after a report."""

    def schema(self) -> Schema:
        """Return the JSON Schema of the form."""


def words_for(node: Node) -> str:
    """Say what a node is, for a message."""
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
    """Return whether a node is `$name` or computed."""
    return isinstance(node, Scalar) and node.text.startswith(("$", "= "))


def read_computed(shape: Shape, node: Node, source: Source) -> object:
    """Return the computed value in place of a form; a text with `$(name)` in it is not one."""
    value = read_value(node, source)
    if value is BAD or isinstance(value, Computed):
        return value
    assert isinstance(node, Scalar)
    alone = _ALONE.fullmatch(node.text)
    hint = f"write '${alone[1]}'" if alone else "write '$name', or '= ' before an expression"
    return wrong_form(shape, node, source, hint=f"$(...) stands inside a text: {hint}")


def _or_variable(schema: Schema, values: bool) -> Schema:
    """Return a schema that also lets a variable stand for the value, where `values` says so."""
    if not values:
        return schema
    return {"anyOf": [schema, {"type": "string", "pattern": r"^(\$[A-Za-z_]|= )"}]}


@dataclass(frozen=True, slots=True)
class Text:
    """A text; with `values`, `$(name)` may stand in it."""

    words: str = "a text"
    values: bool = False

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Scalar) or not isinstance(node.value, str):
            return wrong_form(self, node, source)
        if self.values:
            return read_value(node, source)
        warn_cut(node, source, "text")
        warn_quotes(node, source)
        return node.text

    def schema(self) -> Schema:
        return {"type": "string"}


@dataclass(frozen=True, slots=True)
class NodeName:
    """The name of a node; `optional` where the kind itself names the node well enough."""

    optional: bool = False
    words: str = "a name"

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Scalar):
            return wrong_form(self, node, source)
        if node.plain and node.text == "" and self.optional:
            return None
        text = node.text
        if not text.strip():
            source.report("BT113", span_of(node), "a node needs a name")
            return BAD
        if ":" in text:
            source.report(
                "BT113", span_of(node), f"a colon cannot stand in a node's name: {text!r}",
                hint="tools that draw trees take 'a:b' for a port of the node 'a'",
            )  # fmt: skip
            return BAD
        if not text.isprintable():
            odd = _odd(text)
            source.report("BT113", span_of(node), f"{odd} cannot stand in a node's name")
            return BAD
        if len(text) > _NAME_LIMIT:
            source.report("BT113", span_of(node), "a name is one line of up to 200 characters")
            return BAD
        if source.commented:
            warn_cut(node, source, "name")
        warn_quotes(node, source)
        if _MARKED.search(text):
            source.report(
                "BT319", span_of(node), f"no value is put into a name: it stays {text!r}",
                hint="leave the '$' away; 'log: ...' beside the node can show the value",
            )  # fmt: skip
        return text

    def schema(self) -> Schema:
        pattern: Schema = {"type": ["string", "number", "boolean"], "pattern": "^[^:]+$"}
        return {"anyOf": [pattern, {"type": "null"}]} if self.optional else pattern


@dataclass(frozen=True, slots=True)
class Name:
    """A word that names a thing in this document: an input, a variable, an action."""

    words: str = "a name of letters, digits and underscores"

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Scalar):
            return wrong_form(self, node, source)
        if not _IDENTIFIER.fullmatch(node.text) or len(node.text) > _NAME_LIMIT:
            odd = _odd(node.text)
            source.report(
                "BT113", span_of(node), f"{node.text!r} is no name",
                hint=f"{odd} stands in it" if odd is not None
                else "letters, digits and underscores, beginning with a letter",
            )  # fmt: skip
            return BAD
        if not isinstance(node.value, str):
            return wrong_form(self, node, source)
        return node.text

    def schema(self) -> Schema:
        return {"type": "string", "pattern": f"^{_IDENTIFIER.pattern}$"}


def _odd(text: str) -> str | None:
    """Name the first character of a text that nobody sees."""
    if text.isprintable():
        return None
    return next(spoken(char) for char in text if not char.isprintable())


@dataclass(frozen=True, slots=True)
class Flag:
    """True or false, or a third `word`."""

    word: str = ""

    @property
    def words(self) -> str:
        return f"true, false or {self.word}" if self.word else "true or false"

    def read(self, node: Node, source: Source) -> object:
        if isinstance(node, Scalar):
            if isinstance(node.value, bool):
                return node.value
            if self.word and node.text == self.word:
                return self.word
        return wrong_form(self, node, source)

    def schema(self) -> Schema:
        flag: Schema = {"type": "boolean"}
        return {"anyOf": [flag, {"const": self.word}]} if self.word else flag


@dataclass(frozen=True, slots=True)
class Whole:
    """A whole number of at least `least`; with `values`, `$name` may stand for it, or a `word`."""

    least: int = 0
    values: bool = False
    word: str = ""

    @property
    def words(self) -> str:
        return f"a whole number or {self.word}" if self.word else "a whole number"

    def read(self, node: Node, source: Source) -> object:
        if self.values and is_computed(node):
            return read_computed(self, node, source)
        if self.word and isinstance(node, Scalar) and node.text == self.word:
            return self.word
        value = node.value if isinstance(node, Scalar) else None
        if isinstance(value, bool) or not isinstance(value, int):
            return wrong_form(self, node, source)
        if value < self.least:
            source.report("BT110", span_of(node), f"at least {self.least} is needed, not {value}")
            return BAD
        return value

    def schema(self) -> Schema:
        number: Schema = {"type": "integer", "minimum": self.least}
        if self.word:
            return {"anyOf": [number, {"const": self.word}]}
        return _or_variable(number, self.values)


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number between two bounds."""

    least: float = 0.0
    most: float = float("inf")
    words: str = "a number"

    def read(self, node: Node, source: Source) -> object:
        value = node.value if isinstance(node, Scalar) else None
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return wrong_form(self, node, source)
        if not self.least <= value <= min(self.most, GREATEST):
            most = "" if self.most == float("inf") else f" and at most {self.most:g}"
            text = f"a number of at least {self.least:g}{most} is needed, not {words_for(node)}"
            source.report("BT110", span_of(node), text)
            return BAD
        return float(value)

    def schema(self) -> Schema:
        schema: Schema = {"type": "number", "minimum": self.least}
        if self.most != float("inf"):
            schema["maximum"] = self.most
        return schema


@dataclass(frozen=True, slots=True)
class Duration:
    """Seconds, from ``500 ms`` or a bare number; `or_none` lets ``none`` mean no limit."""

    or_none: bool = False
    zero: bool = False
    values: bool = False

    @property
    def words(self) -> str:
        return (
            "a duration, such as 5 s," if not self.or_none else "a duration, such as 5 s, or none"
        )

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Scalar):
            return wrong_form(self, node, source)
        if self.or_none and node.text == "none":
            return None
        if self.values and is_computed(node):
            return read_computed(self, node, source)
        try:
            seconds = parse_duration(node.value)
        except ValueError as error:
            hint = notation_here(node.text)
            source.report("BT110", span_of(node), str(error), hint=hint)
            return BAD
        if seconds == 0 and not self.zero:
            source.report("BT110", span_of(node), "a duration here is more than zero")
            return BAD
        warn_bare_duration(node, seconds, source)
        return seconds

    def schema(self) -> Schema:
        units = "|".join(DURATION_UNITS)
        pattern = rf"^[+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)? *({units})?$"
        forms: list[object] = [
            {"type": "number", "minimum": 0},
            {"pattern": pattern, "type": "string"},
        ]
        if self.or_none:
            forms.append({"const": "none"})
        return _or_variable({"anyOf": forms}, self.values)


@dataclass(frozen=True, slots=True)
class Choice:
    """One of some words."""

    options: tuple[str, ...]

    @property
    def words(self) -> str:
        return f"one of {', '.join(self.options)}"

    def read(self, node: Node, source: Source, words: str = "") -> object:
        """Return the word; `words` say what else may stand here."""
        if not isinstance(node, Scalar):
            return wrong_form(self, node, source)
        if node.text in self.options:
            return node.text
        near = did_you_mean(node.text, self.options)
        hint = None if near else notation_here(node.text) or words or self.words
        source.report(
            "BT110", span_of(node), f"{words_for(node)} is not known here{near}", hint=hint
        )
        return BAD

    def schema(self) -> Schema:
        return {"enum": list(self.options)}


@dataclass(frozen=True, slots=True)
class Condition:
    """An expression that is true or false."""

    roots: frozenset[str] = frozenset()
    words: str = "an expression"

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Scalar) or (node.plain and node.text in NULLS):
            return wrong_form(self, node, source)
        expression = read_expression(node, source, node.text, 0, self.roots)
        if expression is None:
            return BAD
        if source.commented:
            warn_cut(node, source, "expression")
        return Computed(expression, node)

    def schema(self) -> Schema:
        return {"type": ["string", "boolean"]}


@dataclass(frozen=True, slots=True)
class Place(Condition):
    """A place in a result or a message, or an expression over it: ``result.pose.position``."""

    words: str = "a place, such as result.final_pose,"

    def schema(self) -> Schema:
        return {"type": "string"}


@dataclass(frozen=True, slots=True)
class TypeName:
    """The name of a ROS interface, or (kind `value`) of a type that a variable can have."""

    kind: Literal["action", "srv", "msg", "value"]

    @property
    def words(self) -> str:
        if self.kind == "value":
            return "a type, such as float64, string[] or geometry_msgs/msg/Pose,"
        return f"a type name, such as package/{self.kind}/Name,"

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Scalar) or not isinstance(node.value, str) or not node.text:
            return wrong_form(self, node, source)
        if self.kind != "value" and not re.fullmatch(_TYPE_NAMES[self.kind], node.text):
            text = f"{node.text!r} is no type name"
            if "_" in node.text.rpartition("/")[2] and "/" in node.text:
                text += ": its last part has no '_'"
            hint = meant_type(node.text, self.kind) or f"it is written package/{self.kind}/Name"
            source.report("BT207", span_of(node), text, hint=hint)
            return BAD
        return node.text

    def schema(self) -> Schema:
        if self.kind == "value":
            return {"type": "string"}
        return {"type": "string", "pattern": f"^{_TYPE_NAMES[self.kind]}$"}


_TYPE_NAMES = {
    kind: rf"[a-z][a-z0-9_]*/(?:{kind}/)?[A-Za-z][A-Za-z0-9]*" for kind in ("action", "srv", "msg")
}
