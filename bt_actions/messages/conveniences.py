"""What people write instead of a message's fields: times, durations, angles, constants by name.

Each function leaves alone what it does not know, and raises ValueError with a readable text for
what it knows and finds wrong.
"""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Callable, Mapping
from functools import lru_cache

from bt_actions.messages.fields import constants
from bt_actions.messages.interfaces import (
    PARTS,
    Kind,
    UnknownInterface,
    installed,
    interface,
    short_name,
)
from bt_actions.utilities.suggest import did_you_mean
from bt_actions.utilities.units import parse_angle, parse_duration

_BILLION = 1_000_000_000
_CONSTANT = re.compile(r"(?:([A-Za-z0-9_./]+)\.)?([A-Z][A-Z0-9_]*)")
ANGLES = ("roll", "pitch", "yaw")


class UnknownClass(ValueError):
    """What stands before a constant's name is no message class."""


def time_of(value: object, now: Callable[[], int]) -> object:
    """``now``, or seconds since the epoch, as the fields of a builtin_interfaces/Time."""
    if value == "now":
        nanoseconds = now()
        return {"sec": nanoseconds // _BILLION, "nanosec": nanoseconds % _BILLION}
    if isinstance(value, str):
        raise ValueError(f"a time is 'now', seconds, or {{sec, nanosec}}, not {value!r}")
    return _seconds(value)


def duration_of(value: object) -> object:
    """``500 ms`` or seconds as the fields of a builtin_interfaces/Duration."""
    if isinstance(value, str):
        return _seconds(parse_duration(value))
    return _seconds(value)


def _seconds(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return value
    if not math.isfinite(value) or not -(2**31) <= value < 2**31:
        raise ValueError(f"{value} seconds do not fit a time")
    nanoseconds = round(value * _BILLION)
    return {"sec": nanoseconds // _BILLION, "nanosec": nanoseconds % _BILLION}


def quaternion_of(value: object) -> object:
    """``{yaw: 90 deg}`` (and roll, pitch: fixed axes x, y, z) as a unit quaternion's fields."""
    if not isinstance(value, Mapping) or not any(name in value for name in ANGLES):
        return value
    for name in value:
        if name not in ANGLES:
            raise ValueError(f"roll, pitch and yaw stand alone: {name!r} cannot be beside them")
    roll, pitch, yaw = (parse_angle(value.get(name, 0.0)) / 2 for name in ANGLES)
    sin_r, cos_r, sin_p, cos_p = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sin_y, cos_y = math.sin(yaw), math.cos(yaw)
    return {
        "x": sin_r * cos_p * cos_y - cos_r * sin_p * sin_y,
        "y": cos_r * sin_p * cos_y + sin_r * cos_p * sin_y,
        "z": cos_r * cos_p * sin_y - sin_r * sin_p * cos_y,
        "w": cos_r * cos_p * cos_y + sin_r * sin_p * sin_y,
    }


def constant(text: str, owner: type | None) -> object:
    """The constant a name stands for, seen from a field of `owner`; other texts are returned.

    ``STATUS_MOVING`` is looked up in `owner`; ``MoveRobot.Feedback.STATUS_MOVING``,
    ``Feedback.STATUS_MOVING`` and ``sensor_msgs/msg/BatteryState.POWER_SUPPLY_STATUS_FULL`` in the
    class they name: beside `owner` unless a package is given, else in the one installed package
    that has it.
    """
    match = _CONSTANT.fullmatch(text)
    if match is None or (match[1] is None and owner is None):
        return text
    place = owner if match[1] is None else _class(match[1], owner)
    assert place is not None
    known = constants(place)
    if match[2] not in known:
        near = did_you_mean(match[2], known)
        text = f"{short_name(place)} has no constant {match[2]!r}"
        raise ValueError(text + (near or (f"; it has {', '.join(known)}" if known else "")))
    return known[match[2]]


def _class(path: str, owner: type | None) -> type:
    """The class a path such as ``MoveRobot.Feedback`` names, from the module of `owner`."""
    package, _, rest = path.rpartition("/")
    names = rest.split(".")
    if owner is not None and names[-1] in PARTS and len(names) == 1 and not package:
        names = [owner.__name__.rpartition("_")[0], *names]
    found: object = None
    if package:
        name, _, kind = package.partition("/")
        found = _interface(f"{name}/{kind or 'msg'}/{names[0]}")
    elif owner is not None:
        found = _beside(names[0], owner)
    kind = PARTS.get(names[-1], "msg" if len(names) == 1 else "action")
    if found is None and not package:
        found = _anywhere(names[0], kind)
    near = ""
    if found is None:
        near = did_you_mean(names[0], {full.rpartition("/")[2] for full in installed(kind)})
    for name in names[1:]:
        if isinstance(found, type) and not (name in PARTS and hasattr(found, name)):
            near = did_you_mean(name, [part for part in PARTS if hasattr(found, part)])
        found = getattr(found, name, None) if name in PARTS else None
    if not isinstance(found, type):
        raise UnknownClass(f"no message class {path!r} is known here{near}")
    return found


def _beside(name: str, owner: type) -> object:
    """An interface of the module of `owner`, or a message of its package."""
    module = importlib.import_module(".".join(owner.__module__.split(".")[:2]))
    if not hasattr(module, name) and ".msg" not in owner.__module__:
        module = importlib.import_module(f"{owner.__module__.split('.')[0]}.msg")
    return getattr(module, name, None)


@lru_cache(maxsize=256)
def _anywhere(name: str, kind: Kind) -> type | None:
    """The interface of a name, where one installed package has it."""
    found = [full for full in installed(kind) if full.rpartition("/")[2] == name]
    if len(found) > 1:
        raise ValueError(f"{name!r} may be {' or '.join(found)}: put the package before it")
    return interface(found[0], kind) if found else None


def _interface(name: str) -> type:
    kind = name.split("/")[1]
    if kind not in ("action", "srv", "msg"):
        raise ValueError(f"{name!r} is no type name: it is written package/msg/Name")
    try:
        return interface(name, kind)
    except UnknownInterface as error:
        raise ValueError(str(error)) from None
