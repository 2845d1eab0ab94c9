"""The card of a node, as tables: its policies, its types, its inputs and outputs.

Most lines come from the behaviour itself, so a node made in Python has tables as well. All texts
are plain: the page escapes them. This file never ticks, sets up or changes a tree, and never
imports rclpy.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import fields
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

from py_trees.behaviour import Behaviour

from bt_actions.behaviours.kinds import action_of
from bt_actions.behaviours.places import in_order
from bt_actions.behaviours.variables import Var
from bt_actions.document.written import document_of, node_of, own_text
from bt_actions.events.snapshot import HIDDEN
from bt_actions.goals.policy import Retry, Timeouts
from bt_actions.messages import fields as ros_fields
from bt_actions.messages.interfaces import PARTS, Kind, interface, interface_name, short_name

if TYPE_CHECKING:
    from bt_actions.document.reading.tree import Document, TreeNode

_OURS = ("py_trees", "bt_actions")
_DEEPEST = 3
"""Levels of messages inside a message."""
_MOST_LINES = 60
"""Lines of one message."""
_MOST_CHARACTERS = 300
"""Characters of one value."""


class Line(NamedTuple):
    """A line of a table; `indent` is how deep a field lies in its message."""

    key: str
    value: str
    indent: int = 0


class Table(NamedTuple):
    """Lines that belong together."""

    title: str
    lines: tuple[Line, ...]


class Card(NamedTuple):
    """The words of a page about a node, beside its events.Node."""

    tables: tuple[Table, ...]
    yaml: str
    """The lines that made the node, without its children; "" for a node made in Python."""


def cards_of(root: Behaviour) -> list[Card]:
    """Return the card of each node of a tree, parents first. Nodes of one type share its tables."""
    types: dict[object, tuple[Table, ...]] = {}
    found = []
    for node in in_order(root):
        written = node_of(node)
        said = tuple(_tables(node, written, document_of(node)))
        used = _interface_of(node, written)
        if used is not None:
            if used not in types:
                types[used] = tuple(_described(*used))
            said += types[used]
        found.append(Card(said, "" if written is None else own_text(written)))
    return found


def _tables(
    node: Behaviour, written: TreeNode | None, document: Document | None
) -> Iterator[Table]:
    """Return the tables of what `node` takes and gives, and of its policies.

    `written` is the node of the document, where there is one. `document` is the tree whose root
    `node` is, or the tree that `node` includes.
    """
    if document is not None:
        yield from _ports(document)
    if action_of(node) is not None:
        yield Table("Action", tuple(_action(node, from_python=written is None)))
    elif type(node).__module__.partition(".")[0] not in _OURS:
        name = f"{type(node).__module__}.{type(node).__qualname__}"
        yield Table("Behaviour", (Line("class", name),))
    timeouts, retry = getattr(node, "timeouts", None), getattr(node, "retry", None)
    if isinstance(timeouts, Timeouts):
        names = (field.name for field in fields(timeouts))
        lines = (Line(name, _seconds(getattr(timeouts, name))) for name in names)
        yield Table("Timeouts", tuple(lines))
    if isinstance(retry, Retry):
        yield Table("Retry", tuple(_retry(retry)))


def _interface_of(node: Behaviour, written: TreeNode | None) -> tuple[type | str, Kind] | None:
    """Return the interface that a node uses, for `_described`; None where a node uses none."""
    kind: Kind
    for attribute, kind in (("action_type", "action"), ("service_type", "srv")):
        found = getattr(node, attribute, None)
        if isinstance(found, type | str) and found:
            return found, kind
    if written is not None:
        name, used = written.values.get("type"), written.kind.interface
        if used is not None and used.kind == "msg" and isinstance(name, str):
            return name, "msg"
    return None


def _described(given: type | str, kind: Kind) -> Iterator[Table]:
    """Return the fields and constants of an interface's messages, or why there are none to tell."""
    try:
        found = interface(given, kind)
        parts = [getattr(found, part, None) for part, of in PARTS.items() if of == kind]
        for part in parts or [found]:
            if isinstance(part, type) and hasattr(part, "get_fields_and_field_types"):
                lines = tuple(islice(_fields(part, 0), _MOST_LINES + 1))
                if len(lines) > _MOST_LINES:
                    lines = (*lines[:_MOST_LINES], Line("…", ""))
                yield Table(short_name(part), lines or (Line("no fields", ""),))
    except (LookupError, ImportError) as error:
        yield Table("Type", (Line("cannot be read here", _cut(str(error))),))


