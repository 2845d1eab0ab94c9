"""Of which types the variables are that nodes write."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import Protocol

from bt_actions.document.checking.infer import Wrong
from bt_actions.document.checking.value_types import common_type, type_of_literal
from bt_actions.document.language.types import TypeNameError, parse_type
from bt_actions.document.language.values import Computed, Interpolated
from bt_actions.document.reading.tree import Declared, Document, TreeNode
from bt_actions.document.reading.writes import Write
from bt_actions.document.yaml.nodes import Node
from bt_actions.expressions.expression import Expression
from bt_actions.messages.fields import FieldType, Listing, Message, Scalar
from bt_actions.messages.interfaces import RUN_TREE

__all__ = ["Known", "infer_variables", "items_inside", "root_type", "type_of"]

Types = Mapping[str, FieldType | None]
_ROUNDS = 8
"""How far a type is followed from variable to variable, before none is taken for known."""


class Known(Protocol):
    """What has to be known of a document for the types of what its nodes write."""

    types: bool
    document: Document
    variables: dict[str, FieldType | None]

    def infer(
        self, expression: Expression, roots: Types, reader: object
    ) -> tuple[FieldType | None, list[Wrong]]:
        """The type of an expression, as a node reads it, and what is wrong with it."""
        ...

    def interface(self, name: str, kind: str, node: Node) -> type | None:
        """The class of a type name."""
        ...

    def action_class(self, declared: Declared) -> type | None:
        """The class of the action that a name stands for."""
        ...


def type_of(write: Write, known: Known) -> FieldType | None:
    """The type of what is written, without reporting anything."""
    if write.node.kind.name == "subtree":
        return _output_type(write, known)
    if write.root == "item of":
        return _item_type(write, known)
    if isinstance(write.value, Interpolated):
        return Scalar("string")
    if not isinstance(write.value, Computed):
        return type_of_literal(write.value)
    roots = {write.root: root_type(write.node, write.root, known)} if write.root else {}
    return known.infer(write.value.expression, roots, write.node)[0]


def _item_type(write: Write, known: Known) -> FieldType | None:
    """The type of what a for_each gives its child."""
    if isinstance(write.value, list):
        return common_type([type_of_literal(item) for item in write.value])
    if not isinstance(write.value, Computed):
        return None
    kind, _ = known.infer(write.value.expression, {}, write.node)
    return kind.item if isinstance(kind, Listing) else None


def _output_type(write: Write, known: Known) -> FieldType | None:
    included = write.node.included
    declared = included.outputs.get(str(write.value)) if included is not None else None
    text = declared.values.get("type") if declared is not None else None
    if not isinstance(text, str):
        return None
    try:
        return parse_type(text, types=known.types)
    except TypeNameError:
        return None


def items_inside(
    writers: Mapping[str, Sequence[Write]], declared: Container[str]
) -> dict[int, dict[str, Write]]:
    """What gives the nodes inside of loops their items, by the node's id.

    Only where several loops use one name, and nothing else writes it: inside of each it has the
    type of that loop's items.
    """
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


def infer_variables(writers: Mapping[str, Sequence[Write]], known: Known) -> None:
    """Give the variables that nodes write the one type that all of them write, or None.

    What is declared keeps its type. A value may be computed from a variable that is written further
    down, or from itself (a counter): so unknown types are left out of account at first, and count
    once every variable has had its chance.
    """
    writers = {name: writes for name, writes in writers.items() if name not in known.variables}
    known.variables.update(dict.fromkeys(writers))
    changed = True
    for _ in range(_ROUNDS):
        if not changed:
            break
        changed = False
        for name, writes in writers.items():
            if known.variables[name] is None:
                kinds = [kind for write in writes if (kind := type_of(write, known)) is not None]
                if kinds and kinds.count(kinds[0]) == len(kinds):
                    known.variables[name] = kinds[0]
                    changed = True
    open_still = {n: w for n, w in writers.items() if len(w) > 1 or w[0].depends}
    for _ in range(_ROUNDS):
        changed = False
        for name, writes in open_still.items():
            kind = known.variables[name]
            if kind is not None and any(type_of(write, known) != kind for write in writes):
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
    interface, cls = node.kind.interface, None
    if interface is None or interface.root != root:
        return None
    if node.alias is not None:
        declared = known.document.actions.get(node.alias)
        cls = known.action_class(declared) if declared is not None else None
    else:
        name = RUN_TREE if node.kind.name == "run_tree" else node.values.get("type")
        if isinstance(name, str):
            cls = known.interface(name, interface.kind, node.written.get("type", node.key))
    return None if cls is None else Message(interface.received_from(cls))
