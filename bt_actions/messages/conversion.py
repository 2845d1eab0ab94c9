"""A ROS message from plain data and back, checked field by field against its type.

All functions are pure: no node, no rclpy, and no clock unless the caller gives none.
"""

from __future__ import annotations

import array
import contextlib
import math
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from bt_actions.messages.as_fields import as_fields
from bt_actions.messages.conveniences import constant, duration_of, quaternion_of, time_of
from bt_actions.messages.fields import (
    FLOATS,
    INTEGERS,
    FieldType,
    Listing,
    Message,
    Scalar,
    describe,
    no_field,
)
from bt_actions.messages.interfaces import DURATION, interface_name, short_name
from bt_actions.utilities.plain_data import field_of, numbers_only, plain, scalar
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.units import parse_angle

Path = tuple[str | int, ...]
Hole = Callable[[object, FieldType, Path], bool]
M = TypeVar("M")
_CODES = dict(zip([*FLOATS, *INTEGERS], "fdbhiqBHIQ", strict=False))
"""The type code of the array.array in which rosidl keeps a sequence of numbers, by its type. A list
holds those of the last type, `byte`.
"""
ANGLE = Scalar("float64")
"""The type of roll, pitch and yaw: this very object says that they are radians."""
_NUMBER = re.compile(r" *[-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)? *(?P<unit>[A-Za-z/%°]{0,9})")

_NO_TEXT = re.compile(r"[\0\ud800-\udfff]")
"""The end of C's strings, and halves of characters."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake in the data: its place (`at_key`: the field's name itself), and what is wrong."""

    path: Path
    text: str
    at_key: bool = False

    def __str__(self) -> str:
        return f"{dotted(self.path)}: {self.text}" if self.path else self.text


