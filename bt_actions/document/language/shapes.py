"""The forms of values with parts: lists, tables, records, data with variables in it.

`keys.py` and `kinds.py` give each key its form. A form reports mistakes to the source and then
gives BAD; a form knows nothing else of the document.
"""

from __future__ import annotations

from collections.abc import Container
from collections.abc import Mapping as MappingType
from dataclasses import dataclass

from bt_actions.document.findings.elsewhere import as_mapping, key_here
from bt_actions.document.language.scalars import (
    Choice,
    Name,
    Place,
    Schema,
    Shape,
    is_computed,
    read_computed,
    wrong_form,
)
from bt_actions.document.language.values import BAD, read_value
from bt_actions.document.yaml.nodes import Listing, Mapping, Node, Scalar, span_of, start_of
from bt_actions.document.yaml.source import Source
from bt_actions.utilities.suggest import did_you_mean

_NAME = Name()


@dataclass(frozen=True, slots=True)
class AnyValue:
    """Anything, with `$name` in it."""

    words: str = "a value"

    def read(self, node: Node, source: Source) -> object:
        return read_value(node, source)

    def schema(self) -> Schema:
        return {}


@dataclass(frozen=True, slots=True)
class Values:
    """A mapping of fields (or names) to values, with `$name` in them, or `$name` for one."""

    words: str = "a mapping of fields to values"
    form: type[Node] = Mapping

    def read(self, node: Node, source: Source) -> object:
        if is_computed(node):
            return read_computed(self, node, source)
        if isinstance(node, self.form):
            return read_value(node, source)
        meant = isinstance(node, Scalar) and self.form is Mapping and as_mapping(node.text)
        return wrong_form(self, node, source, hint=meant or None)

    def schema(self) -> Schema:
        return {"type": ["object" if self.form is Mapping else "array", "string"]}


@dataclass(frozen=True, slots=True)
class ListValue(Values):
    """A list of any values, or `$name` for one."""

    words: str = "a list"
    form: type[Node] = Listing


@dataclass(frozen=True, slots=True)
class ListOf:
    """A list; with `single`, one item may stand without the brackets."""

    item: Shape
    single: bool = False
    words: str = "a list"

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Listing):
            if self.single and isinstance(node, Scalar):
                value = self.item.read(node, source)
                return BAD if value is BAD else [value]
            return wrong_form(self, node, source)
        items = [self.item.read(item, source) for item in node.items]
        return BAD if any(item is BAD for item in items) else items

    def schema(self) -> Schema:
        listing: Schema = {"type": "array", "items": self.item.schema()}
        return {"anyOf": [listing, self.item.schema()]} if self.single else listing


@dataclass(frozen=True, slots=True)
class Table:
    """A mapping from names to values of one form."""

    item: Shape
    words: str = "a mapping"

    def read(self, node: Node, source: Source) -> object:
        if isinstance(node, Scalar) and node.plain and node.text == "":
            return {}
        if not isinstance(node, Mapping):
            return wrong_form(self, node, source, hint=self._meant(node))
        found: dict[str, object] = {}
        for key, inner in node.pairs:
            name = _NAME.read(key, source)
            value = self.item.read(inner, source)
            if name is BAD:
                source.unread.nodes += (key, inner)
                continue
            found[key.text] = value
            if value is BAD:
                source.unread.nodes.append(inner)
        return found

    def _meant(self, node: Node) -> str | None:
        if isinstance(node, Listing):
            named = any(isinstance(item, Mapping) for item in node.items)
            return "each name is a key here, and begins with no '-'" if named else None
        assert isinstance(node, Scalar)
        root = min(self.item.roots) if isinstance(self.item, Place) else None
        return as_mapping(node.text, "" if isinstance(self.item, Name) else root)

    def schema(self) -> Schema:
        return {
            "type": ["object", "null"],
            "propertyNames": _NAME.schema(),
            "additionalProperties": self.item.schema(),
        }


@dataclass(frozen=True, slots=True)
class Key:
    """A key that may stand in a mapping."""

    name: str
    shape: Shape
    doc: str
    required: bool = False
    default: str | None = None
    example: str = ""

    @property
    def hint(self) -> str:
        """The words to write where the key is missing."""
        return f"{self.doc.removesuffix('.')}, such as {self.name}: {self.example}"


