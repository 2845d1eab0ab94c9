"""The fields of ROS messages as plain values: for filling a message, and for checking a tree.

Read from the classes that rosidl generates; imports no rclpy.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

from bt_actions.messages.interfaces import short_name
from bt_actions.utilities.plain_data import scalar
from bt_actions.utilities.shorten import scalars
from bt_actions.utilities.suggest import what_it_has

_BITS = (8, 16, 32, 64)
INTEGERS = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in _BITS},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in _BITS},
    "byte": (0, 255),
}
"""The least and the greatest value of each integer type."""
FLOATS = {"float32": 3.402823466e38, "float64": float("inf")}
"""The greatest finite value of each float type."""
_NAMES = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}


class FieldType:
    """The type of a value."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Scalar(FieldType):
    """`name` is the ROS name of the type; `limit` bounds the length of a string."""

    name: str
    limit: int | None = None

    def __str__(self) -> str:
        return self.name if self.limit is None else f"{self.name}<={self.limit}"


@dataclass(frozen=True, slots=True)
class Message(FieldType):
    """A message inside a message."""

    cls: type

    def __str__(self) -> str:
        return short_name(self.cls)


@dataclass(frozen=True, slots=True)
class Listing(FieldType):
    """An array of exactly `size`, a sequence of at most `limit`, or an unbounded one."""

    item: FieldType
    size: int | None = None
    limit: int | None = None

    def __str__(self) -> str:
        if self.size is not None:
            return f"{self.item}[{self.size}]"
        return f"{self.item}[]" if self.limit is None else f"{self.item}[<={self.limit}]"


@lru_cache(maxsize=4096)
def describe(cls: type) -> Mapping[str, FieldType]:
    """Return the fields of a message class in order, with their types."""
    generated: Any = cls
    names = generated.get_fields_and_field_types()
    return {name: _type(slot) for name, slot in zip(names, generated.SLOT_TYPES, strict=True)}


def no_field(cls: type, name: str) -> str:
    """Say that a message class has no such field, and what may be meant."""
    near = what_it_has(name, describe(cls), ": it has no fields")
    return f"{short_name(cls)} has no field {name!r}{near}"


@lru_cache(maxsize=4096)
def constants(cls: type) -> Mapping[str, object]:
    """Return the constants that a message class declares; a byte is a number."""
    # rosidl keeps them on the metaclass, as properties and in a private dictionary.
    return {
        name: scalar(getattr(cls, name))
        for name in vars(type(cls))
        if name.isupper() and not name.startswith("_") and not name.endswith("__DEFAULT")
    }


def constant_name(message: object, field: str, value: int) -> str:
    """Return the constant FIELD_X of the message's type that has `value`, as X; else the number."""
    start = f"{field.upper()}_"
    cls: type = type(message)
    for name, known in constants(cls).items():
        if name.startswith(start) and known == value:
            return name.removeprefix(start)
    return str(value)


def fields_in_words(message: object) -> str:
    """Return the first scalar fields of a ROS message: names, values, constants by their name."""
    fields = getattr(message, "get_fields_and_field_types", dict[str, str])()
    return scalars(
        ((field, getattr(message, field)) for field in fields), partial(constant_name, message)
    )


def _type(slot: Any) -> FieldType:
    from rosidl_parser import definition as idl  # here, so that naming a type needs no ROS

    if isinstance(slot, idl.BasicType):
        return Scalar(_NAMES.get(slot.typename, slot.typename))
    limit = getattr(slot, "maximum_size", None)  # the bound, where there is one
    if isinstance(slot, idl.AbstractGenericString):
        return Scalar("wstring" if isinstance(slot, idl.AbstractWString) else "string", limit)
    if isinstance(slot, idl.AbstractNestedType):
        return Listing(_type(slot.value_type), getattr(slot, "size", None), limit)
    module = importlib.import_module(".".join(slot.namespaces))
    return Message(getattr(module, slot.name))
