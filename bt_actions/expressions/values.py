"""The work of an expression's parts on values: fields, items, numbers, comparisons.

No ROS here: a message is known by its methods. A function here raises `ValueError` with a readable
text, or whatever the value itself raises; `expression.py` turns both into its error with a place.
No function makes a large number or a large text.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from types import SimpleNamespace
from typing import Any

from bt_actions.utilities.plain_data import field_of, item_of, plain, scalar
from bt_actions.utilities.plain_text import in_words
from bt_actions.utilities.shorten import shorten

MAX_BITS = 256
MAX_ITEMS = 10_000
MAX_JOINED = 100_000
"""Items of a list joined from others."""
LENGTHS = ("length", "size", "count")
"""Names of `len` in other languages."""


def number(value: object) -> int | float:
    value = plain(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"a number is needed, not {show(value)}")
    return value


def add(left: object, right: object) -> object:
    """Return the sum of two numbers, two texts as one, or the items of two lists in a new one."""
    left, right = _items(left), _items(right)
    if isinstance(left, str) and isinstance(right, str):
        return left + right
    if isinstance(left, list) and isinstance(right, list):
        if len(left) + len(right) > MAX_JOINED:
            raise ValueError(f"the list would have more than {MAX_JOINED:,} items")
        return left + right
    for kind, remedy in (
        (list, "a list is joined with a list: write [...]"),
        (str, "a text is joined with a text: write str(...)"),
    ):
        for one, other in ((left, right), (right, left)):
            if isinstance(one, kind):
                raise ValueError(f"{remedy} around {show(other)}")
    return number(left) + number(right)


def _items(value: object) -> object:
    """Return a list of any kind as one of Python's; any other value as it is."""
    if hasattr(value, "__len__") and len(value) > MAX_JOINED and not isinstance(value, str):
        raise ValueError(f"a list of more than {MAX_JOINED:,} items cannot be joined")
    value = plain(value)
    return list(value) if isinstance(value, (tuple, bytes, bytearray)) else value


def _arithmetic(function: Callable[[int | float, int | float], object]) -> Callable[..., object]:
    return lambda left, right: function(number(left), number(right))


def _power(left: object, right: object) -> object:
    base, exponent = number(left), number(right)
    if isinstance(base, int) and isinstance(exponent, int):
        if base.bit_length() * max(exponent, 0) > MAX_BITS and abs(base) > 1:
            raise ValueError("the number would be too large")
        if exponent < 0:
            base = float(base)
    value = base**exponent
    if isinstance(value, complex):
        raise ValueError("a root of a negative number")
    return value


def truth(value: object) -> bool:
    value = plain(value)
    if not isinstance(value, bool):
        raise ValueError(f"true or false is needed, not {show(value)}")
    return value


def field(value: object, name: str) -> object:
    """Return a field of a message, a key of a mapping, or a public attribute of a plain value."""
    if isinstance(value, Mapping):
        if name in value:
            return scalar(value[name])
        raise ValueError(f"no key {name!r}{_among(value)}")
    described = getattr(type(value), "get_fields_and_field_types", None)
    if described is not None:
        known = described()
        if name in known or name.isupper():
            return field_of(value, name, known)
        raise ValueError(f"{type(value).__name__} has no field {name!r}{_among(known)}")
    public: Iterable[str] = ()
    if is_dataclass(value):
        public = [field.name for field in fields(value)]
    elif isinstance(value, SimpleNamespace):
        public = vars(value)
    if name in public:
        return scalar(getattr(value, name))
    remedy = ": write len(...)" if name in LENGTHS and hasattr(value, "__len__") else ""
    raise ValueError(f"{show(value)} has no field {name!r}{remedy or _among(public)}")


def _among(known: Iterable[object]) -> str:
    names = ", ".join(sorted(str(name) for name in known)[:12])
    return f"; there is {names}" if names else ""


def item(value: object, index: object) -> object:
    index = plain(index)
    if isinstance(value, Mapping):
        if isinstance(index, str):
            return field(value, index)
        try:
            return scalar(value[index])
        except (KeyError, TypeError):  # a list is no key
            raise ValueError(f"no key {show(index)}{_among(value)}") from None
    if isinstance(index, bool) or not isinstance(index, int):
        raise ValueError(f"an index is a whole number, not {show(index)}")
    if not hasattr(value, "__len__") or not hasattr(value, "__getitem__"):
        raise ValueError(f"{show(value)} has no items")
    size = len(value)
    if not -size <= index < size:
        raise ValueError(f"index {index} is outside of {size} items")
    return item_of(value, index)


def cut(value: object, start: object, end: object) -> object:
    """Return the items of a list, or characters of a text, from `start` to before `end`."""
    value = scalar(value)
    if isinstance(value, Mapping) or not hasattr(value, "__getitem__"):
        raise ValueError(f"{show(value)} has no items")
    bounds = [plain(bound) for bound in (start, end)]
    for bound in bounds:
        if isinstance(bound, bool) or not isinstance(bound, int | None):
            raise ValueError(f"an index is a whole number, not {show(bound)}")
    return _items(value[slice(*bounds)])


def bounded(value: object) -> object:
    if isinstance(value, int) and value.bit_length() > MAX_BITS:
        raise ValueError("the number is too large")
    if isinstance(value, str) and len(value) > MAX_ITEMS:
        raise ValueError(f"the text would have more than {MAX_ITEMS:,} characters")
    return value


def contains(left: object, right: object) -> bool:
    if not isinstance(right, (str, list, tuple, Mapping)):
        raise ValueError(f"{show(right)} holds nothing that 'in' could look for")
    if isinstance(right, str) and not isinstance(left, str):
        raise ValueError(f"{show(left)} cannot be in a text")
    try:
        return left in right
    except TypeError:  # a list is no key
        return False


def ordered(function: Callable[[Any, Any], bool]) -> Callable[[object, object], bool]:
    def test(left: object, right: object) -> bool:
        if not isinstance(left, str) or not isinstance(right, str):
            return function(number(left), number(right))
        return function(left, right)

    return test


UNARY: dict[type[ast.unaryop], Callable[..., object]] = {
    ast.Not: lambda value: not truth(value),
    ast.USub: lambda value: -number(value),
    ast.UAdd: number,
}
BINARY: dict[type[ast.operator], Callable[..., object]] = {
    ast.Add: add,
    ast.Sub: _arithmetic(operator.sub),
    ast.Mult: _arithmetic(operator.mul),
    ast.Div: _arithmetic(operator.truediv),
    ast.FloorDiv: _arithmetic(operator.floordiv),
    ast.Mod: _arithmetic(operator.mod),
    ast.Pow: _power,
}
COMPARE: dict[type[ast.cmpop], Callable[..., bool]] = {
    ast.Eq: lambda left, right: bool(left == right),
    ast.NotEq: lambda left, right: bool(left != right),
    ast.Lt: ordered(operator.lt),
    ast.LtE: ordered(operator.le),
    ast.Gt: ordered(operator.gt),
    ast.GtE: ordered(operator.ge),
    ast.In: contains,
    ast.NotIn: lambda left, right: not contains(left, right),
}


def show(value: object) -> str:
    return shorten(value, 60)


def reason(error: Exception, text: str) -> str:
    """Return why `text`, a part of an expression, has no value."""
    if isinstance(error, ZeroDivisionError):
        return f"{text} divides by zero"
    if isinstance(error, OverflowError):
        return "the number is too large"
    return in_words(error)
