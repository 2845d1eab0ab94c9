"""Types by the names of the language (`float64`, `string[]`, `geometry_msgs/msg/Pose`), and which
type fits which.

Plain types need no ROS; the type of a message is looked up only where types are checked.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bt_actions.document.findings.elsewhere import type_here
from bt_actions.messages.fields import (
    FLOATS,
    INTEGERS,
    FieldType,
    Listing,
    Message,
    Scalar,
)
from bt_actions.messages.interfaces import DURATION
from bt_actions.utilities.suggest import closest, did_you_mean, listing

if TYPE_CHECKING:
    from bt_actions.messages.interfaces import Kind

PLAIN_TYPES = ("bool", *FLOATS, *(name for name in INTEGERS), "string")
"""The types that need no package."""
_STAND_FOR = {
    "builtin_interfaces/msg/Time": (*FLOATS, *INTEGERS),
    DURATION: (*FLOATS, *INTEGERS, "string"),
}
"""The plain types whose values may stand for a message: seconds, and `500 ms`."""
_TEXT = Scalar("string")
_WORD = re.compile(r"[A-Za-z]\w*", re.ASCII)
_KINDS = ("action", "srv", "msg")
_SYNTAX = re.compile(r"([A-Za-z][A-Za-z0-9_/]*)(?:<=(\d{1,9}))?(?:\[(?:(<=)?(\d{1,9}))?(\])?)?")


@dataclass(frozen=True, slots=True)
class Record(FieldType):
    """A mapping written in a tree: its keys, with their types where these are known."""

    items: tuple[tuple[str, FieldType | None], ...]
    sometimes: frozenset[str] = frozenset()
    """Keys that some of several mappings lack."""

    def __str__(self) -> str:
        return "mapping"


@dataclass(frozen=True, slots=True)
class Either(FieldType):
    """One of several types: of an item of a list written in a tree."""

    kinds: tuple[FieldType, ...]

    def __str__(self) -> str:
        return " or ".join(map(str, self.kinds))


class TypeNameError(ValueError):
    """A text that names no type; `missing` where the type may be installed elsewhere."""

    def __init__(self, message: str, *, missing: bool = False) -> None:
        super().__init__(message)
        self.missing = missing


def parse_type(text: str, *, types: bool = True) -> FieldType | None:
    """Return the type that a text names; None for a message's type when `types` is False.

    Raises TypeNameError, which says what is meant or what is missing.
    """
    match = _SYNTAX.fullmatch(text)
    listed = "[" in text
    if match is None or listed != (match[5] is not None) or (match[2] and match[1] != "string"):
        raise TypeNameError(f"{text!r} is no type{_instead(text, types)}")
    item = _item(match[1], int(match[2]) if match[2] else None, types)
    if item is None or not listed:
        return item
    if match[4] is None:
        return Listing(item)
    size = int(match[4])
    return Listing(item, limit=size) if match[3] else Listing(item, size=size)


def _item(name: str, limit: int | None, types: bool) -> FieldType | None:
    if name in PLAIN_TYPES:
        return Scalar(name, limit)
    if "/" not in name:
        near = _instead(name, types, did_you_mean(name, PLAIN_TYPES))
        known = near or f"; there is {', '.join(PLAIN_TYPES)}, and package/msg/Name"
        raise TypeNameError(f"{name!r} is no type{known}")
    if not types:
        return None
    return Message(interface_of(name, "msg"))


def _instead(text: str, types: bool, near: str = "") -> str:
    """Say what to write: for a foreign word or, where nothing is `near`, an installed type."""
    here = type_here(text)
    if here is None and not near and types:
        here = meant_type(text, "msg")
    return f": {here}" if here else near


def meant_type(text: str, kind: Kind) -> str | None:
    """Say what to write for an installed type without its package, or in a foreign notation.

    Examples are ``Pose``, ``geometry_msgs.msg.Pose`` and ``geometry_msgs/msg/pose``.
    """
    from bt_actions.messages.interfaces import installed

    *before, short = [word for word in _WORD.findall(text) if word not in _KINDS] or [""]
    shorts: dict[str, list[str]] = {}
    for name in installed(kind) if short else ():
        shorts.setdefault(name.rpartition("/")[2], []).append(name)
    near = short if short in shorts else closest(short, shorts, cutoff=0.8)
    found = shorts.get(near or "", [])
    own = [name for name in found if name.partition("/")[0] in before]
    names = listing(own or found, 4)
    return f"write {names if len(own or found) == 1 else f'one of {names}'}" if names else None


def interface_of(name: str, kind: Kind) -> type:
    """Return the class of an interface. Raises TypeNameError."""
    from bt_actions.messages.interfaces import UnknownInterface, interface

    try:
        return interface(name, kind)
    except UnknownInterface as error:
        raise TypeNameError(str(error), missing=True) from None


def fits(given: FieldType | None, wanted: FieldType | None) -> bool:
    """Return whether a value of one type can stand where another is needed; unknown types fit."""
    if given is None or wanted is None:
        return True
    if isinstance(given, Either):
        return all(fits(kind, wanted) for kind in given.kinds)
    if isinstance(wanted, Message):
        return _fills(given, wanted.cls)
    if isinstance(wanted, Listing):
        return (
            isinstance(given, Listing)
            and fits(given.item, wanted.item)
            and _fits_size(given, wanted)
        )
    if not isinstance(given, Scalar) or not isinstance(wanted, Scalar):
        return False
    if wanted.name in FLOATS:
        return given.name in FLOATS or given.name in INTEGERS
    if wanted.name in INTEGERS:
        return given.name in INTEGERS
    if wanted.name in ("string", "wstring"):
        return given.name in ("string", "wstring")
    return given.name == wanted.name


def _fits_size(given: Listing, wanted: Listing) -> bool:
    """Return whether a list can have the needed number of items, as far as both are known."""
    if given.size is None:
        return wanted.size is None or given.limit is None or given.limit >= wanted.size
    if wanted.size is not None:
        return given.size == wanted.size
    return wanted.limit is None or given.size <= wanted.limit


def _fills(given: FieldType, cls: type) -> bool:
    """Return whether a value can stand for a message; `misfits` says more of a mapping."""
    from bt_actions.messages.interfaces import interface_name

    if isinstance(given, Message):
        return given.cls is cls
    if isinstance(given, Scalar):
        return given.name in _STAND_FOR.get(interface_name(cls), ())
    return isinstance(given, Record)


def misfits(given: FieldType | None, wanted: FieldType | None) -> list[str]:
    """Say what is wrong with mappings of such types where messages are needed, also inside lists.

    Each text goes on where the name of the value ends: ".x: ...", ", in one item: ...".
    """
    if isinstance(given, Listing) and isinstance(wanted, Listing):
        return [f", in one item{text}" for text in misfits(given.item, wanted.item)]
    if isinstance(given, Either):
        return next((texts for kind in given.kinds if (texts := misfits(kind, wanted))), [])
    if not isinstance(given, Record) or not isinstance(wanted, Message):
        return []

    from bt_actions.messages.conversion import dotted, examine

    found: list[str] = []

    def hole(item: object, kind: FieldType, path: tuple[str | int, ...]) -> bool:
        inner = item if isinstance(item, FieldType) else None
        kinds = inner.kinds if isinstance(inner, Either) else (inner,)
        wrong = [one for one in kinds if one != _TEXT and not fits(one, kind)]
        if wrong:  # a text may name a constant
            found.append(f".{dotted(path)}: a value of {kind} is needed, not of {wrong[0]}")
        else:
            found.extend(f".{dotted(path)}{text}" for text in misfits(inner, kind))
        return True

    problems = [one for part in _alone(given) for one in examine(wanted, part, hole)]
    return [f".{one}" if one.path else f": {one.text}" for one in problems] + found


def _alone(given: Record) -> list[dict[str, FieldType | None]]:
    """Split a mapping into parts whose keys can stand side by side: one part may have angles."""
    from bt_actions.messages.conveniences import ANGLES

    items = dict(given.items)
    if not given.sometimes or not any(name in ANGLES for name in items):
        return [items]
    angles = {name: kind for name, kind in items.items() if name in ANGLES}
    return [angles, {name: kind for name, kind in items.items() if name not in ANGLES}]
