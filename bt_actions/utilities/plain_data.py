"""Plain data, numpy's among it: numbers, texts, lists and mappings. No ROS."""

from __future__ import annotations

from collections.abc import Iterable

_NUMBERS = frozenset({bool, int, float})


def numbers_only(items: Iterable[object]) -> bool:
    """Whether nothing but numbers is in a list; looks at millions without a loop of Python's."""
    return _NUMBERS.issuperset(map(type, items))


def scalar(value: object) -> object:
    """A numpy scalar, and a byte of ROS, as Python's own number; arrays stay as they are until
    somebody compares them."""
    if isinstance(value, bytes) and len(value) == 1:
        return value[0]
    if type(value).__module__ == "numpy" and not getattr(value, "shape", ()):
        return value.item()  # type: ignore[attr-defined]
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
        return items
    return value
