"""Plain data, also from numpy: numbers, texts, lists and mappings. No ROS.

A float32 is read as the shortest number that stands for it: Python has float64 alone, in which the
float32 that is next to 0.7 is 0.699999988079071. Written to a float32 again, both are the same.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import Any

_NUMBERS = frozenset({bool, int, float})
_PLAIN = frozenset({bool, int, float, str})
_GREATEST = 3.402823466e38
"""The greatest finite float32."""


def numbers_only(items: Iterable[object]) -> bool:
    """Return whether a list holds numbers alone; a list of millions needs no loop of Python's."""
    return _NUMBERS.issuperset(map(type, items))


def scalar(value: object) -> object:
    """Return a numpy scalar, and a byte of ROS, as Python's own number; an array as it is."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, bytes) and len(value) == 1:
        return value[0]
    if type(value).__module__ == "numpy" and not getattr(value, "shape", ()):
        number = value.item()  # type: ignore[attr-defined]
        return shortest(number) if of_float32(value) else number
    return value


def plain(value: object) -> object:
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, bytes):
        return scalar(value)
    if isinstance(value, list):
        return [scalar(item) for item in value] if value and isinstance(value[0], bytes) else value
    to_list = getattr(value, "tolist", None)  # array.array and numpy alike
    if to_list is not None and type(value).__module__ in ("array", "numpy"):
        items: object = to_list()
        return shortest(items) if of_float32(value) else items
    return value


def item_of(items: Any, at: int) -> object:
    """Return an item of a list of any type."""
    item = scalar(items[at])
    return shortest(item) if of_float32(items) else item


def field_of(message: object, name: str, types: Mapping[str, str]) -> object:
    """Return a field of a message; `types` are those of its fields, in rosidl's names."""
    value = getattr(message, name)
    return shortest(value) if types.get(name) == "float" else scalar(value)


def shortest(value: Any) -> Any:
    """Return a former float32, or a list of them, by the fewest digits that give it."""
    if isinstance(value, list):
        return [shortest(item) for item in value]
    if not isinstance(value, float):
        return value
    try:
        kept = struct.pack("f", value)
    except OverflowError:  # no float32 in fact
        return value
    for digits in range(6, 9):  # nine always do
        short = float(f"{value:.{digits}g}")
        if abs(short) <= _GREATEST and struct.pack("f", short) == kept:
            return short
    return float(f"{value:.9g}") if abs(value) < _GREATEST else value


def of_float32(value: Any) -> bool:
    """Return whether a numpy scalar, or the items of an array, are float32."""
    return getattr(value, "typecode", None) == "f" or str(getattr(value, "dtype", "")) == "float32"


def same(one: object, other: object) -> bool:
    """Return whether two values are equal; an array equals itself alone."""
    try:
        return bool(one == other)
    except ValueError:
        return False
