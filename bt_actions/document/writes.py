"""Which variables a node writes, and of which type they are."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from bt_actions.behaviours.run_tree import TYPE as RUN_TREE
from bt_actions.document.infer import common_type, infer, type_of_literal
from bt_actions.document.nodes import Mapping, Node
from bt_actions.document.tree import Declared, Document, TreeNode
from bt_actions.document.types import TypeNameError, parse_type
from bt_actions.document.values import Computed, Interpolated
from bt_actions.messages.fields import FieldType, Listing, Message, Scalar

__all__ = ["Write", "infer_variables", "items_inside", "root_type", "writes_of"]

_ROUNDS = 8
"""How far a type is followed from variable to variable, before none is taken for known."""


class Known(Protocol):
    """What has to be known of a document for the types of what its nodes write."""

    types: bool
    document: Document
    variables: dict[str, FieldType | None]

    def types_at(self, reader: object) -> Callable[[str], FieldType | None]:
        """Gives the type of a variable as a node reads it."""
        ...

    def interface(self, name: str, kind: str, node: Node) -> type | None:
        """The class of a type name."""
        ...

    def action_class(self, declared: Declared) -> type | None:
        """The class of the action that a name stands for."""
        ...


@dataclass(frozen=True, slots=True)
class Write:
    """A variable that a node writes: from `value`, an expression over `root` or plain data."""

    name: str
    node: TreeNode
    written: Node
    value: object
    root: str | None = None

    @property
    def depends(self) -> bool:
        """Does the type of what is written depend on those of variables?"""
        return isinstance(self.value, Computed) and bool(self.value.expression.names)

    def type_in(self, known: Known) -> FieldType | None:
        """The type of what is written, without reporting anything."""
        if self.node.kind is not None and self.node.kind.name == "subtree":
            return self._output_type(known)
        if self.root == "item of":
            return self._item_type(known)
        if isinstance(self.value, Interpolated):
            return Scalar("string")
        if not isinstance(self.value, Computed):
            return type_of_literal(self.value)
        roots = {} if self.root is None else {self.root: root_type(self.node, self.root, known)}
        return infer(self.value.expression, roots, known.types_at(self.node), lambda *_: None,
                     types=known.types)  # fmt: skip

    def _item_type(self, known: Known) -> FieldType | None:
        """The type of what a for_each gives its child."""
        if isinstance(self.value, list):
            return common_type([type_of_literal(item) for item in self.value])
        if not isinstance(self.value, Computed):
            return None
        kind = infer(self.value.expression, {}, known.types_at(self.node), lambda *_: None,
                     types=known.types)  # fmt: skip
        return kind.item if isinstance(kind, Listing) else None

    def _output_type(self, known: Known) -> FieldType | None:
        included = self.node.included
        declared = included.outputs.get(str(self.value)) if included is not None else None
        text = declared.values.get("type") if declared is not None else None
        if not isinstance(text, str):
            return None
        try:
            return parse_type(text, types=known.types)
        except TypeNameError:
            return None


def writes_of(node: TreeNode, document: Document) -> Iterator[Write]:
    """The variables that a node itself writes."""
    values = node.values
    declared = document.actions.get(node.alias) if node.alias is not None else None
    if declared is not None:
        own = values.get("save")
        shared = declared.values.get("save")
        for name, value in (shared if isinstance(shared, dict) else {}).items():
            if not isinstance(own, dict) or name not in own:
                yield Write(name, node, node.node, value, "result")
    saved = values.get("save")
    if isinstance(saved, dict):
        table = _values_in(node.written.get("save"))
        for name, value in saved.items():
            inner = table.get(name)
            root = None if node.kind is not None and node.kind.name == "subtree" else "result"
            if node.kind is not None and node.kind.name == "wait_for_message":
                root = "message"
            yield Write(name, node, inner or node.node, value, root)
    if node.kind is None:
        return
    if node.kind.name == "set" and isinstance(values.get("set"), dict):
        table = _values_in(node.written.get("set"))
        for name, value in values["set"].items():  # type: ignore[attr-defined]
            inner = table.get(name)
            yield Write(name, node, inner or node.node, value)
    if node.kind.name == "for_each":
        item = values.get("as", "item")
        if isinstance(item, str):
            yield Write(item, node, node.written.get("as", node.key), values.get("in"), "item of")
        index = values.get("index")
        if isinstance(index, str):
            yield Write(index, node, node.written["index"], 0)


def _values_in(table: Node | None) -> dict[str, Node]:
    """The YAML nodes of a mapping's values, by their keys."""
    if not isinstance(table, Mapping):
        return {}
    return {key.text: value for key, value in table.pairs}