def _action(node: Behaviour, *, from_python: bool) -> Iterator[Line]:
    action = action_of(node)
    assert action is not None
    yield Line("server", action[0])
    kind = getattr(node, "action_type", "")
    yield Line("type", kind if isinstance(kind, str) else interface_name(kind))
    if from_python and hasattr(node, "goal"):
        yield Line("goal", _value(node.goal))
    expect = getattr(node, "expect", None)
    yield Line("expect", "no more than success" if expect is None else _condition(expect))
    saved: Mapping[str, Any] = getattr(node, "save", None) or {}
    for target, place in saved.items():
        name = target if from_python else target.rpartition("/")[2]  # a document's own variable
        yield Line("save", f"{name}: {_condition(place)}")
    yield Line("busy", str(getattr(node, "busy", "wait")))
    resources = sorted(getattr(node, "resources", None) or ())
    yield Line("resources", ", ".join(resources) or f"{action[0]} (its server)")


def _retry(retry: Retry) -> Iterator[Line]:
    if retry.attempts == 1:
        yield Line("attempts", "1: not tried again")
        return
    yield Line("attempts", str(retry.attempts))
    yield Line("backoff", _seconds(retry.backoff))
    yield Line("factor", f"{retry.factor:g}")
    yield Line("max_backoff", _seconds(retry.max_backoff))
    yield Line("jitter", f"{retry.jitter:g}")
    yield Line("outcomes", ", ".join(sorted(retry.outcomes)))
    yield Line("when", "always" if retry.when is None else _condition(retry.when))


def _ports(document: Document) -> Iterator[Table]:
    from bt_actions.document.reading.inputs import inputs_of

    inputs = []
    for name, one in inputs_of(document).items():
        default = HIDDEN if one.secret else _value(one.default)
        given = "required" if one.required else f"{default} {one.unit}".strip()
        inputs.append(Line(name, f"{one.type}, {given}"))
    if inputs:
        yield Table("Inputs", tuple(inputs))
    outputs = []
    for name, declared in document.outputs.items():
        words = (declared.values.get("type"), declared.values.get("unit"))
        outputs.append(Line(name, ", ".join(str(word) for word in words if word)))
    if outputs:
        yield Table("Outputs", tuple(outputs))


def _fields(message: type, depth: int) -> Iterator[Line]:
    for name, kind in ros_fields.describe(message).items():
        if name == "structure_needs_at_least_one_member":  # rosidl's field of an empty message
            continue
        yield Line(name, str(kind), depth)
        inner = kind.item if isinstance(kind, ros_fields.Listing) else kind
        if isinstance(inner, ros_fields.Message) and depth < _DEEPEST:
            yield from _fields(inner.cls, depth + 1)
    for name, value in ros_fields.constants(message).items():
        yield Line(name, f"= {value!r}", depth)


def _seconds(seconds: float | None) -> str:
    return "none" if seconds is None else f"{seconds:g} s"


def _condition(condition: Any) -> str:
    """Return a condition as it was written, where it was written."""
    text = condition if isinstance(condition, str) else getattr(condition, "text", None)
    return _cut(text.strip()) if isinstance(text, str) else _function(condition)


def _function(function: Any) -> str:
    return f"{getattr(function, '__qualname__', type(function).__name__)} (a function)"


def _value(value: Any) -> str:
    return _cut(_plain(value))


def _plain(value: Any) -> str:
    if isinstance(value, Var):
        return f"${value.name}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_plain(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_plain(item) for item in value) + "]"
    if callable(value):
        return _function(value)
    text = value if isinstance(value, str) else repr(value)
    return re.sub(r" at 0x[0-9a-f]+", "", text)  # another one in each process


def _cut(text: str) -> str:
    return text if len(text) <= _MOST_CHARACTERS else f"{text[: _MOST_CHARACTERS - 1]}…"
