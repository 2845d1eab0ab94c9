"""A service client that calls once at a time and wakes who has called when the answer is there.

Decides nothing: neither how long to wait nor whether to call again. Never blocks.
"""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from bt_actions.messages.interfaces import interface_name
from bt_actions.ros.in_sight import without_service
from bt_actions.traffic.begun import waker


class ServiceClient:
    """A client of one service on a node; the Service of traffic/backend.py."""

    def __init__(self, node: Node, service_type: type, name: str) -> None:
        self._node = node
        self._type = service_type
        self._future: Any = None
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

    @property
    def calling(self) -> bool:
        """Whether a call was begun and not dropped since."""
        return self._future is not None

    @property
    def answered(self) -> bool:
        """Whether the call was answered."""
        return self._future is not None and bool(self._future.done())

    def call(self, request: Any) -> None:
        """Begin a call; what is still under way is dropped."""
        self.drop()
        self._future = self._client.call_async(request)
        wake = waker()
        self._future.add_done_callback(lambda _: wake())

    def answer(self) -> Any:
        """Return the answer of a call that was answered; the call is over."""
        future, self._future = self._future, None
        return future.result()

    def drop(self) -> None:
        """Take no interest in an answer any more."""
        if self._future is not None and not self._future.done():
            self._client.remove_pending_request(self._future)
        self._future = None

    def close(self) -> None:
        """Drop the call and destroy the client."""
        self.drop()
        self._node.destroy_client(self._client)
