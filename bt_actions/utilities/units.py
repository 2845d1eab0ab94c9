"""Numbers with a unit, in people's notation: ``500 ms``, ``2 min``, ``90 deg``. No ROS here."""

from __future__ import annotations

import math
import re

from bt_actions.utilities.shorten import shorten

DURATION_UNITS = {
    "ns": 1e-9,
    "us": 1e-6,
    "ms": 1e-3,
    "s": 1.0,
    "sec": 1.0,
    "min": 60.0,
    "h": 3600.0,
}
"""Seconds in each unit that a duration may carry."""
TURN = 2 * math.pi + 0.01
"""Radians, rounded up as people round. An angle beyond is likely to be meant in degrees."""
_ANGLE_UNITS = {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180}
_LONG = 2
"""Days from which a text leaves the hours out."""
_WITH_UNIT = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(\S*)\s*")


def parse_duration(value: object) -> float:
    """Return the seconds of ``"500 ms"`` or a bare number; never negative, always finite.

    Raises ValueError with a text for the author.
    """
    seconds = parse_seconds(value)
    if seconds < 0:
        raise ValueError(f"a duration is not negative: {value}")
    return seconds


def parse_seconds(value: object) -> float:
    """Return seconds as `parse_duration` does, with either sign."""
    return _parse(value, DURATION_UNITS, "a duration", "5 s")


def spoken_duration(seconds: float) -> str:
    """Return seconds in people's words: ``8 min 20 s``; from two days on, ``3.5 days``."""
    days = seconds / 86_400
    if abs(days) >= _LONG:
        return f"{days:.6g} days"
    minutes, rest = divmod(abs(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    parts = [(hours, "h"), (minutes, "min"), (rest, "s")]
    said = " ".join(f"{number:.12g} {unit}" for number, unit in parts if number)
    return f"-{said}" if seconds < 0 else said or "0 s"


def parse_angle(value: object) -> float:
    """Return the radians of ``"90 deg"``, ``"1.57 rad"`` or a bare number.

    Raises ValueError with a text for the author.
    """
    return _parse(value, _ANGLE_UNITS, "an angle", "90 deg")


def _parse(value: object, units: dict[str, float], what: str, example: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{what} is needed, such as {example!r}, not {_show(value)}")
    if isinstance(value, str):
        match = _WITH_UNIT.fullmatch(value) if len(value) <= 60 else None
        if match is None:
            raise ValueError(f"{what} is needed, such as {example!r}, not {_show(value)}")
        unit = match[2]
        if unit and unit not in units:
            known = ", ".join(units)
            raise ValueError(f"unknown unit {unit!r} in {_show(value)}: one of {known}")
        number = float(match[1]) * units.get(unit, 1.0)
    else:
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{what} is finite: {_show(value)}")
    return number


def _show(value: object) -> str:
    return shorten(value, 60)
