"""The parties on the virtual network, and the way of messages between them.

Each message arrives `LATENCY` later, in order. The medium knows neither content nor sender.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, Protocol

from bt_actions.testing.timeline import Timeline

LATENCY = 0.001
"""Seconds that a message takes."""


@dataclass(frozen=True, slots=True, eq=False)
class VirtualRequest:
    """A request to an action server; `reply` sends the answer back."""

    kind: Literal["goal", "cancel", "result"]
    goal_id: str
    goal: Any
    reply: Callable[[Any], None]


class Party(Protocol):
    """A party in an action."""

    @property
    def name(self) -> str:
        """The action's full name;"""

    @property
    def action_type(self) -> Any:
        """and its type: a party with another type is not there for this one."""


class Served(Party, Protocol):
    """An action server."""

    @property
    def gid(self) -> bytes:
        """The id that tells it from all others."""

    @property
    def statuses(self) -> dict[bytes, int]:
        """The status of each of its goals."""

    def receive(self, request: VirtualRequest) -> None:
        """Take a request."""


class Client(Party, Protocol):
    """The sender of requests, which hears what servers publish."""

    def hear_feedback(self, goal_id: bytes, feedback: Any) -> None:
        """Take feedback."""

    def hear_status(self, statuses: dict[bytes, int]) -> None:
        """Take a status message."""


class Medium:
    """The parties that are there, and the arrivals of messages on `timeline`."""

    def __init__(self, timeline: Timeline) -> None:
        self.timeline = timeline
        self._gids = 0
        self._arrived_at = 0.0
        self._servers: list[Served] = []
        self._clients: list[Client] = []

    def soon(self, work: Callable[..., object], *arguments: Any) -> None:
        """Have `work` called when a message sent now arrives."""
        self._arrived_at = self.timeline.now + LATENCY
        self.timeline.call_at(self._arrived_at, partial(work, *arguments))

    def arrive(self) -> None:
        """Let time pass until all messages sent by now have arrived, but not their answers."""
        until = self._arrived_at
        while self.timeline.advance(until):
            pass

    def new_gid(self) -> bytes:
        """Return an id that no other server has."""
        self._gids += 1
        return self._gids.to_bytes(16, "big")

    @property
    def actions(self) -> dict[str, Any]:
        """The types of the actions that are served, by name."""
        return {server.name: server.action_type for server in self._servers}

    def add_server(self, server: Served) -> None:
        """Show a server from now on."""
        self._servers.append(server)

    def remove_server(self, server: Served) -> None:
        """Show the server no more."""
        if server in self._servers:
            self._servers.remove(server)

    def servers_of(self, client: Client) -> list[Served]:
        """Return the servers of a client's action, the oldest first."""
        return [server for server in self._servers if _match(server, client)]

    def add_client(self, client: Client) -> None:
        """Have the client hear what servers publish, and the present statuses of their goals."""
        self._clients.append(client)
        for server in self.servers_of(client):
            if server.statuses:
                self.soon(client.hear_status, server.statuses)

    def remove_client(self, client: Client) -> None:
        """Have the client hear nothing any more."""
        self._clients.remove(client)

    def publish_feedback(self, server: Served, goal_id: bytes, message: Any) -> None:
        """Bring feedback to all clients of the action."""
        for client in self._clients:
            if _match(server, client):
                self.soon(client.hear_feedback, goal_id, message)

    def publish_status(self, server: Served) -> None:
        """Bring the status of a server's goals to all clients of the action."""
        statuses = server.statuses
        for client in self._clients:
            if _match(server, client):
                self.soon(client.hear_status, statuses)


def _match(one: Party, other: Party) -> bool:
    return one.name == other.name and one.action_type is other.action_type
