"""The simulated robots of a tree: the namespaces of its own MoveRobot and Gripper leaves.

Reads a tree before its setup; starts nothing and imports no ROS.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bt_actions.messages.interfaces import interface_name

if TYPE_CHECKING:
    from py_trees.behaviour import Behaviour

SERVED = {"MoveRobot": "move_robot", "Gripper": "gripper_control"}
"""The servers of a simulated robot: names by types."""
_PACKAGE = "robot_control_interfaces"


@dataclass(frozen=True, slots=True)
class Wanted:
    """A tree's needs of a simulation."""

    namespaces: Sequence[str]
    """The namespaces of the robots; "/" is the root. Never empty."""
    others: Sequence[str]
    """The servers that no simulated robot has, as `name (type)`: of actions and of services."""
    services: Sequence[str] = ()
    """The servers of services among these."""
    topics: Sequence[str] = ()
    """The topics that the tree reads."""


def wanted(root: Behaviour, namespace: str = "") -> Wanted:
    """Return the needs of `root` on a node in `namespace` ("" or with a slash)."""
    from bt_actions.behaviours.places import in_order
    from bt_actions.behaviours.topics import READ, WaitForMessage

    def expanded(name: str) -> str:
        return name if name.startswith("/") else f"{namespace}/{name}"

    namespaces: dict[str, None] = {}
    topics: dict[str, None] = {}
    others: dict[str, str] = {}
    for node in in_order(root):
        heard = (node.topic_name,) if isinstance(node, WaitForMessage) else ()
        topics |= dict.fromkeys(map(expanded, (*heard, *getattr(node, READ, ()))))
        for sort in ("action", "service"):
            name, kind = getattr(node, f"{sort}_name", None), getattr(node, f"{sort}_type", None)
            if not isinstance(name, str) or kind is None:
                continue
            full = expanded(name)
            above, _, last = full.rpartition("/")
            package, *_, word = (kind if isinstance(kind, str) else interface_name(kind)).split("/")
            if package == _PACKAGE and SERVED.get(word) == last:
                namespaces[above or "/"] = None
            else:
                others[f"{full} ({word})"] = sort
    services = tuple(each for each, sort in others.items() if sort == "service")
    robots = tuple(namespaces) or (namespace or "/",)
    return Wanted(robots, tuple(others), services, tuple(topics))


def remark(found: Wanted, *, recorded: bool = False) -> str:
    """Say in one line which servers must come from elsewhere; "" for none.

    `recorded`: the actions are served as in a recorded run, which has no messages of topics.
    """
    if recorded:
        said = []
        if found.services:
            said.append(f"it has no server for {', '.join(found.services)}")
        if found.topics:
            topics = ", ".join(found.topics)
            said.append(f"it plays no recorded messages on {topics} (a robot's battery is full)")
        return f"--sim-like serves actions; {', and '.join(said)}" if said else ""
    if not found.others:
        return ""
    names = " and ".join(SERVED.values())
    return f"--sim serves only {names}; it has no server for {', '.join(found.others)}"
