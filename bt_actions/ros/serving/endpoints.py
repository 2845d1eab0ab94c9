"""The services, publishers and timers of one server on its node; all of them go at once.

Their callbacks run beside each other, on the executor's threads. None may wait: `off` has done
elsewhere what takes its time. Must not spin the node, nor destroy it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bt_actions.ros.serving.off_executor import OffTheExecutor


def kept(depth: int) -> QoSProfile:
    """The quality of service of a topic whose last messages also come to who comes late."""
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Endpoints:
    """Makes them, and takes them away."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.group = ReentrantCallbackGroup()
        self.off = OffTheExecutor(node)
        self._destroy: list[Callable[[], object]] = []

    def service(self, kind: type, name: str, callback: Callable[..., Any]) -> None:
        """Offer a service; the callback may be a coroutine."""
        service = self.node.create_service(kind, name, callback, callback_group=self.group)
        self._destroy.append(lambda: self.node.destroy_service(service))

    def publisher(self, kind: type, topic: str, qos: QoSProfile | int) -> Any:
        """Return a publisher."""
        publisher = self.node.create_publisher(kind, topic, qos)
        self._destroy.append(lambda: self.node.destroy_publisher(publisher))
        return publisher

    def timer(self, period: float, callback: Callable[[], None], *, autostart: bool = True) -> Any:
        """Return a timer on the steady clock."""
        timer = self.node.create_timer(
            period,
            callback,
            callback_group=self.group,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
            autostart=autostart,
        )
        self._destroy.append(lambda: self.node.destroy_timer(timer))
        return timer

    def full_name(self, name: str) -> str:
        """Return the full name of what the node calls by this name."""
        return str(expand_topic_name(name, self.node.get_name(), self.node.get_namespace()))

    def close(self) -> None:
        """Destroy them all, the latest first."""
        while self._destroy:
            self._destroy.pop()()
