"""The server of trees, which other nodes run by their names: `TreeServer`. Imports ROS."""

from bt_actions.serving.server import TreeServer
from bt_actions.serving.turns import Policy

__all__ = ["Policy", "TreeServer"]
