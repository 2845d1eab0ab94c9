"""The types of literals and of variables, and the types that can be compared or joined."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence

from bt_actions.document.language.types import Either, Record
from bt_actions.document.reading.tree import Write
from bt_actions.expressions.functions import KNOWN
from bt_actions.messages.fields import FLOATS, INTEGERS, FieldType, Listing, Scalar

_ROUNDS = 8
"""Steps from variable to variable after which a type counts as unknown."""
_NUMBERS = frozenset({*INTEGERS, *FLOATS})
BOOL, INTEGER, FLOAT, TEXT = Scalar("bool"), Scalar("int64"), Scalar("float64"), Scalar("string")


def type_of_literal(value: object) -> FieldType | None:
    """Return the type of plain data, where it has one."""
    if isinstance(value, bool):
        return BOOL
    if isinstance(value, int):
        return INTEGER
    if isinstance(value, float):
        return FLOAT
    if isinstance(value, list):
        same = common_type([type_of_literal(item) for item in value])
        return None if same is None or isinstance(same, Either) else Listing(same, size=len(value))
    if isinstance(value, dict):
        return Record(tuple((str(name), type_of_literal(item)) for name, item in value.items()))
    return TEXT if isinstance(value, str) else None


def common_type(kinds: Sequence[FieldType | None]) -> FieldType | None:
    """Return the type of an item of a list with items of these types; None for an unknown one.

    Of records alone, the type is a record with the keys of all.
    """
    known = [kind for kind in dict.fromkeys(kinds) if kind is not None]
    if not known or None in kinds:
        return None
    records = [kind for kind in known if isinstance(kind, Record)]
    if len(records) == len(known):
        return _merged(records)
    lists = [kind for kind in known if isinstance(kind, Listing)]
    if len(lists) == len(known):
        item = common_type([kind.item for kind in lists])
        sizes = {kind.size for kind in lists}
        size = sizes.pop() if len(sizes) == 1 else None
        return None if item is None or isinstance(item, Either) else Listing(item, size=size)
    return known[0] if len(known) == 1 else Either(tuple(known))


def _merged(records: Sequence[Record]) -> Record:
    keys: dict[str, list[FieldType | None]] = {}
    for record in records:
        for name, kind in record.items:
            keys.setdefault(name, []).append(kind)
    sometimes = {name for name, found in keys.items() if len(found) < len(records)}
    return Record(
        tuple((name, common_type(found)) for name, found in keys.items()),
        frozenset(sometimes.union(*(record.sometimes for record in records))),
    )


def named(kind: FieldType | None) -> str:
    """Return the name of a type with its article."""
    text = str(kind)
    return f"an {text}" if text[0] in "aeioAEIO" else f"a {text}"


def is_number(kind: FieldType | None) -> bool:
    return isinstance(kind, Scalar) and kind.name in _NUMBERS


def is_float(kind: FieldType | None) -> bool:
    return isinstance(kind, Scalar) and kind.name in FLOATS


def is_text(kind: FieldType | None) -> bool:
    return isinstance(kind, Scalar) and kind.name in ("string", "wstring")


def has_length(kind: FieldType) -> bool:
    return isinstance(kind, Listing | Record) or is_text(kind)


def comparable(first: FieldType, second: FieldType) -> bool:
    if is_number(first):
        return is_number(second)
    if is_text(first):
        return is_text(second)
    if isinstance(first, Listing) and isinstance(second, Listing):
        return comparable(first.item, second.item)
    return first == second


def unjoinable(kind: Listing, given: FieldType) -> str | None:
    """Say what a list of some type can be joined with, where that is not the type given."""
    if not isinstance(given, Listing):
        return "a list is joined with a list"
    items = kind.item, given.item
    alike = comparable(*items) or not all(isinstance(item, Scalar) for item in items)
    return None if alike else f"a list of {kind.item} is joined with another"


def joined(first: FieldType, second: FieldType) -> FieldType | None:
    """Return the type of two joined lists; None for an unknown one."""
    if not isinstance(first, Listing) or not isinstance(second, Listing):
        return None
    size = None if None in (first.size, second.size) else (first.size or 0) + (second.size or 0)
    items = first.item, second.item
    if items[0] != items[1] and all(map(is_number, items)):
        return Listing(FLOAT if any(map(is_float, items)) else INTEGER, size=size)
    item = common_type(items)
    return None if item is None or isinstance(item, Either) else Listing(item, size=size)


def _converts(kind: FieldType) -> bool:
    """Return whether `int` and `float` take a value of this type."""
    return is_number(kind) or is_text(kind)


_CONVERTED = "a number, or a text that holds one, is needed, not {}"
ONE_VALUE: Mapping[str, tuple[Callable[[FieldType], bool], str, FieldType]] = {
    KNOWN: (lambda _: True, "", BOOL),
    "len": (has_length, "{} has no length", INTEGER),
    "int": (_converts, _CONVERTED, INTEGER),
    "float": (_converts, _CONVERTED, FLOAT),
    "str": (
        lambda kind: _converts(kind) or kind == BOOL,
        "str() is of a number, a text, true or false, not {}",
        TEXT,
    ),
}
"""Functions of one value: the types they take, the words for other types, and their own type."""


def items_inside(
    writers: Mapping[str, Sequence[Write]], declared: Container[str]
) -> dict[int, dict[str, Write]]:
    """Return the writes of loop items, for the nodes inside of loops, by the node's id.

    Only names that several loops share, and nothing else writes, are here: inside of each loop the
    name has the type of that loop's items.
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

    A declared variable keeps its type. A value may be computed from a variable that is written
    further down, or from itself (a counter): so unknown types do not count at first, and count once
    every variable has had its chance.
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
