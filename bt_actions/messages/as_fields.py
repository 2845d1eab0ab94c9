"""The fields to write for a message that was given as a list of numbers, or as an angle:
``{x: 1.0, y: 2.0, z: 0.0}``, ``{yaw: 90 deg}``."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping

from bt_actions.messages.fields import FLOATS, INTEGERS, Message, Scalar, describe
from bt_actions.messages.interfaces import interface_name
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.units import TURN, parse_angle

_PARTS = (list, tuple, Mapping, str)
_ANGLES = "{roll: %s, pitch: %s, yaw: %s}"


def as_fields(cls: type, value: object) -> str:
    """Return a message's fields filled with a list's numbers, in order; "" where they do not fit.

    Values of variables stand as dots. An angle is the yaw of a quaternion.
    """
    is_rotation = interface_name(cls) == "geometry_msgs/msg/Quaternion"
    if is_rotation and isinstance(value, (str, int, float)):
        with contextlib.suppress(ValueError):
            return f"{{yaw: {_in_degrees(value, abs(parse_angle(value)) > TURN)}}}"
    if not isinstance(value, (list, tuple)) or any(isinstance(each, _PARTS) for each in value):
        return ""
    items = [shorten(each, 20) if isinstance(each, (int, float)) else "..." for each in value]
    if is_rotation:
        if len(items) == 3:
            beyond = any(isinstance(each, (int, float)) and abs(each) > TURN for each in value)
            return _ANGLES % tuple(_in_degrees(each, beyond) for each in items)
        return f"{_filled(cls, iter(items))} or {{yaw: 90 deg}}" if len(items) == 4 else ""
    return _filled(cls, iter(items)) if 0 < len(items) == _numbers_in(cls) else ""


def _in_degrees(angle: object, beyond: bool) -> str:
    """Write an angle as it is meant by people who write one `beyond` a turn without a unit."""
    said = angle if isinstance(angle, str) else shorten(angle, 20)
    return f"{said} deg" if beyond and said[-1].isdigit() and said != "0" else said


def _numbers_in(cls: type) -> int:
    """Count the numbers that a message consists of; 0 where other fields are in it."""
    counts = []
    for kind in describe(cls).values():
        if isinstance(kind, Message):
            counts.append(_numbers_in(kind.cls))
        else:
            number = isinstance(kind, Scalar) and (kind.name in FLOATS or kind.name in INTEGERS)
            counts.append(int(number))
    return sum(counts) if all(counts) else 0


def _filled(cls: type, items: Iterator[str]) -> str:
    parts = []
    for name, kind in describe(cls).items():
        inner = _filled(kind.cls, items) if isinstance(kind, Message) else next(items)
        parts.append(f"{name}: {inner}")
    return f"{{{', '.join(parts)}}}"