def required_in(keys: MappingType[str, Key]) -> tuple[Key, ...]:
    """Return the required keys."""
    return tuple(key for key in keys.values() if key.required)


@dataclass(frozen=True, slots=True)
class Record:
    """A mapping with known keys; `short` is the key that a bare value stands for."""

    words: str
    keys: MappingType[str, Key]
    short: str | None = None

    def read(self, node: Node, source: Source) -> object:
        if not isinstance(node, Mapping):
            if self.short is not None and isinstance(node, Scalar):
                value = node.value
                if "default" in self.keys and isinstance(value, bool | int | float):
                    kind = {bool: "bool", int: "int64"}.get(type(value), "float64")
                    hint = f"write {{type: {kind}, default: {node.text}}}"
                    return wrong_form(self.keys[self.short].shape, node, source, hint=hint)
                value = self.keys[self.short].shape.read(node, source)
                return BAD if value is BAD else {self.short: value}
            needs = required_in(self.keys)
            hint = f"write {{{', '.join(f'{one.name}: {one.example}' for one in needs)}}}"
            return wrong_form(self, node, source, hint=hint if needs else None)
        return read_keys(node, self.keys, source)

    def schema(self) -> Schema:
        schema = keys_schema(self.keys)
        if self.short is not None:
            return {"anyOf": [self.keys[self.short].shape.schema(), schema]}
        return schema


@dataclass(frozen=True, slots=True)
class OneOf:
    """A word out of a few, or a record."""

    choice: Choice
    record: Record

    @property
    def words(self) -> str:
        return f"{self.choice.words}, or {self.record.words}"

    def read(self, node: Node, source: Source) -> object:
        if isinstance(node, Scalar):
            return self.choice.read(node, source, self.words)
        return self.record.read(node, source)

    def schema(self) -> Schema:
        return {"anyOf": [self.choice.schema(), self.record.schema()]}


def read_keys(
    node: Mapping,
    keys: MappingType[str, Key],
    source: Source,
    elsewhere: Container[str] = (),
) -> dict[str, object]:
    """Read the values of a mapping's keys, and report unknown and missing keys.

    Keys that are read `elsewhere` are left out.
    """
    values: dict[str, object] = {}
    unknown = False
    for key, inner in node.pairs:
        if key.text in elsewhere:
            continue
        known = keys.get(key.text)
        if known is None:
            unknown = True
            report_unknown_key(key, keys, source)
            source.unread.nodes += (key, inner)
            continue
        value = values[key.text] = known.shape.read(inner, source)
        if value is BAD:
            source.unread.nodes.append(inner)
    if not unknown:  # a misspelt key would be reported twice
        for key_model in keys.values():
            name = key_model.name
            if key_model.required and name not in values and name not in elsewhere:
                at = start_of(node) if elsewhere else span_of(node)
                source.report("BT108", at, f"the key {name!r} is missing", hint=key_model.hint)
                source.unread.nodes.append(node.pairs[0][0] if node.pairs else node)
    return values


def report_unknown_key(
    key: Scalar, known: MappingType[str, object], source: Source, hint: str | None = None
) -> None:
    """Report a key that cannot stand in its place; `hint` says what to do instead, if known."""
    here, instead = key_here(key.text, known) if hint is None else (None, hint)
    near = f"; here it is '{here}'" if here else ""
    if not near and not instead:
        near = did_you_mean(key.text, known)
    there = f"the keys here are {', '.join(known)}" if known else "no other key can stand here"
    hint = instead or (None if near else there)
    source.report("BT107", span_of(key), f"unknown key {key.text!r}{near}", hint=hint)


def keys_schema(keys: MappingType[str, Key]) -> Schema:
    """Return the JSON Schema of a mapping with known keys."""
    schema: Schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            key.name: {"description": key.doc, **key.shape.schema()} for key in keys.values()
        },
    }
    required = [key.name for key in required_in(keys)]
    if required:
        schema["required"] = required
    return schema
