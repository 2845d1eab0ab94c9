"""The platform of simulated servers on an rclpy node: timers, topics and action servers.

The platform neither spins nor owns the node. All servers of a node belong to one callback group: a
second thread would only wait for their lock.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node

from bt_actions.ros.workarounds.closable import closable
from bt_actions.simulation.platform import RequestHandler, SimulationLog
from bt_actions.simulation.ros.wire import InterceptedActionServer

SHORTEST_WAIT = 0.0001
"""Seconds of any wait of a timer, at least."""


class NodePlatform:
    """The platform of one rclpy node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._group = MutuallyExclusiveCallbackGroup()

    @property
    def log(self) -> SimulationLog:
        logger: SimulationLog = self._node.get_logger()
        return logger

    def now(self) -> float:
        return time.monotonic()

    def timer(self, ring: Callable[[], None]) -> NodeTimer:
        return NodeTimer(self._node, self._group, ring)

    def expand(self, name: str) -> str:
        return str(expand_topic_name(name, self._node.get_name(), self._node.get_namespace()))

    def serve(
        self, action_type: Any, name: str, server: RequestHandler, result_timeout: float
    ) -> InterceptedActionServer:
        return InterceptedActionServer(
            self._node,
            action_type,
            name,
            server,
            callback_group=self._group,
            result_timeout=result_timeout,
        )

    def publisher(self, message_type: Any, topic: str) -> NodePublisher:
        return NodePublisher(self._node, message_type, topic)


class NodeTimer:
    """One timer, armed anew for each ring."""

    def __init__(self, node: Node, group: Any, ring: Callable[[], None]) -> None:
        self._node = node
        self._ring = ring
        self.rclpy_timer = node.create_timer(
            1.0,
            self._rings,
            callback_group=group,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
            autostart=False,
        )

    def set(self, when: float | None) -> None:
        if when is None:
            self.rclpy_timer.cancel()
            return
        wait = max(when - time.monotonic(), SHORTEST_WAIT)
        self.rclpy_timer.timer_period_ns = int(wait * 1e9)
        self.rclpy_timer.reset()

    def destroy(self) -> None:
        """Destroy the timer. Safe while the executor spins and after it has stopped."""
        with contextlib.suppress(InvalidHandle):  # the node was destroyed before
            self.rclpy_timer.cancel()
            self._node.destroy_timer(self.rclpy_timer)

    def _rings(self) -> None:
        self.rclpy_timer.cancel()
        self._ring()


class NodePublisher:
    """A publisher that may be destroyed while its node is spun."""

    def __init__(self, node: Node, message_type: Any, topic: str) -> None:
        self._node = node
        self._publisher = closable(node.create_publisher(message_type, topic, 10))

    def publish(self, message: Any) -> None:
        if hasattr(message, "header"):
            message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def destroy(self) -> None:
        """Destroy the publisher. Safe while the executor spins and after it has stopped."""
        with contextlib.suppress(InvalidHandle):  # the node was destroyed before
            self._node.destroy_publisher(self._publisher)
