"""Values that live on py_trees' blackboard, and how goals and results refer to them. No ROS.

Everything here reads and writes at the moment it is called, so call it on the ticking thread:
the blackboard is process-global and has no lock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from py_trees.blackboard import Blackboard

from bt_actions.utilities.plain_data import numbers_only


class MissingVariable(ValueError, KeyError):
    """A variable was read that nobody has written, or that has no such field."""

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


def read(name: str) -> Any:
    """Return the value of a variable, or of a field of it; raises MissingVariable."""
    try:
        value = Blackboard.storage[key(name)]
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
    """Return whether `resolve` would read anything."""
    found: list[Var] = []
    resolve(data, found.append)
    return bool(found)
