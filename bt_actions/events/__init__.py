"""The events of a run, one stream that feeds terminal, log, recorder and page. Values only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.goals.policy import End, Outcome


@dataclass(frozen=True, slots=True)
class TreeStarted:
    """The first tick is about to come. `time` is in seconds on the steady clock, as in all."""

    time: float


@dataclass(frozen=True, slots=True)
class NodeChanged:
    """A node of the tree has another status."""

    time: float
    path: tuple[str, ...]
    """The names from the root down to the node."""
    node: Behaviour
    status: Status
    message: str


@dataclass(frozen=True, slots=True)
class GoalChanged:
    """A goal has a new state, outcome or end; also after its leaf has left it."""

    time: float
    behaviour: Behaviour
    """The leaf, an `ActionBehaviour`."""
    state: str
    attempt: int
    outcome: Outcome | None
    end: End | None
    reason: str
    goal_id: str = ""
    """The goal's UUID in hexadecimal."""


@dataclass(frozen=True, slots=True)
class TreeFinished:
    """The tree has a status of its own, or was interrupted (INVALID); its goals are drained."""

    time: float
    status: Status


Event: TypeAlias = TreeStarted | NodeChanged | GoalChanged | TreeFinished
Observer: TypeAlias = Callable[[Event], None]
"""Called on the ticking thread, or by who leaves a tick that does not return; one that raises is
removed, and the run goes on."""
