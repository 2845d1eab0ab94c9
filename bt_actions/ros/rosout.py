"""What is said of runs on `/rosout`, in the name of their node; nothing of it is printed.

rclpy's own loggers would print it as well, and hold up the process where nobody reads (log.py).
"""

from __future__ import annotations

import contextlib
from typing import Literal

from rcl_interfaces.msg import Log
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bt_actions.traffic.backend import LEVELS
from bt_actions.utilities.plain_text import clean_lines

LINGER = 0.5
"""Seconds, at most, for the last line to be acknowledged by those who listen."""


class Rosout:
    """Publishes on `/rosout` for one node, on any thread; never raises."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._name = node.get_logger().name
        self._publisher = node.create_publisher(
            Log,
            "/rosout",
            QoSProfile(  # rosout's own
                depth=1000,
                durability=DurabilityPolicy.TRANSIENT_LOCAL,
                lifespan=Duration(seconds=10),
            ),
        )

    def say(self, level: Literal["info", "error"], text: str) -> None:
        """Say something; an error needs attention."""
        with contextlib.suppress(Exception):  # its node is gone, say: the log has it as well
            stamp = self._node.get_clock().now().to_msg()
            said = Log(stamp=stamp, level=LEVELS[level], name=self._name, msg=clean_lines(text))
            self._publisher.publish(said)

    def close(self) -> None:
        """Be gone, before the node is, and when those in sight have what was said; not for long."""
        with contextlib.suppress(Exception):
            self._publisher.wait_for_all_acked(Duration(seconds=LINGER))
        with contextlib.suppress(Exception):
            self._node.destroy_publisher(self._publisher)
