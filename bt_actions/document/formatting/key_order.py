"""The order that canonical form gives keys: a node's kind first, what it holds last."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as MappingType

from bt_actions.document.language.keys import ACTION_KEYS, NODE, NODES
from bt_actions.document.language.kinds import KINDS
from bt_actions.document.language.shape import Shape
from bt_actions.document.language.shapes import Key, ListOf, OneOf, Record, Table
from bt_actions.document.yaml.nodes import Mapping, Node, Scalar


def shapes_of(node: Mapping, shape: Shape | None) -> MappingType[str, Shape | None]:
    """The form of what stands under each key of a mapping, in the order that the model has.

    Keys that it does not know stay where they are, behind the others.
    """
    names = [key.text for key, _ in node.pairs]
    if shape is NODE:
        return _node_shapes(names)
    if isinstance(shape, OneOf):
        shape = shape.record
    if isinstance(shape, Record):
        return forms(shape.keys)
    if isinstance(shape, Table):
        return dict.fromkeys(names, shape.item)
    return dict.fromkeys(names)


def _node_shapes(names: list[str]) -> MappingType[str, Shape | None]:
    """The keys of a node: its kind or its action first, what it holds last."""
    kinds = [name for name in names if name in KINDS]
    if "child" not in names:  # settings of an action, then
        kinds = [name for name in kinds if name not in ("timeout", "retry")]
    foreign = [name for name in names if name not in ACTION_KEYS]
    if len(kinds) == 1:
        kind = KINDS[kinds[0]]
        rest = forms(kind.keys)
        ordered: dict[str, Shape | None] = {kind.name: kind.value, "name": rest.pop("name", None)}
        last = {name: rest.pop(name) for name in ("child", "children") if name in rest}
        return ordered | rest | last
    if len(foreign) == 1:
        return {foreign[0]: None, **forms(ACTION_KEYS)}
    return dict.fromkeys(names)


def forms(keys: MappingType[str, Key]) -> dict[str, Shape | None]:
    """The form of each key, in their order."""
    return {name: key.shape for name, key in keys.items()}


def item_shape(shape: Shape | None) -> Shape | None:
    """The form of a list's items."""
    if shape is NODES:
        return NODE
    return shape.item if isinstance(shape, ListOf) else None


def in_order(node: Mapping, order: Iterable[str]) -> list[tuple[Scalar, Node]]:
    """The pairs of a mapping; those whose keys `order` lacks stay behind the others."""
    rank = {name: at for at, name in enumerate(order)}
    return sorted(node.pairs, key=lambda pair: rank.get(pair[0].text, len(rank)))