def items_inside(
    written: Iterable[tuple[Write, ...]], declared: Container[str]
) -> dict[int, dict[str, Write]]:
    """What gives the nodes inside of loops their items, by the node's id.

    Only where several loops use one name, and nothing else writes it: inside of each it has the
    type of that loop's items.
    """
    writers: dict[str, list[Write]] = {}
    for writes in written:
        for write in writes:
            writers.setdefault(write.name, []).append(write)
    inside: dict[int, dict[str, Write]] = {}
    for name, loops in writers.items():
        if len(loops) < 2 or name in declared or any(one.root != "item of" for one in loops):
            continue
        heads = {id(loop.node) for loop in loops}
        for loop in loops:
            body = [node for child in loop.node.children for node in child.walk()]
            if heads.isdisjoint(id(node) for node in body):
                for node in body:
                    inside.setdefault(id(node), {})[name] = loop
    return inside


def infer_variables(written: Iterable[Write], known: Known) -> None:
    """Give the variables that nodes write the one type that all of them write, or None.

    What is declared keeps its type. A value may be computed from a variable that is written further
    down, or from itself (a counter): so unknown types are left out of account at first, and count
    once every variable has had its chance.
    """
    writers: dict[str, list[Write]] = {}
    for write in written:
        if write.name not in known.variables or write.name in writers:
            writers.setdefault(write.name, []).append(write)
            known.variables.setdefault(write.name, None)
    changed = True
    for _ in range(_ROUNDS):
        if not changed:
            break
        changed = False
        for name, writes in writers.items():
            if known.variables[name] is None:
                kinds = {write.type_in(known) for write in writes} - {None}
                known.variables[name] = kinds.pop() if len(kinds) == 1 else None
                changed |= known.variables[name] is not None
    open_still = {n: w for n, w in writers.items() if len(w) > 1 or w[0].depends}
    for _ in range(_ROUNDS):
        changed = False
        for name, writes in open_still.items():
            kind = known.variables[name]
            if kind is not None and any(write.type_in(known) != kind for write in writes):
                known.variables[name] = None
                changed = True
        if not changed:
            return
    for name in open_still:
        known.variables[name] = None


def root_type(node: TreeNode, root: str, known: Known) -> FieldType | None:
    """The type of the bare root that a node's expressions may use."""
    if not known.types:
        return None
    if node.alias is not None:
        declared = known.document.actions.get(node.alias)
        cls = known.action_class(declared) if declared is not None else None
        return None if cls is None else Message(cls.Result)  # type: ignore[attr-defined]
    if node.kind is None or node.kind.name not in _ANSWERS:
        return None
    kind, part = _ANSWERS[node.kind.name]
    name = RUN_TREE if node.kind.name == "run_tree" else node.values.get("type")
    if not isinstance(name, str):
        return None
    cls = known.interface(name, kind, node.written.get("type", node.key))
    if cls is None:
        return None
    return Message(getattr(cls, part) if part else cls)


_ANSWERS = {"action": ("action", "Result"), "run_tree": ("action", "Result"),
            "service": ("srv", "Response"), "wait_for_message": ("msg", "")}  # fmt: skip
