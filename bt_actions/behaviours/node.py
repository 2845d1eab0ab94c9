"""What a tree is set up with, for leaves that cannot do without."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from py_trees.behaviour import Behaviour

from bt_actions.traffic.backend import Backend
from bt_actions.wiring import backend_of

__all__ = ["backend_in"]


def backend_in(arguments: Mapping[str, Any], leaf: Behaviour) -> Backend:
    """Return what the node among the arguments of `leaf.setup` gives. Raises TypeError without."""
    node = arguments.get("node")
    if node is None:
        raise TypeError(f"{leaf.name}: setup needs a ROS node: tree.setup(node=node)")
    return backend_of(node)
