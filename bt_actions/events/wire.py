"""Events as JSON and back, exactly: an event that was read equals the one that was written.

A value that JSON lacks stands in an object with one key that begins with a dollar sign:
``{"$float": "nan"}``, ``{"$int": "9223372036854775807"}`` beyond what a float holds, ``{"$bytes":
"..."}`` in base64, ``{"$cut": [head, more]}``, and ``{"$map": [[key, value], ...]}`` for a
dictionary with such a key of its own.
"""

from __future__ import annotations

import base64
import dataclasses
import enum
import json
import math
import types
import typing
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

from bt_actions.events import kinds
from bt_actions.events.kinds import Event, Moment
from bt_actions.events.snapshot import Cut

_LATEST = 1e11
"""Seconds of any clock, at most: a date of it can be written, and a difference taken."""
_JSON = json.JSONEncoder(separators=(",", ":"), allow_nan=False)
_EXACT = 2**53
"""The limit up to which every reader of JSON has whole numbers exactly."""
_MOST = 2**63
"""Numbers that count something: beyond 4,300 digits Python writes none."""
KINDS: dict[str, type[Event]] = {
    name: kind
    for name, kind in vars(kinds).items()
    if isinstance(kind, type) and issubclass(kind, Event) and kind is not Event
}
"""The kinds of events by name."""


class WireError(ValueError):
    """A line that is no event."""


def to_line(event: Event) -> str:
    """Return an event as one line of ASCII without its end."""
    return _JSON.encode(to_plain(event))


def from_line(line: str | bytes) -> Event:
    """Return the event of a line; raises WireError."""
    try:
        return from_plain(json.loads(line))
    except (ValueError, RecursionError) as error:
        raise WireError(f"no event: {error}") from error


def to_plain(event: Event) -> dict[str, Any]:
    """Return an event as data for JSON; `kind` is its name."""
    return {"kind": type(event).__name__, **_fields_of(event)}


def from_plain(data: object) -> Event:
    """Return the event of such data; raises WireError."""
    try:
        given = dict(data)  # type: ignore[call-overload]
        kind = KINDS[given.pop("kind")]
        readers: dict[str, Reader] = _readers(kind)  # type: ignore[arg-type]  # a class is hashable
        return kind(**{name: readers[name](value) for name, value in given.items()})
    except (
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        OverflowError,
        RecursionError,
    ) as error:
        raise WireError(f"no event: {type(error).__name__} {error}") from error


def packed(value: Any) -> Any:
    """Return a value of an event as data for JSON."""
    kind = type(value)
    if value is None or kind is str or kind is bool:
        return value
    if kind is float:
        return value if math.isfinite(value) else {"$float": str(value)}
    if kind is int:
        return value if -_EXACT <= value <= _EXACT else {"$int": str(value)}
    if isinstance(value, tuple):
        return [packed(item) for item in value]
    if kind is dict:
        if any(name.startswith("$") for name in value):
            return {"$map": [[name, packed(item)] for name, item in value.items()]}
        return {name: packed(item) for name, item in value.items()}
    if isinstance(value, enum.Enum):
        return value.value
    if kind is bytes:
        return {"$bytes": base64.b64encode(value).decode()}
    if kind is Cut:
        return {"$cut": [packed(value.head), value.more]}
    return _fields_of(value)


def _fields_of(held: Any) -> dict[str, Any]:
    return {name: packed(getattr(held, name)) for name in held.__dataclass_fields__}


def _value(data: Any) -> Any:
    """Return the snapshot that was packed."""
    if isinstance(data, list):
        return tuple(_value(item) for item in data)
    if not isinstance(data, dict):
        return data
    if len(data) == 1:
        ((tag, held),) = data.items()
        match tag:
            case "$float":
                return float(held)
            case "$int":
                return int(held)
            case "$bytes":
                return base64.b64decode(held, validate=True)
            case "$cut":
                return Cut(_value(held[0]), _plain(held[1], int))
            case "$map":
                return {str(name): _value(item) for name, item in held}
    return {name: _value(item) for name, item in data.items()}


Reader = Callable[[Any], Any]


@lru_cache(maxsize=64)
def _readers(kind: Any) -> dict[str, Reader]:
    """Return the reader of each field of a kind."""
    return {name: reader_of(hint) for name, hint in typing.get_type_hints(kind).items()}


def reader_of(hint: Any) -> Reader:
    """Return the function that reads such data back as a value of this type."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType) and type(None) in inner and len(inner) == 2:
        read = reader_of(next(each for each in inner if each is not type(None)))
        return lambda data: None if data is None else read(data)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return hint
    if hint is Moment:
        return _moment
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        fields = _readers(hint)
        return lambda data: hint(**{name: fields[name](each) for name, each in data.items()})
    if origin is tuple and len(inner) == 2 and inner[1] is Ellipsis:
        read = reader_of(inner[0])
        return lambda data: tuple(read(each) for each in data)
    if origin is Mapping:
        return lambda data: _mapping(data, inner[1])
    if hint in (bool, int, float, str):
        return lambda data: _plain(data, hint)
    return _value


def _moment(data: Any) -> Moment:
    number, *clocks = data
    at = Moment(_plain(number, int), *(_plain(each, float) for each in clocks))
    if not all(abs(each) < _LATEST for each in at[1:]):
        raise WireError("no clock can show that moment")
    return at


def _plain(data: Any, wanted: type) -> Any:
    value = _value(data)
    if type(value) is not wanted:
        raise WireError(f"{wanted.__name__} is needed, not {type(value).__name__}")
    if isinstance(value, int) and not -_MOST <= value < _MOST:
        raise WireError("a number of 64 bits is needed")
    return value


def _mapping(data: Any, of: Any) -> dict[str, Any]:
    found: dict[str, Any] = _plain(data, dict)
    if of is str and not all(isinstance(each, str) for each in found.values()):
        raise WireError("texts are needed")
    return found
