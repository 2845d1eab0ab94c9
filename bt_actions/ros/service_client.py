"""A service client that wakes who has called when the answer is there.

Decides nothing, and never blocks.
"""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from bt_actions.messages.interfaces import interface_name
from bt_actions.ros.in_sight import without_service
from bt_actions.traffic.backend import Call
from bt_actions.traffic.begun import waker


class ServiceClient:
    """A client of one service on a node; the Service of traffic/backend.py."""

    def __init__(self, node: Node, service_type: type, name: str) -> None:
        self._node = node
        self._type = service_type
        self._client = node.create_client(
            service_type, name, callback_group=MutuallyExclusiveCallbackGroup()
        )

    @property
    def name(self) -> str:
        """The service's full name."""
        return str(self._client.service_name)

    def why_absent(self) -> str:
        """What the graph shows in place of the service, behind a colon."""
        return without_service(self._node, self.name, interface_name(self._type))

    @property
    def ready(self) -> bool:
        """Whether the service is there."""
        return bool(self._client.service_is_ready())

    def call(self, request: Any) -> Call:
        """Begin a call, which wakes who has called when it is done."""
        future: Call = self._client.call_async(request)
        wake = waker()
        future.add_done_callback(lambda _: wake())  # type: ignore[attr-defined]
        return future

    def close(self) -> None:
        """Destroy the client."""
        self._node.destroy_client(self._client)
