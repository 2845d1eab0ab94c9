"""Values on py_trees' blackboard, and references of goals and results to them. No ROS.

Every function here reads and writes at once, so call it on the ticking thread: the blackboard is
process-global and has no lock.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from py_trees.blackboard import ActivityItem, ActivityStream, ActivityType, Blackboard

from bt_actions.events.snapshot import HIDDEN
from bt_actions.events.teller import current_teller
from bt_actions.utilities.plain_data import numbers_only


class MissingVariable(ValueError, KeyError):
    """A read of a variable without a value, or without such a field."""

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True, slots=True)
class Var:
    """A place for a value that is read from the blackboard when the goal is sent.

    `name` is a blackboard key, with or without the leading slash; ``pick_at.position.0`` reads on
    into fields, keys and indices.
    """

    name: str

    def read(self) -> Any:
        """Return the value; raises MissingVariable."""
        return read(self.name)


def key(name: str) -> str:
    """Return the absolute blackboard key of a variable, without the way into its fields."""
    return "/" + name.lstrip("/").split(".", 1)[0]


_secret: set[str] = set()
"""The keys of variables whose values no event tells."""


def hide(keys: Iterable[str]) -> None:
    """Have no event tell the values of these keys, nor values computed from them."""
    _secret.update(keys)


def unhide(keys: Iterable[str]) -> None:
    """Forget that these keys are secret: their tree is gone."""
    _secret.difference_update(keys)


def is_hidden(key: str) -> bool:
    """Return whether the value of this key is a secret."""
    return key in _secret


def value_of(key: str) -> Any:
    """Return the value of an absolute key, and take note of a secret.

    Raises KeyError without a value.
    """
    if key in _secret and (teller := current_teller.get()) is not None:
        teller.reads_secret = True
    return Blackboard.storage[key]


def read(name: str) -> Any:
    """Return the value of a variable, or of a field of it; raises MissingVariable."""
    try:
        value = value_of(key(name))
    except KeyError:
        raise MissingVariable(f"variable {name!r} has no value") from None
    for step in name.lstrip("/").split(".")[1:]:
        if not step or step.startswith("_"):
            raise MissingVariable(f"variable {name!r}: {step!r} is no field")
        try:
            if isinstance(value, Mapping):
                value = value[step]
            else:
                value = value[int(step)] if step.isdigit() else getattr(value, step)
        except (LookupError, TypeError, AttributeError):
            raise MissingVariable(
                f"variable {name!r}: {step!r} is no field of a {type(value).__name__}"
            ) from None
    return value


def write(values: Mapping[str, object]) -> None:
    """Give variables their values, by their absolute keys, and tell the run."""
    Blackboard.storage.update(values)
    if (teller := current_teller.get()) is not None:
        if teller.reads_secret:
            hide(values)
        for name, value in values.items():
            teller.wrote(name, HIDDEN if name in _secret else value)


_WRITES = (ActivityType.WRITE.value, ActivityType.INITIALISED.value)


class _Overhearing(ActivityStream):
    """A stream that tells the run on this thread the writes of blackboard clients.

    py_trees has one such stream for all; the stream that was there before is told, too.
    """

    runs = 0
    """The number of runs that listen."""

    def __init__(self, before: ActivityStream | None) -> None:
        super().__init__(maximum_size=0)
        self.before = before

    def push(self, activity_item: ActivityItem) -> None:
        """Take note of a client's activity (py_trees calls this)."""
        if self.before is not None:
            self.before.push(activity_item)
        if (teller := current_teller.get()) is None:
            return
        teller.reads_secret |= activity_item.key in _secret
        if activity_item.activity_type in _WRITES:
            if teller.reads_secret:
                hide([activity_item.key])
            is_told = activity_item.key not in _secret
            teller.wrote(activity_item.key, activity_item.current_value if is_told else HIDDEN)


_overhearing = threading.Lock()


def overhear() -> None:
    """Have writes of blackboard clients told to the runs that tick; see overhear_less."""
    with _overhearing:
        _Overhearing.runs += 1
        if not isinstance(Blackboard.activity_stream, _Overhearing):
            Blackboard.activity_stream = _Overhearing(Blackboard.activity_stream)


def overhear_less() -> None:
    """Undo one `overhear`."""
    with _overhearing:
        _Overhearing.runs -= 1
        stream = Blackboard.activity_stream
        if not _Overhearing.runs and isinstance(stream, _Overhearing):
            Blackboard.activity_stream = stream.before


def resolve(data: Any, value_of: Callable[[Var], Any] = Var.read) -> Any:
    """Return plain data with every Var in it replaced by its value; raises MissingVariable."""
    if isinstance(data, Var):
        return value_of(data)
    if isinstance(data, Mapping):
        return {name: resolve(value, value_of) for name, value in data.items()}
    if isinstance(data, list | tuple):
        if numbers_only(data):
            return [*data]
        return [resolve(value, value_of) for value in data]
    return data


def reads_variables(data: Any) -> bool:
    """Return whether `resolve` would read any variable."""
    found: list[Var] = []
    resolve(data, found.append)
    return bool(found)
