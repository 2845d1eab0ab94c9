"""Short forms of a message's fields: times, durations, angles, constants by name.

A function returns an unknown form unchanged, and raises ValueError with a readable text for a
known form with a mistake.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from bt_actions.messages.fields import constants
from bt_actions.messages.interfaces import PARTS, UnknownInterface, called, interface, short_name
from bt_actions.utilities.suggest import did_you_mean, what_it_has
from bt_actions.utilities.units import parse_seconds

_BILLION = 1_000_000_000
_CONSTANT = re.compile(r"(?:([A-Za-z0-9_./]+)\.)?([A-Z][A-Z0-9_]*)")
ANGLES = ("roll", "pitch", "yaw")


def time_of(value: object, now: Callable[[], int]) -> object:
    """Return ``now``, or seconds since the epoch, as the fields of a builtin_interfaces/Time."""
    if value == "now":
        nanoseconds = now()
        return {"sec": nanoseconds // _BILLION, "nanosec": nanoseconds % _BILLION}
    if isinstance(value, str):
        raise ValueError(f"a time is 'now', seconds, or {{sec, nanosec}}, not {value!r}")
    return _seconds(value)


def duration_of(value: object) -> object:
    """Return ``500 ms``, ``-1 s`` or seconds as a builtin_interfaces/Duration's fields."""
    return _seconds(parse_seconds(value) if isinstance(value, str) else value)


def _seconds(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    if not math.isfinite(value) or not -(2**31) <= value < 2**31:
        raise ValueError(f"{value} seconds do not fit a time")
    nanoseconds = round(value * _BILLION)
    return {"sec": nanoseconds // _BILLION, "nanosec": nanoseconds % _BILLION}


def quaternion_of(value: object, angle: Callable[[str, object], float]) -> object:
    """Return ``{yaw: 90 deg}`` (and roll, pitch: fixed axes x, y, z) as a unit quaternion's fields.

    `angle` returns the radians of one of them.
    """
    if not isinstance(value, Mapping) or not any(name in value for name in ANGLES):
        return value
    for name in value:
        if name not in ANGLES:
            raise ValueError(f"roll, pitch and yaw stand alone: {name!r} cannot be beside them")
    halves = (angle(name, value[name]) / 2 if name in value else 0.0 for name in ANGLES)
    (sin_r, cos_r), (sin_p, cos_p), (sin_y, cos_y) = ((math.sin(h), math.cos(h)) for h in halves)
    return {
        "x": sin_r * cos_p * cos_y - cos_r * sin_p * sin_y,
        "y": cos_r * sin_p * cos_y + sin_r * cos_p * sin_y,
        "z": cos_r * cos_p * sin_y - sin_r * sin_p * cos_y,
        "w": cos_r * cos_p * cos_y + sin_r * sin_p * sin_y,
    }


def constant(text: str, owner: type | None) -> object:
    """Return the constant that a name stands for in a field of `owner`; other texts as they are.

    ``STATUS_MOVING`` is looked up in `owner`; ``MoveRobot.Feedback.STATUS_MOVING``,
    ``Feedback.STATUS_MOVING`` and ``sensor_msgs/msg/BatteryState.POWER_SUPPLY_STATUS_FULL`` in the
    class they name: beside `owner` unless a package is given, else in the one installed package
    that has it. Raises UnknownInterface for a class that is unknown, and ValueError for a constant.
    """
    match = _CONSTANT.fullmatch(text)
    if match is None or (match[1] is None and owner is None):
        return text
    place: Any = owner if match[1] is None else _class(match[1], owner)
    known = constants(place)
    if match[2] not in known:
        near = what_it_has(match[2], known)
        raise ValueError(f"{short_name(place)} has no constant {match[2]!r}{near}")
    return known[match[2]]


def _class(path: str, owner: type | None) -> type:
    """Return the class of a path such as ``MoveRobot.Feedback``, in `owner`'s package or any."""
    place, slash, rest = path.rpartition("/")
    name, _, part = rest.partition(".")
    if owner is not None and path in PARTS:
        name, part = owner.__name__.rpartition("_")[0], path
    kind = PARTS.get(part or name, "action" if part else "msg")
    found: type | None = None
    if owner is not None and not slash:
        with contextlib.suppress(UnknownInterface):
            found = interface(f"{owner.__module__.split('.')[0]}/{name}", kind)
    found = found or called(f"{place}{slash}{name}", kind)
    if not part:
        return found
    parts = [each for each in PARTS if hasattr(found, each)]
    if part not in parts:
        near = did_you_mean(part, parts)
        raise UnknownInterface(f"no message class {path!r} is known here{near}")
    return getattr(found, part)  # type: ignore[no-any-return]
