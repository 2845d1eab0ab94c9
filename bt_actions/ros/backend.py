"""The Backend of traffic/backend.py over rclpy: what one node gives to leaves and runs.

Only puts together what the rest of ros/ has.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.node import Node

from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.ros.node_participant import NodeParticipant
from bt_actions.ros.service_client import ServiceClient
from bt_actions.ros.topics import Publisher, Subscription
from bt_actions.traffic.handle import GoalHandle

__all__ = ["RosBackend"]

RANDOMNESS = random.Random()
_ON_NODE = "_bt_actions_backend"


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
            backend: RosBackend | None = getattr(node, _ON_NODE, None)
            if backend is None or backend.traffic is not participant.traffic:
                backend = cls(participant)
                setattr(node, _ON_NODE, backend)
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

    def drain(
        self, handles: Iterable[GoalHandle], hurry: Callable[[], bool] = lambda: False
    ) -> list[GoalHandle]:
        """Cancel these goals and wait for their ends; it does not matter whether anybody spins."""
        return self.traffic.drain(handles, hurry)

    def wake(self) -> None:
        """Have whoever runs a tree on this node tick it soon; callable from any thread."""
        with host.lock:
            self.traffic.notify(None)

    def log(self, level: str, text: str) -> None:
        """Write a line to the node's log."""
        log.by(self.node.get_logger(), level, text)
