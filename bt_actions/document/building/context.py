"""The context of a node that is built: its document, its variables, its namespace. Builds nothing.

The variables of a loaded tree lie on py_trees' blackboard under a namespace of their own. The
blackboard is global to the process and has no lock: read and write on the ticking thread only.
"""

from __future__ import annotations

import ast
import itertools
import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from operator import attrgetter
from typing import Any

from py_trees.blackboard import Blackboard, KeyMetaData

from bt_actions.behaviours.leaves import stood_for
from bt_actions.behaviours.reading import Formula, Names
from bt_actions.behaviours.topics import TopicValue
from bt_actions.behaviours.variables import hide, is_hidden, unhide, value_of, write
from bt_actions.document.language.classes import Python
from bt_actions.document.language.ros_names import INPUT, why_not
from bt_actions.document.language.types import parse_type
from bt_actions.document.language.values import Computed, computed_in, refuse_large, resolve
from bt_actions.document.reading.inputs import InputError, convert
from bt_actions.document.reading.tree import (
    Declared,
    Document,
    TreeNode,
    join_names,
    table_of,
    text_of,
)
from bt_actions.document.yaml.nodes import Scalar
from bt_actions.expressions.expression import Expression
from bt_actions.messages import fields

_NUMBERS = {*fields.FLOATS, *fields.INTEGERS} - {"byte"}
_NAME_ALONE = re.compile(r"\$[\w.]+")
_ODD = re.compile(r"[^A-Za-z0-9_]")
_LOADS = "/bt/loads"
"""The blackboard's key of its own `_Loads`: a cleared blackboard begins with a new one."""


class _Loads:
    """The loads of a blackboard: their numbers, and those that are gone. Atomic steps only."""

    def __init__(self) -> None:
        self.numbers = itertools.count(1)
        self.gone: deque[str] = deque()
        """Prefixes without a scope any more; the collector may come in the middle of a tick."""


class Scope:
    """The names of a tree and the places of their values; `topics` come before the blackboard."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self._outer: Scope | None = None
        self._gone: deque[str] | None = None
        self._children: dict[str, int] = {}

    def __repr__(self) -> str:
        return f"<Scope {self.prefix}>"

    @classmethod
    def of_load(cls, tree: str) -> Scope:
        """Return the scope of a tree that is loaded now; no other load has the same.

        A later load forgets the variables, once nothing of the tree is left.
        """
        loads = Blackboard.storage.setdefault(_LOADS, _Loads())
        while True:
            try:
                prefix = f"{loads.gone.popleft()}/"
            except IndexError:
                break
            for key in [key for key in list(Blackboard.storage) if key.startswith(prefix)]:
                Blackboard.unset(key)
                unhide([key])
            for key in [key for key in list(Blackboard.metadata) if key.startswith(prefix)]:
                Blackboard.metadata.pop(key, None)
        scope = cls(f"/bt/{_safe(tree)}/{next(loads.numbers)}")
        scope._gone = loads.gone
        return scope

    def __del__(self) -> None:
        if self._gone is not None:
            self._gone.append(self.prefix)

    def inner(self, tree: str) -> Scope:
        """Return the scope of a tree included in this one."""
        name = _safe(tree)
        number = self._children[name] = self._children.get(name, 0) + 1
        scope = Scope(f"{self.prefix}/{name}_{number}")
        scope._outer = self  # the outer scope lives as long, with its variables
        return scope

    def key(self, name: str) -> str:
        """Return the blackboard key of a variable."""
        return f"{self.prefix}/{name}"

    def read(self, name: str) -> object:
        """Return the value of a variable. Raises KeyError for one without a value."""
        return value_of(self.key(name))

    def write(self, name: str, value: object) -> None:
        """Give a variable a value."""
        self.write_all({name: value})

    def write_all(self, values: Mapping[str, object]) -> None:
        """Give several variables their values."""
        write({self.key(name): value for name, value in values.items()})
        for name in values:
            Blackboard.metadata.setdefault(self.key(name), KeyMetaData())

    def hide(self, names: Iterable[str]) -> None:
        """Keep the values of these variables out of all events."""
        hide(map(self.key, names))

    def hides(self, name: str) -> bool:
        """Return whether events leave a variable's value out."""
        return is_hidden(self.key(name))

    def clear(self, name: str) -> None:
        """Take a variable's value away, if it has one."""
        Blackboard.unset(self.key(name))


def _safe(name: str) -> str:
    return _ODD.sub("_", name) or "tree"