class MessageError(ValueError):
    """Data that does not fit a message's type."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__("; ".join(str(problem) for problem in problems[:10]))
        self.problems = tuple(problems)


def fill(message_type: type[M], data: object, *, now: Callable[[], int] = time.time_ns) -> M:
    """Make a message of a mapping of its fields; a field that is not named keeps its default.

    `data` may hold message objects at any depth, and may be one of `message_type` already. `now`
    gives nanoseconds for `stamp: now`; pass the node's clock where there is one. Raises
    MessageError, with every problem in it.
    """
    return _filled(Message(message_type), data, now)  # type: ignore[no-any-return]


def fill_value(kind: FieldType, data: object) -> object:
    """Make a value of type `kind` in a tree's form: a byte is a number, an array stays an array.

    Raises MessageError.
    """
    value = _filled(kind, data, time.time_ns)
    was_array = isinstance(data, (array.array, bytes, bytearray))
    return value if was_array and isinstance(value, array.array) else plain(value)


def _filled(kind: FieldType, data: object, now: Callable[[], int]) -> Any:
    filler = _Filler(now)
    value = filler.convert(kind, data, ())
    if filler.problems:
        raise MessageError(filler.problems)
    return value


def examine(
    kind: FieldType, data: object, hole: Hole = lambda _value, _kind, _path: False
) -> list[Problem]:
    """Return what is wrong with the data; make nothing.

    `hole` is asked first about each value but a mapping, with the type it must have: True means
    that the value is settled there (a variable, whose type the caller checks).
    """
    filler = _Filler(time.time_ns, hole)
    filler.convert(kind, data, ())
    return filler.problems


def to_plain(message: object) -> Any:
    """Return dictionaries, lists and scalars that JSON can say (except NaN and infinities)."""
    fields = getattr(type(message), "get_fields_and_field_types", None)
    if fields is not None:
        types = fields()
        return {name: to_plain(field_of(message, name, types)) for name in types}
    message = plain(message)  # array.array and numpy alike
    if isinstance(message, (list, tuple, bytes)):
        if numbers_only(message):
            return list(message)
        return [to_plain(item) for item in message]
    if isinstance(message, Mapping):
        return {str(key): to_plain(value) for key, value in message.items()}
    return message


def dotted(path: Iterable[str | int]) -> str:
    """Write a path as ``pose.position.x``."""
    return ".".join(str(part) for part in path)


class _Filler:
    """A walk through type and data together, which collects problems and does not raise."""

    def __init__(self, now: Callable[[], int], hole: Hole | None = None) -> None:
        """Take a clock; with a `hole`, whose values are not there yet, only the problems count."""
        self.problems: list[Problem] = []
        self._now = now
        self._hole = hole
        self._owner: type | None = None

    def convert(self, kind: FieldType, value: object, path: Path) -> Any:
        """Return the value for the field; None for one that is settled elsewhere, or wrong."""
        hole = None if isinstance(value, dict) else self._hole
        if hole is not None and hole(value, kind, path):
            return None
        try:
            if isinstance(kind, Message):
                return self._message(kind.cls, value, path)
            if isinstance(kind, Listing):
                return self._listing(kind, value, path)
            assert isinstance(kind, Scalar), "a message has no field of another kind"
            return self._scalar(kind, scalar(value))
        except ValueError as error:
            self.problems.append(Problem(path, str(error)))
            return None

    def _message(self, cls: type, value: object, path: Path) -> Any:
        if isinstance(value, cls):
            return value
        value = self._convenience(cls, value, path)
        if not isinstance(value, (dict, Mapping)):
            near = as_fields(cls, value)
            said = f"the fields of a {short_name(cls)} are needed, not {show(value)}"
            raise ValueError(f"{said}: write {near}" if near else said)
        known = describe(cls)
        message = cls() if self._hole is None else None
        outer, self._owner = self._owner, cls
        for name, item in value.items():
            kind = known.get(name)
            if kind is None:
                problem = Problem((*path, str(name)), no_field(cls, str(name)), at_key=True)
                self.problems.append(problem)
                continue
            converted = self.convert(kind, item, (*path, name))
            if self._hole is None and not self.problems:
                setattr(message, name, converted)
        self._owner = outer
        return message

    def _convenience(self, cls: type, value: object, path: Path) -> object:
        """Return the fields of a time, a duration or a quaternion in a short form."""
        name = interface_name(cls)
        if name == "builtin_interfaces/msg/Time":
            return time_of(value, self._now)
        if name == DURATION:
            return duration_of(value)
        if name == "geometry_msgs/msg/Quaternion":
            return quaternion_of(value, lambda name, angle: self._angle(angle, (*path, name)))
        return value

    def _angle(self, value: object, path: Path) -> float:
        """Return the radians; 0 for an angle that is settled elsewhere."""
        if self._hole is not None and self._hole(value, ANGLE, path):
            return 0.0
        return parse_angle(value)

    def _listing(self, kind: Listing, value: object, path: Path) -> Any:
        name = str(kind.item)
        items: Any = array.array("B", value) if isinstance(value, (bytes, bytearray)) else value
        if hasattr(items, "tolist") and getattr(items, "typecode", None) != _CODES.get(name):
            items = plain(items)  # numpy's, too
        if not isinstance(items, (list, tuple, array.array)):
            raise ValueError(f"a list of {name} is needed, not {show(value)}")
        converted: Any = None if self._hole else _numbers(name, items)  # maybe millions
        if converted is None:
            converted = [self.convert(kind.item, each, (*path, n)) for n, each in enumerate(items)]
        if kind.size is not None and len(items) != kind.size:
            raise ValueError(f"exactly {kind.size} items are needed, not {len(items)}")
        if kind.limit is not None and len(items) > kind.limit:
            raise ValueError(f"at most {kind.limit} items fit, not {len(items)}")
        return converted

    def _scalar(self, kind: Scalar, value: Any) -> Any:
        if isinstance(value, str) and kind.name not in ("string", "wstring"):
            value = constant(value, self._owner)
        if kind.name in FLOATS or kind.name in INTEGERS:
            return _number(kind.name, value)
        if kind.name == "bool":
            if not isinstance(value, bool):
                raise ValueError(f"true or false is needed, not {show(value)}")
        elif not isinstance(value, str):
            raise ValueError(f"a text is needed, not {show(value)}")
        elif kind.limit is not None and len(value) > kind.limit:
            raise ValueError(f"at most {kind.limit} characters fit, not {len(value)}")
        elif _NO_TEXT.search(value):
            raise ValueError("this text holds characters that no ROS string can carry")
        return value


def _numbers(name: str, items: Any) -> array.array[Any] | None:
    """Return numbers in rosidl's form, checked in C; None for numbers that need a loop."""
    if isinstance(items, array.array):
        return items
    kinds = set(map(type, items))
    if name in _CODES and (kinds == {int} or (name in FLOATS and kinds <= {int, float})):
        with contextlib.suppress(OverflowError):
            if name != "float32" or max(map(abs, items), default=0.0) <= FLOATS[name]:
                return array.array(_CODES[name], items)
    return None


def _number(name: str, value: Any) -> object:
    whole = name in INTEGERS
    if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)):
        what, hint = "a whole number" if whole else "a number", ""
        if isinstance(value, str) and len(value) < 40 and (found := _NUMBER.fullmatch(value)):
            hint = ": write the number alone, in the unit that is expected"
            hint = hint if found["unit"] else ": without its quotes it is one"
        raise ValueError(f"{what} ({name}) is needed, not {show(value)}{hint}")
    if whole:
        least, greatest = INTEGERS[name]
        if not least <= value <= greatest:
            a = "an" if name.startswith("i") else "a"
            raise ValueError(f"{show(value)} does not fit {a} {name}: {least} to {greatest}")
        return bytes([int(value)]) if name == "byte" else value
    with contextlib.suppress(OverflowError):
        if not FLOATS[name] < abs(float(value)) < math.inf:
            return float(value)
    raise ValueError(f"{show(value)} does not fit a {name}")


def show(value: object) -> str:
    """Return a value in the form of messages: as in YAML where that is short."""
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "a list"
    if hasattr(value, "get_fields_and_field_types"):
        return f"a {short_name(type(value))}"
    return shorten(value, 40)
