"""Events without the values that a robot moved by: for readers who may know the story alone.

The deeds of each node stay, with time and outcome. Goals, results, feedback,
variables, items, inputs and outputs go, and of each text the part that may hold values: see `said`.
Of nodes' messages only the outcomes of actions stay, by their names, and that a node was left out:
a user's leaf may say anything.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from bt_actions.events.kinds import (
    LEFT_OUT,
    AttemptEnded,
    Event,
    FeedbackCame,
    GoalChanged,
    Logged,
    Node,
    NodeChanged,
    NodesAdded,
    RoundBegan,
    RunBegan,
    RunEnded,
    TreeFinished,
    VariableWritten,
)
from bt_actions.events.snapshot import HIDDEN
from bt_actions.goals.policy import Outcome

_OUTCOMES = frozenset(each.value for each in Outcome)
_OF_THE_LEAF = (Outcome.UNEXPECTED_RESULT, Outcome.INVALID_GOAL)
"""Outcomes whose reason the leaf's own expressions give, so that the reason may begin with a
value."""
_VALUE = re.compile(r"\{|: |; ")
"""The beginnings of a value in a text: an action's `explain` follows a semicolon."""
_RAISED = re.compile(r".*?: (?:tick|setup) raised \w+")
_SETTINGS = ("timeouts", "attempts", "memory", "constants")
"""Settings of a node that are no values of the robot's."""
_WHERE = ("node", "domain", "simulation")
"""The place of a run, but for the name of the computer."""


def bare(event: Event) -> Event | None:
    """Return an event without its values, or None where nothing would be left of it."""
    strip = _STRIPPED.get(type(event))
    return event if strip is None else strip(event)


def said(text: str) -> str:
    """Return a text up to its first value.

    Every word of a server or a user's node counts as value.
    """
    return _VALUE.split(text, 1)[0].rstrip(" ;,:")


def outcome_of(message: str) -> str:
    """Return the outcome of an action, or `left out`, that begins a node's message, or ""."""
    if message.partition(": ")[0] == LEFT_OUT:
        return LEFT_OUT
    head = re.split(r"[ :]", message, maxsplit=1)[0]
    return head if head in _OUTCOMES else ""


def reason_of(outcome: Outcome | None, reason: str) -> str:
    """Return the part without values of a goal's reason for this outcome."""
    return "" if outcome in _OF_THE_LEAF else said(reason)


def bare_node(node: Node) -> Node:
    """Return a node without folders, and with those policies alone that are no values."""
    kept = {name: each for name, each in node.settings.items() if name in _SETTINGS}
    return replace(node, settings=kept, place=node.place.rpartition("/")[2])


def _hidden(values: Any) -> dict[str, Any]:
    return dict.fromkeys(values, HIDDEN)


def _goal(event: GoalChanged) -> GoalChanged:
    return replace(event, goal=None, result=None, reason=reason_of(event.outcome, event.reason))


def _finished(event: TreeFinished) -> TreeFinished:
    left = tuple(replace(each, fields="", reason=said(each.reason)) for each in event.unaccounted)
    return replace(
        event, outputs=_hidden(event.outputs), error=_raised(event.error), unaccounted=left
    )


def _raised(text: str) -> str:
    """Return the type of an error alone."""
    found = _RAISED.match(text)
    return found[0] if found else said(text)


_STRIPPED: dict[type[Event], Callable[[Any], Event | None]] = {
    RunBegan: lambda event: replace(
        event,
        nodes=tuple(map(bare_node, event.nodes)),
        inputs=_hidden(event.inputs),
        sources={},
        where={name: each for name, each in event.where.items() if name in _WHERE},
    ),
    NodesAdded: lambda event: replace(event, nodes=tuple(map(bare_node, event.nodes))),
    NodeChanged: lambda event: replace(event, message=outcome_of(event.message), warning=""),
    GoalChanged: _goal,
    AttemptEnded: lambda event: replace(
        event, reason=reason_of(event.outcome, event.reason), seen={}
    ),
    FeedbackCame: lambda event: None,
    VariableWritten: lambda event: None,
    RoundBegan: lambda event: replace(event, item=None),
    Logged: lambda event: None,
    TreeFinished: _finished,
    RunEnded: lambda event: replace(
        event,
        world="",
        complaint=HIDDEN if event.complaint else "",
        error=said(event.error),
        unaccounted=tuple(map(said, event.unaccounted)),
    ),
}
