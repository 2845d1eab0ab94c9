"""Topics for trees: latest values that leaves read, and qualities of service by name.

Callbacks only store a message and wake whoever ticks; nothing of the tree runs in them.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
    qos_profile_services_default,
)

from bt_actions.ros.closable import closable
from bt_actions.ros.shared import lock
from bt_actions.ros.traffic import Traffic

__all__ = ["Latest", "qos_profile", "wake"]

KEPT = 100
"""Messages kept for who waits for one of them; older ones are dropped."""


def qos_profile(name: str) -> QoSProfile:
    """The quality of service that a tree calls by this name. Raises KeyError."""
    return {
        "default": QoSProfile(depth=10),
        "sensor": qos_profile_sensor_data,
        "latched": QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        ),
        "best_effort": QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),
        "services": qos_profile_services_default,
    }[name]


def wake(node: Node) -> None:
    """Have whoever runs a tree on this node tick it soon; callable from any thread."""
    traffic = Traffic.of(node)
    with lock:
        traffic.notify(None)


class Latest:
    """The latest message of a topic, and how old it is on the node's clock.

    A clock that jumps back makes no message younger, and none older.
    """

    def __init__(self, node: Node, message_type: type, topic: str, qos: str) -> None:
        self._node = node
        self._clocks = Traffic.of(node).clocks
        self._lock = threading.Lock()
        self._message: Any = None
        self._age = 0.0
        self._aged_at = 0.0
        self._kept: deque[Any] | None = None
        self._subscription = closable(
            node.create_subscription(
                message_type,
                topic,
                self._take,
                qos_profile(qos),
                callback_group=MutuallyExclusiveCallbackGroup(),
            )
        )
        self.topic: str = self._subscription.topic_name
        """The topic's full name."""

    def get(self) -> tuple[Any, float]:
        """The message (None before the first), and its age in seconds."""
        now = self._clocks.now().ros
        with self._lock:
            self._age += max(0.0, now - self._aged_at)
            self._aged_at = now
            return self._message, self._age

    def keep(self, *, with_latest: bool = False) -> None:
        """From now on keep each message for `take`, the newest hundred."""
        with self._lock:
            self._kept = deque(maxlen=KEPT)
            if with_latest and self._message is not None:
                self._kept.append(self._message)

    def take(self) -> list[Any]:
        """What came since `keep`, or the last `take`, in its order."""
        with self._lock:
            taken = list(self._kept or ())
            if self._kept is not None:
                self._kept.clear()
            return taken

    def keep_no_more(self) -> None:
        """Nobody waits any longer."""
        with self._lock:
            self._kept = None

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)

    def _take(self, message: Any) -> None:
        now = self._clocks.now().ros
        with self._lock:
            self._message = message
            self._age, self._aged_at = 0.0, now
            if self._kept is not None:
                self._kept.append(message)
        wake(self._node)
