"""A node of a tree as a value, for readers without the tree. No ROS."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from py_trees.behaviour import Behaviour

from bt_actions import document
from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.kinds import action_of, kind
from bt_actions.behaviours.places import in_order
from bt_actions.events.kinds import Node
from bt_actions.events.snapshot import Value
from bt_actions.messages.fields import constants

_PHASES = ("queue", "server", "accept", "result", "feedback", "cancel")


def nodes_of(root: Behaviour) -> tuple[Node, ...]:
    """Return a value for each node of a tree, as the first event of a run has them."""
    numbers = {node: number for number, node in enumerate(in_order(root), 1)}
    return tuple(
        describe(node, number, numbers[node.parent] if node is not root and node.parent else None)
        for node, number in numbers.items()
    )


def describe(node: Behaviour, number: int, parent: int | None, index: int | None = None) -> Node:
    """Return the value of a node with this number and this index among its siblings."""
    server, action = action_of(node) or ("", "")
    return Node(
        number,
        parent,
        node.name,
        kind(node),
        str(document.place_of(node) or ""),
        server,
        action,
        _settings(node),
        index,
    )


def _settings(node: Behaviour) -> dict[str, Value]:
    memory = getattr(node, "memory", None)
    settings: dict[str, Value] = {} if not isinstance(memory, bool) else {"memory": memory}
    settings |= getattr(node, "gates", {})
    if isinstance(node, ActionBehaviour):
        settings["timeouts"] = {phase: getattr(node.timeouts, phase) for phase in _PHASES}
        settings["attempts"] = node.retry.attempts
        if node.expected:
            settings["expect"] = node.expected
        if isinstance(node.action_type, type) and (named := _constants(node.action_type)):
            settings["constants"] = named
    return settings


@lru_cache(maxsize=256)
def _constants(action: Any) -> dict[str, Value]:
    """Return the constants of goal, result and feedback, by field and number."""
    found: dict[str, Value] = {}
    parts = {"goal": action.Goal, "result": action.Result, "feedback": action.Feedback}
    for name, message in parts.items():
        fields: dict[str, Value] = {}
        for field in message.get_fields_and_field_types():
            start = f"{field.upper()}_"
            named: dict[str, Value] = {
                str(number): constant.removeprefix(start)
                for constant, number in reversed(list(constants(message).items()))
                if constant.startswith(start)
            }
            if named:
                fields[field] = named
        if fields:
            found[name] = fields
    return found
