"""Any value as plain data that cannot change, taken in bounded time.

A snapshot holds texts, numbers, bytes, None, tuples, and dictionaries by text; parts beyond the
bounds are counted in a `Cut`, and not looked at. A ROS message is recognised by its methods.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

from bt_actions.utilities.plain_data import field_of, plain

if TYPE_CHECKING:
    Value: TypeAlias = (
        "bool | int | float | str | bytes | tuple[Value, ...] | dict[str, Value] | Cut | None"
    )
else:
    Value = object  # wire.py asks for the hints of events

HIDDEN = "•••"
"""The stand-in for a secret value, or one computed from a secret."""
FIELDS = 1000
"""Values in one snapshot, containers included,"""
SIZE = 64_000
"""and their size: the characters of a text, the bytes of bytes, 8 for any other value."""
WIDE = 64
"""Bytes of a whole number; a greater one becomes a text with its size."""
DEEP = 30
"""Levels; a value that holds itself ends there."""


@dataclass(frozen=True, slots=True)
class Cut:
    """The beginning of a value that was too large."""

    head: str | bytes | tuple[Value, ...] | dict[str, Value]
    more: int
    """Characters, bytes, items or fields that follow."""


def snapshot(value: object, *, fields: int = FIELDS, size: int = SIZE) -> Value:
    """Return `value` as it is now; raise nothing, whatever the value's own methods do."""
    return _Snapshot(fields, size).of(value, 0)


class _Snapshot:
    def __init__(self, fields: int, size: int) -> None:
        self._fields, self._size = fields, size

    def of(self, value: object, depth: int) -> Value:
        self._fields -= 1
        if value is None or type(value) in (bool, int, float):
            self._size -= 8
            return _bounded(value)  # type: ignore[arg-type]
        if isinstance(value, Cut):
            return value
        try:
            return self._of(value, depth)
        except Exception:  # noqa: BLE001 - a value's own methods may raise anything
            return f"<{type(value).__name__}>"

    def _of(self, value: Any, depth: int) -> Value:
        if isinstance(value, str):
            return self._text(str(value))
        if isinstance(value, bytes | bytearray) and len(value) != 1:  # a lone one is a byte of ROS
            return self._text(bytes(value))
        if depth >= DEEP:
            return Cut((), 1)
        if names := _fields_of(type(value)):  # type: ignore[arg-type]  # a class is hashable
            fields = ((name, field_of(value, name, names)) for name in names)
            return self._mapping(fields, len(names), depth)
        if isinstance(value, Mapping):
            return self._mapping(((str(k), v) for k, v in value.items()), len(value), depth)
        if isinstance(value, list | tuple | set | frozenset) or hasattr(value, "tolist"):
            return self._listing(value, depth)
        found = plain(value)
        if isinstance(found, bool | int | float):
            return self.of(found if isinstance(found, bool) else _own(found), depth)
        return self._text(f"<{type(value).__name__}>")

    def _text(self, text: str | bytes) -> str | bytes | Cut:
        room = max(0, self._size)
        self._size -= len(text)
        return text if len(text) <= room else Cut(text[:room], len(text) - room)

    def _listing(self, items: Any, depth: int) -> Value:
        if not getattr(items, "shape", True):  # a scalar of numpy
            return self.of(plain(items), depth)
        count, room = len(items), max(0, min(self._fields, self._size // 8))
        first: Any = items[:room] if hasattr(items, "__getitem__") else items
        taken: Any = plain(first) if hasattr(first, "tolist") else first
        if type(first) is array:  # numbers of the machine
            self._fields -= len(taken)
            self._size -= 8 * len(taken)
            return tuple(taken) if len(taken) == count else Cut(tuple(taken), count - len(taken))
        kept: list[Value] = []
        for item in taken:
            if self._full:
                break
            kept.append(self.of(_byte(item), depth + 1))
        return tuple(kept) if len(kept) == count else Cut(tuple(kept), count - len(kept))

    def _mapping(self, items: Iterable[tuple[str, object]], count: int, depth: int) -> Value:
        kept: dict[str, Value] = {}
        for seen, (name, item) in enumerate(items):
            if self._full or len(name) > self._size:
                return Cut(kept, count - seen)
            self._size -= len(name)
            kept[name] = self.of(_byte(item), depth + 1)
        return kept

    @property
    def _full(self) -> bool:
        return self._fields <= 0 or self._size <= 0


@lru_cache(maxsize=256)
def _fields_of(kind: Any) -> Mapping[str, str] | None:
    """Return the fields of a message type with their types in rosidl's words.

    None for another type.
    """
    asked = getattr(kind, "get_fields_and_field_types", None)
    return None if asked is None else asked()


def _bounded(value: bool | int | float | None) -> Value:
    """Return a number, or its size."""
    if isinstance(value, int) and value.bit_length() > 8 * WIDE:
        return f"<a number of {value.bit_length()} bits>"
    return value


def _byte(item: object) -> object:
    """Return a byte of ROS as its number."""
    return item[0] if isinstance(item, bytes) and len(item) == 1 else item


def _own(number: Any) -> int | float:
    """Return Python's own number for one of a subclass."""
    return int(number) if isinstance(number, int) else float(number)