@dataclass(frozen=True, slots=True)
class Context:
    """The context of a node that is built: its document, its variables, its namespace."""

    document: Document
    scope: Scope
    namespace: str
    types: bool
    topics: Mapping[str, TopicValue]
    python: Python = True
    """The ``python:`` nodes that may be made."""
    once: bool = False
    static: Mapping[str, object] = field(default_factory=dict)
    """The inputs with values known before the tree runs, for the names of servers."""
    shared: dict[str | None, dict[str, Any]] = field(default_factory=dict)
    """Common parts of nodes that set nothing but a goal and a `save` of their own, by action."""

    def read(self, name: str) -> object:
        """Return a variable's value. Raises KeyError without one, ExpressionError for a topic's.

        A topic's name is a variable, too: the latest message.
        """
        topic = self.topics.get(name)
        return self.scope.read(name) if topic is None else topic.read()

    def write(self, values: Mapping[str, object]) -> None:
        """Give variables their values, converted by `fitting`; all or none."""
        self.scope.write_all({name: self.fitting(name, value) for name, value in values.items()})

    def fitting(self, name: str, value: object) -> object:
        """Convert a value to the variable's declared type.

        Raises ValueError for a value that does not fit, or is too large to be kept.
        """
        kind = self._declared(name)
        try:
            refuse_large(value)
            return value if kind is None else convert(value, kind, types=self.types)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None

    def named(self, node: TreeNode, words: str, about: str | None = None) -> str:
        """Return a node's name, or `words` with the node's text, or `about`, in place of `{}`."""
        return node.name or plain_name(words.format(written_text(node) if about is None else about))

    def name(self, values: Mapping[str, object], key: str) -> str:
        """Return a ROS name in the namespaces that hold here."""
        return self.joined(values, text_of(values, key))

    def namespace_of(self, values: Mapping[str, object]) -> str:
        """Return the namespaces that hold below a node."""
        return join_names(self.namespace, filled(text_of(values, "namespace"), self.static))

    def joined(self, values: Mapping[str, object], name: str) -> str:
        """Return a name in the namespaces that hold here."""
        return join_names(self.namespace_of(values), filled(name, self.static))

    def default(self, topic: Declared) -> Callable[[], object]:
        """Return the default of a topic as a function, which raises ValueError."""
        kind, written = str(topic.values["type"]), topic.values["default"]
        if computed_in(written):
            compute = self.value(written)
            return lambda: convert(compute(), kind, types=self.types)
        message = convert(written, kind, types=self.types)
        return lambda: message

    def value(self, written: object) -> Callable[[], object]:
        """Return a function that computes a value of the document."""
        return lambda: resolve(written, self.read)

    def condition(self, written: object, names: Names) -> Formula | None:
        """Return a condition over a result as a function of the result."""
        if not isinstance(written, Computed):
            return None
        return Formula(written.expression, names, self.read)

    def saved(
        self, written: object, names: Names, cls: type | None = None
    ) -> dict[str, Callable[[Any], object]]:
        """Return the values that `save` keeps, by blackboard key, as functions of a result.

        The functions raise ValueError for a missing value, or one that does not fit its variable.
        `cls` is the message class of the result, where that is known.
        """
        return {
            self.scope.key(name): Formula(
                place.expression,
                names,
                self.read,
                partial(self.fitting, name),
                _numbers(place.expression, cls, self._declared(name)),
            )
            for name, place in table_of(written).items()
        }

    def _declared(self, name: str) -> str | None:
        """Return the type of a variable, where it is declared."""
        declared = self.document.outputs.get(name) or self.document.inputs.get(name)
        kind = None if declared is None else declared.values.get("type")
        return kind if isinstance(kind, str) else None

    def said(self, written: object) -> str:
        """Return a condition in one short line."""
        assert isinstance(written, Computed)
        return plain_name(written.expression.text)

    def why_not(self, key: str, written: object) -> Callable[[], str]:
        """Return a function that says why a condition is false; or "" where it is true.

        The function raises ValueError where the condition cannot be computed.
        """
        assert isinstance(written, Computed)
        expression, holds = written.expression, self.holds(written)

        def why_not() -> str:
            try:
                if holds():
                    return ""
            except ValueError as error:
                name = next(iter(expression.variables), "name")
                asks = f"'known(${name})' asks whether it has a value"
                raise ValueError(f"{key}: {error}; {asks}") from None
            text = expression.text.strip()
            stood = stood_for(expression, self.read)
            if _NAME_ALONE.fullmatch(text):
                stood = ""
            return f"{text} is false{stood}"

        return why_not

    def holds(self, written: object) -> Callable[[], bool]:
        """Return a condition over variables alone as a function, which raises ExpressionError."""
        assert isinstance(written, Computed)
        return lambda: written.expression.holds({}, self.read)


@lru_cache(maxsize=1024)
def _numbers(
    expression: Expression, cls: type | None, declared: str | None
) -> Callable[[Any], object] | None:
    """Return a quick getter for a field of numbers of its variable's type; None for any other."""
    path, node = list[str](), expression.tree
    while isinstance(node, ast.Attribute):
        path.insert(0, node.attr)
        node = node.value
    if cls is None or not path or not isinstance(node, ast.Name) or node.id != "result":
        return None
    kind: fields.FieldType | None = fields.Message(cls)
    for part in path:
        inner = fields.describe(kind.cls) if isinstance(kind, fields.Message) else {}
        kind = inner.get(part)
    if kind == fields.Scalar("float32"):  # a float32 is read by its fewest digits
        return None
    item = kind.item if isinstance(kind, fields.Listing) and kind.size is None else kind
    if not isinstance(item, fields.Scalar) or item.name not in _NUMBERS:
        return None
    fits = declared is None or parse_type(declared) == kind
    return attrgetter(".".join(path)) if fits else None


def filled(name: str, inputs: Mapping[str, object]) -> str:
    """Put inputs into a ROS name. Raises InputError for a name that ROS refuses."""
    found = INPUT.findall(name)
    if not found:
        return name
    if missing := [each for each in found if each not in inputs]:
        raise InputError(f"{name}: {missing[0]!r} is not known before the tree runs")
    made = INPUT.sub(lambda each: str(inputs[each[1]]), name)
    if why := why_not(made.rstrip("/")):
        given = ", ".join(f"{each} is {inputs[each]!r}" for each in found)
        raise InputError(f"{name} would be {made!r}, as {given}: {why}")
    return made


def plain_name(text: str) -> str:
    """Return a text in the form of a node's name: one line, no colon."""
    line = " ".join(text.split()).replace(":", ";")
    return line if len(line) <= 60 else f"{line[:57]}..."


def written_text(node: TreeNode) -> str:
    """Return the text behind the kind's key, in the document's own words."""
    written = node.written[node.key.text]
    return written.text if isinstance(written, Scalar) else ""
