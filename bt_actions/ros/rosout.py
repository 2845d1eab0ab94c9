"""Lines about runs on `/rosout`, in the name of their node; those of served runs are also logged.

rclpy's own loggers would print all lines, and hold up the process without a reader (log.py).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Literal

from rcl_interfaces.msg import Log
from rclpy.node import Node

from bt_actions.ros.log import log
from bt_actions.ros.node_participant import NodeParticipant
from bt_actions.traffic.backend import LEVELS
from bt_actions.utilities.plain_text import clean_lines

Level = Literal["info", "warn", "error"]
Tell = Callable[[Level, str], None]
"""Says a line; an error needs attention."""


class Rosout:
    """A publisher on `/rosout` for one node, on any thread; to be closed before its node goes."""

    def __init__(self, node: Node) -> None:
        self._node, self._name = node, node.get_fully_qualified_name()
        publisher = NodeParticipant.of(node).publisher(Log, "/rosout", "rosout")
        self._publish, self.close = publisher.publish, publisher.close

    def say(self, level: Level, text: str) -> None:
        """Publish a text, and never raise; an error needs attention."""
        with contextlib.suppress(Exception):  # its node is gone, say: the log has it as well
            stamp, name = self._node.get_clock().now().to_msg(), self._node.get_logger().name
            self._publish(Log(stamp=stamp, level=LEVELS[level], name=name, msg=clean_lines(text)))

    def tell(self, level: Level, text: str) -> None:
        """Publish a text, and write each line of it to the log with the node's full name."""
        put = {"info": log.info, "warn": log.warning, "error": log.error}[level]
        for line in text.splitlines():
            put(f"{self._name}: {line}")
        self.say(level, text)
