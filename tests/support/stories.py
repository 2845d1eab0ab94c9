"""Events folded: what they say of nodes by their names."""

from __future__ import annotations

from collections.abc import Iterable

from py_trees.common import Status

from bt_actions.events import Event, NodeChanged
from bt_actions.story.state import State


def state_of(events: Iterable[Event]) -> State:
    """Return where a run stands after these events."""
    state = State()
    for event in events:
        state.fold(event)
    return state


def changes_of(events: Iterable[Event]) -> list[tuple[tuple[str, ...], Status]]:
    """Return the path and the status of each change of a node."""
    state, changes = State(), []
    for event in events:
        state.fold(event)
        if isinstance(event, NodeChanged):
            changes.append((state.path(event.node), event.status))
    return changes
