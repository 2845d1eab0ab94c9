"""The Backend of traffic/backend.py over rclpy: what one node gives to leaves and runs.

Only puts together what the rest of ros/ has.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.ros.node_participant import NodeParticipant
from bt_actions.ros.service_client import ServiceClient
from bt_actions.ros.topics import Publisher, Subscription

__all__ = ["RosBackend"]

RANDOMNESS = random.Random()


class RosBackend:
    """What leaves and runs do by one node."""

    def __init__(self, participant: NodeParticipant) -> None:
        self.node = participant.node
        self.traffic = participant.traffic
        self.clock = participant.clocks
        self._seen_since = participant.seen_since
        self.randomness = RANDOMNESS

    @classmethod
    def of(cls, node: Node) -> RosBackend:
        """Return the one of `node`, or a new one where its traffic was destroyed."""
        participant = NodeParticipant.of(node)
        with host.lock:
            if participant.backend is None:
                participant.backend = cls(participant)
            backend: RosBackend = participant.backend
            return backend

    def service(self, service_type: type, name: str) -> ServiceClient:
        """Become a client of a service."""
        return ServiceClient(self.node, service_type, name, self.wake)

    def subscription(
        self, message_type: type, topic: str, qos: str, take: Callable[[Any], None]
    ) -> Subscription:
        """Listen to a topic."""
        return Subscription(self.node, self._seen_since, message_type, topic, qos, take)

    def publisher(self, message_type: type, topic: str, qos: str) -> Publisher:
        """Become a publisher on a topic."""
        return Publisher(self.node, self._seen_since, message_type, topic, qos)

    def wake(self) -> None:
        """Have whoever runs a tree on this node tick it soon; callable from any thread."""
        with host.lock:
            self.traffic.notify(None)

    def log(self, level: str, text: str) -> None:
        """Write a line to the node's log."""
        log.by(self.node.get_logger(), level, text)
