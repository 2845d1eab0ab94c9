"""The node that a tree is set up with, for leaves that cannot do without one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from py_trees.behaviour import Behaviour

__all__ = ["node_in"]


def node_in(arguments: Mapping[str, Any], leaf: Behaviour) -> Any:
    """Return the node among the arguments of `leaf.setup`. Raises TypeError without one."""
    node = arguments.get("node")
    if node is None:
        raise TypeError(f"{leaf.name}: setup needs a ROS node: tree.setup(node=node)")
    return node
