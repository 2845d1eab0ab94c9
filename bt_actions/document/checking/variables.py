"""Of which types the variables are that nodes write."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence

from bt_actions.document.reading.settings import Write
from bt_actions.messages.fields import FieldType

__all__ = ["infer_variables", "items_inside"]

_ROUNDS = 8
"""How far a type is followed from variable to variable, before none is taken for known."""


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


def infer_variables(
    writers: Mapping[str, Sequence[Write]],
    variables: dict[str, FieldType | None],
    type_of: Callable[[Write], FieldType | None],
) -> None:
    """Give the `variables` that nodes write the one type that all of them write, or None.

    What is declared keeps its type. A value may be computed from a variable that is written further
    down, or from itself (a counter): so unknown types are left out of account at first, and count
    once every variable has had its chance.
    """
    writers = {name: writes for name, writes in writers.items() if name not in variables}
    variables.update(dict.fromkeys(writers))
    changed = True
    for _ in range(_ROUNDS):
        if not changed:
            break
        changed = False
        for name, writes in writers.items():
            if variables[name] is None:
                kinds = [kind for write in writes if (kind := type_of(write)) is not None]
                if kinds and kinds.count(kinds[0]) == len(kinds):
                    variables[name] = kinds[0]
                    changed = True
    open_still = {n: w for n, w in writers.items() if len(w) > 1 or w[0].depends}
    for _ in range(_ROUNDS):
        changed = False
        for name, writes in open_still.items():
            kind = variables[name]
            if kind is not None and any(type_of(write) != kind for write in writes):
                variables[name] = None
                changed = True
        if not changed:
            return
    for name in open_still:
        variables[name] = None
