"""Topics for trees: latest values that leaves read, what leaves publish, and qualities of service.

Callbacks only store a message and wake whoever ticks; nothing of the tree runs in them.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_sensor_data,
    qos_profile_services_default,
)

from bt_actions.messages.interfaces import interface_name
from bt_actions.ros.closable import closable
from bt_actions.ros.in_sight import without_topic
from bt_actions.traffic.shared import lock
from bt_actions.traffic.traffic import Traffic

__all__ = ["Latest", "Speaker", "qos_profile", "wake"]

KEPT = 100
"""Messages kept for who waits for one of them; older ones are dropped."""
DISCOVERS = 3.5
"""Seconds that a new participant takes, at most, to discover who was there before it.

Fast DDS as it comes announces a participant every 3 s, and answers the first announcement of a new
one at once; that answer is lost in about half of all cases, as it may come before the new one
listens. Up to 2.8 s were measured.
"""
ARRIVES = 1.0
"""Seconds that a message is given to arrive: a latched one, once its publisher is in sight, and
what we have published, before the process ends."""


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


def discovers(node: Node) -> float:
    """Seconds for which a node may not be shown yet who was there before it; 0 afterwards."""
    return max(0.0, Traffic.of(node).seen_since + DISCOVERS - time.monotonic())


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
        self._type = message_type
        self._qos = qos_profile(qos)
        self._made_at = time.monotonic()
        self.came = 0
        """How many messages have come."""
        self._subscription = closable(
            node.create_subscription(
                message_type,
                topic,
                self._take,
                self._qos,
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

    def first_may_come(self) -> float:
        """Seconds for which a message may be on its way though none has come; 0 afterwards.

        Its publisher may not be discovered yet, or has only just been.
        """
        if self.came:
            return 0.0
        matched = self._subscription.get_publisher_count() > 0
        arrives = self._made_at + ARRIVES - time.monotonic() if matched else 0.0
        return max(discovers(self._node), arrives)

    def why_silent(self) -> str:
        """What the graph shows that explains why nothing has come, behind a colon; or ""."""
        kind = interface_name(self._type)
        return without_topic(self._node, self.topic, kind, self._qos, publish=True)

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
            self.came += 1
            if self._kept is not None:
                self._kept.append(message)
        wake(self._node)


class Speaker:
    """The publisher of a leaf."""

    def __init__(self, node: Node, message_type: type, topic: str, qos: str) -> None:
        self._node = node
        self._type = message_type
        self._qos = qos_profile(qos)
        self._publisher = closable(node.create_publisher(message_type, topic, self._qos))
        self._has_all_by = 0.0
        self.topic: str = self._publisher.topic_name
        """The topic's full name."""

    @property
    def listeners(self) -> int:
        """How many subscriptions get what is published."""
        return int(self._publisher.get_subscription_count())

    def listener_may_come(self) -> float:
        """Seconds for which one that is there may not be discovered yet; 0 afterwards."""
        return discovers(self._node)

    def why_unheard(self) -> str:
        """What the graph shows that explains why nobody listens, behind a colon; or ""."""
        kind = interface_name(self._type)
        return without_topic(self._node, self.topic, kind, self._qos, publish=False)

    def publish(self, message: Any) -> None:
        """Publish; returns at once."""
        self._publisher.publish(message)
        self._has_all_by = time.monotonic() + ARRIVES

    def close(self) -> None:
        """Destroy the publisher, once its listeners have all, or a second after the last message.

        rclpy's own wait holds up all threads of Python.
        """
        with contextlib.suppress(Exception):  # the context may have been shut down before
            while time.monotonic() < self._has_all_by:
                if self._publisher.wait_for_all_acked(Duration()):
                    break
                time.sleep(0.005)
        self._node.destroy_publisher(self._publisher)
