"""The functions of expressions, and their names in other languages.

No ROS here, and no code of a tree's author: a function takes plain values, and raises ValueError
with a readable text. No function makes a large number or a large text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sized
from types import MappingProxyType
from typing import Any

from bt_actions.expressions.values import LENGTHS, number, show
from bt_actions.utilities.plain_data import of_float32, plain, scalar, shortest

KNOWN = "known"
"""The function that asks for a value without reading it: `form.py` has its code."""
_DIGITS = 15
"""Digits of a fraction that a float64 can tell apart."""
_CALLED = {
    "len": " ".join(LENGTHS),
    "str": "string tostring to_string text",
    "int": "integer toint to_int trunc truncate",
    "float": "double real tofloat to_float",
    "abs": "fabs",
    KNOWN: "exists exist defined isset is_set has is_known",
}
_FOREIGN = {word: name for name, words in _CALLED.items() for word in words.split()}
"""Our functions by the names of other languages."""
_JOINS = {"append": "[{}]", "push": "[{}]", "push_back": "[{}]", "extend": "{}", "concat": "{}"}
"""Joins of lists in other languages, and what stands here behind a plus sign."""
_WHOLE = re.compile(r"\s*[-+]?[0-9]{1,100}\s*", re.ASCII)
_FRACTION = re.compile(
    r"\s*[-+]?([0-9]{1,100}(\.[0-9]{0,100})?|\.[0-9]{1,100})([eE][-+]?[0-9]{1,3})?\s*", re.ASCII
)


def _length(value: object) -> int:
    value = scalar(value)
    if not isinstance(value, Sized):
        raise ValueError(f"{show(value)} has no length")
    return len(value)


def _extreme(name: str, function: Callable[..., object]) -> Callable[..., object]:
    def call(*values: object) -> object:
        only: Any = values[0] if len(values) == 1 else None
        scan = of_float32(only) and hasattr(only, "tolist")  # a long one, often: read as it is
        items = only.tolist() if scan else plain(only)
        if len(values) != 1:
            items = [plain(value) for value in values]
        if not isinstance(items, (list, tuple)):
            raise ValueError(f"{name}() of one value needs a list, not {show(items)}")
        if not items:
            raise ValueError(f"{name}() of an empty list")
        try:
            found = function(items)
            return shortest(found) if scan else found
        except TypeError:
            raise ValueError(f"{name}() is of numbers alone, or of texts alone") from None

    return call


def _root(value: object) -> float:
    value = number(value)
    if value < 0:
        raise ValueError(f"{show(value)} has no square root")
    return math.sqrt(value)


def _round(value: object, digits: object = None) -> int | float:
    rounded, digits = number(value), plain(digits)
    if digits is None:
        return _whole(rounded, round)
    if isinstance(digits, bool) or not isinstance(digits, int) or not 0 <= digits <= _DIGITS:
        raise ValueError(f"round() takes 0 to {_DIGITS} digits, not {show(digits)}")
    return round(rounded, digits)


def _int(value: object) -> int:
    value = plain(value)
    if not isinstance(value, str):
        return _whole(_number_or_text(value), int)
    if _WHOLE.fullmatch(value) is None:
        raise ValueError(f"{show(value)} is no whole number")
    return int(value)


def _whole(value: int | float, function: Callable[[float], int]) -> int:
    if not math.isfinite(value):
        raise ValueError(f"{show(value)} is no whole number")
    return function(value)


def _float(value: object) -> float:
    value = plain(value)
    if not isinstance(value, str):
        return float(_number_or_text(value))
    if _FRACTION.fullmatch(value) is None:
        raise ValueError(f"{show(value)} is no number")
    return float(value)


def _number_or_text(value: object) -> int | float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"a number, or a text that holds one, is needed, not {show(value)}")
    return value


def _str(value: object) -> str:
    value = plain(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if not isinstance(value, (str, int, float)):
        raise ValueError(f"str() is of a number, a text, true or false, not {show(value)}")
    return str(value)


FUNCTIONS = MappingProxyType[str, Callable[..., object]](
    {
        "len": _length,
        "abs": lambda value: abs(number(value)),
        "min": _extreme("min", min),
        "max": _extreme("max", max),
        "round": _round,
        "sqrt": _root,
        "int": _int,
        "float": _float,
        "str": _str,
    }
)
"""The functions by name; `known` is not among them."""
ARGUMENTS = MappingProxyType(
    {name: {"min": 0, "max": 0, "round": 2}.get(name, 1) for name in (*FUNCTIONS, KNOWN)}
)
"""The most values that each function takes; 0: any number."""


def listed() -> str:
    """Return the names of all functions, as a sentence lists them."""
    *most, last = ARGUMENTS
    return f"{', '.join(most)} and {last}"


def instead_of(name: str, owner: str | None, arguments: list[str]) -> str | None:
    """Return what to write for a call of another language: ``length($x)``, ``$x.append(1)``.

    `owner` is the text before the dot of a method. None for an unknown call.
    """
    ours = _FOREIGN.get(name.lower())
    values = arguments if owner is None else [owner, *arguments]
    if name in _JOINS and len(values) == 2:
        return f"{values[0]} + {_JOINS[name].format(values[1])}"
    return f"{ours}({values[0]})" if ours is not None and len(values) == 1 else None
