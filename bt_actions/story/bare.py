"""A state without the values that a robot moved by, as events/bare.py strips events of them."""

from __future__ import annotations

import dataclasses
from collections import deque
from typing import Any

from bt_actions.events.bare import bare, bare_node, outcome_of, reason_of
from bt_actions.events.kinds import Event, Moment, Node
from bt_actions.story.failures import Warned
from bt_actions.story.state import State

_TEXTS = {"message": outcome_of, "warning": lambda text: ""}
"""Fields of a state's parts that may hold values, each with what stays of it."""
_VALUES = ("goal", "result")


def stripped(state: State) -> State:
    """Return the state that bare events alone would have given."""
    found: State = _Stripping().of(state)
    return found


class _Stripping:
    """The stripping of one state: an object in several places stays one object."""

    def __init__(self) -> None:
        self._done: dict[int, tuple[object, Any]] = {}
        """Each object by its id, with its stripped copy; the entry keeps the object alive."""

    def of(self, held: Any) -> Any:
        if id(held) not in self._done:
            self._done[id(held)] = held, self._new(held)
        return self._done[id(held)][1]

    def _new(self, held: Any) -> Any:
        if isinstance(held, Moment):
            return held
        if isinstance(held, Event):
            return bare(held)
        if isinstance(held, Node):
            return bare_node(held)
        if isinstance(held, Warned):
            return None
        if isinstance(held, dict):
            return {key: new for key, each in held.items() if (new := self.of(each)) is not None}
        if isinstance(held, deque):
            return deque(map(self.of, held), held.maxlen)
        if isinstance(held, list | tuple):
            return type(held)(map(self.of, held))
        if not dataclasses.is_dataclass(held):
            return held
        new = dict[str, Any]()
        for each in dataclasses.fields(held):
            value = getattr(held, each.name)
            if each.name in _TEXTS:
                new[each.name] = _TEXTS[each.name](value)
            elif each.name == "reason":
                new[each.name] = reason_of(held.outcome, value)  # type: ignore[union-attr]
            else:
                new[each.name] = None if each.name in _VALUES else self.of(value)
        return dataclasses.replace(held, **new)  # type: ignore[type-var]  # an object, no class
