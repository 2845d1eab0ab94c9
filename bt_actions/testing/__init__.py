"""Virtual time: a network on which servers stand and clients speak, without ROS."""

from bt_actions.testing.network import VirtualNetwork

__all__ = ["VirtualNetwork"]
