"""Trees for other nodes to run by their names: `TreeServer`. Imports ROS."""

from bt_actions.serving.server import TreeServer
from bt_actions.serving.turns import Policy

__all__ = ["Policy", "TreeServer"]
