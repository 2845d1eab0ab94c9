"""The connections of leaves on a node: subscriptions and publishers of topics, clients of services.

A callback for a message or an answer only takes note; nothing of the tree runs there. This file
decides nothing: neither how long to wait nor whether to ask again.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
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

from bt_actions.messages.interfaces import TwoTypes, interface_name
from bt_actions.ros.in_sight import mismatch, unmatched_service
from bt_actions.ros.workarounds.closable import closable
from bt_actions.traffic.backend import ARRIVES, Call
from bt_actions.traffic.state import waker
from bt_actions.utilities.suggest import elsewhere, listing

DISCOVERS = 3.5
"""Seconds that a new participant takes, at most, to discover who was there before it.

Fast DDS as it comes announces a participant every 3 s, and answers the first announcement of a new
one at once; that answer is lost in about half of all cases, as it may come before the new one
listens. Up to 2.8 s were measured.
"""


def qos_profile(name: str) -> QoSProfile:
    """Return the quality of service that a tree calls by this name. Raises KeyError."""
    return {
        "default": QoSProfile(depth=10),
        "sensor": qos_profile_sensor_data,
        "latched": QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        "best_effort": QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),
        "services": qos_profile_services_default,
        "events": QoSProfile(depth=100),
        "rosout": QoSProfile(  # the profile of rclpy's loggers
            depth=1000,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
            lifespan=Duration(seconds=10),
        ),
    }[name]


@contextlib.contextmanager
def _one_type(node: Node, kind: type, name: str) -> Iterator[None]:
    """Turn rclpy's error for a name with another type into the tree's words."""
    try:
        yield
    except RuntimeError as error:  # RCLError, which is public nowhere
        full = node.resolve_topic_name(name)
        known = [*node.get_topic_names_and_types(), *node.get_service_names_and_types()]
        others = {each for found, kinds in known if found == full for each in kinds}
        if others - {interface_name(kind)}:
            raise TwoTypes(full, kind, others) from error
        raise


class _Topic:
    """The common part of subscriptions and publishers."""

    listens: bool

    def __init__(self, node: Node, seen_since: float, message_type: type, qos: str) -> None:
        self._node = node
        self._discovered_at = seen_since + DISCOVERS
        self._type = message_type
        self._qos = qos_profile(qos)
        self.name = ""
        """The topic's full name."""

    def may_come(self) -> float:
        """Return the seconds in which earlier participants may still be undiscovered."""
        return max(0.0, self._discovered_at - time.monotonic())

    def why_nobody(self) -> str:
        """Return the graph's reason why nobody publishes, or listens; or ""."""
        node, kind, listens = self._node, interface_name(self._type), self.listens
        with contextlib.suppress(Exception):  # our node was destroyed
            look = "publishers" if listens else "subscriptions"
            others = getattr(node, f"get_{look}_info_by_topic")(self.name)
            why = mismatch(kind, self._qos, others, publish=listens)
            known = {} if others else dict(node.get_topic_names_and_types())
            return (f": {why}" if why else "") + elsewhere(self.name, kind, known)
        return ""


class RosSubscription(_Topic):
    """A leaf's Subscription (traffic/backend.py)."""

    listens = True

    def __init__(
        self,
        node: Node,
        seen_since: float,
        message_type: type,
        topic: str,
        qos: str,
        take: Callable[[Any], None],
    ) -> None:
        super().__init__(node, seen_since, message_type, qos)
        self._made_at = time.monotonic()
        group = MutuallyExclusiveCallbackGroup()
        with _one_type(node, message_type, topic):
            made = node.create_subscription(
                message_type, topic, take, self._qos, callback_group=group
            )
        self._subscription = closable(made)
        self.name = self._subscription.topic_name

    def may_come(self) -> float:
        """Return the seconds in which a first message may be on its way; 0 afterwards.

        Its publisher may still be undiscovered, or has only just been discovered.
        """
        matched = self._subscription.get_publisher_count() > 0
        arrives = self._made_at + ARRIVES - time.monotonic() if matched else 0.0
        return max(super().may_come(), arrives)

    def close(self) -> None:
        self._node.destroy_subscription(self._subscription)


class RosPublisher(_Topic):
    """A leaf's Publisher (traffic/backend.py)."""

    listens = False

    def __init__(
        self, node: Node, seen_since: float, message_type: type, topic: str, qos: str
    ) -> None:
        super().__init__(node, seen_since, message_type, qos)
        with _one_type(node, message_type, topic):
            made = node.create_publisher(message_type, topic, self._qos)
        self._publisher = closable(made)
        self._has_all_by = 0.0
        self.name = self._publisher.topic_name

    @property
    def listeners(self) -> int:
        return int(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        self._publisher.publish(message)
        self._has_all_by = time.monotonic() + ARRIVES

    def close(self) -> None:
        """Destroy the publisher once all listeners have its messages, a second later at most.

        rclpy's own wait holds up all threads of Python.
        """
        with contextlib.suppress(Exception):  # the context may have been shut down before
            while time.monotonic() < self._has_all_by:
                if self._publisher.wait_for_all_acked(Duration()):
                    break
                time.sleep(0.005)
        self._node.destroy_publisher(self._publisher)


class RosService:
    """A leaf's Service (traffic/backend.py): a client of one."""

    def __init__(self, node: Node, service_type: type, name: str) -> None:
        self._node = node
        self._type = service_type
        group = MutuallyExclusiveCallbackGroup()
        with _one_type(node, service_type, name):
            self._client = node.create_client(service_type, name, callback_group=group)
        self.name: str = self._client.service_name
        """The service's full name."""

    @property
    def ready(self) -> bool:
        return bool(self._client.service_is_ready())

    def why_nobody(self) -> str:
        node, kind, known = self._node, interface_name(self._type), dict[str, list[str]]()
        with contextlib.suppress(Exception):  # our node was destroyed
            for name, kinds in node.get_service_names_and_types():
                if node.count_services(name):  # and not only clients, as ours
                    known[name] = kinds
            if self.name not in known:
                return f": nobody offers it{elsewhere(self.name, kind, known)}"
            if others := sorted(set(known[self.name]) - {kind}):
                return f": what is there is {listing(others)}, not {kind}"
            why = unmatched_service(node, self.name)
            return f": it is in sight, but {f'it {why}' if why else 'was not ready'}"
        return ""

    def call(self, request: Any) -> Call:
        future: Any = self._client.call_async(request)
        wake = waker()
        future.add_done_callback(lambda _: wake())
        return future  # type: ignore[no-any-return]

    def close(self) -> None:
        self._node.destroy_client(self._client)
