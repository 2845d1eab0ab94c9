"""What servers in sight say, asked by a participant that is gone afterwards. All of it blocks."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator, Iterator
from typing import Any, Self

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from bt_actions.messages.interfaces import interface_name
from bt_actions.ros.connections import DISCOVERS
from bt_actions.ros.naming import own_node
from bt_actions.ros.serving.endpoints import kept
from bt_actions.ros.workarounds import participant

PATIENCE = 5.0
"""Seconds for a server to come in sight, and for one to answer."""
GLANCE = 0.05
"""Seconds between two looks."""


@contextlib.contextmanager
def _asking() -> Iterator[Node]:
    node = own_node("bt_actions_asks")
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        yield node
    finally:
        executor.shutdown()
        participant.close(node)


def heard(message_type: type, depth: int) -> Generator[Any]:
    """Yield what is kept on every topic of a type, for some seconds; see `kept`."""
    came: list[Any] = []
    known: set[str] = set()
    until = time.monotonic() + PATIENCE
    with _asking() as node:
        while time.monotonic() < until:
            for topic, types in node.get_topic_names_and_types():
                if interface_name(message_type) in types and topic not in known:
                    known.add(topic)
                    node.create_subscription(message_type, topic, came.append, kept(depth))
            node.executor.spin_once(GLANCE)
            yield from came
            came.clear()


class Asker:
    """Calls one service after another; a context manager."""

    def __enter__(self) -> Self:
        self._context = _asking()
        self._node = self._context.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._context.__exit__(*error)

    def find(self, service_type: type, fits: Callable[[str], bool]) -> str:
        """Return the first service of a type whose name fits; "" where none comes in sight."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            for name, types in sorted(self._node.get_service_names_and_types()):
                if interface_name(service_type) in types and fits(name):
                    return str(name)
            self._node.executor.spin_once(GLANCE)
        return ""

    def ask(self, service_type: Any, name: str, request: Any) -> Any:
        """Return what a service answers; None where it does not."""
        client, future = self._node.create_client(service_type, name), None
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until and not (future and future.done()):
            if future is None and client.service_is_ready():
                future = client.call_async(request)
            self._node.executor.spin_once(GLANCE)
        return future.result() if future is not None and future.done() else None


def answers(service_type: Any, namespace: str) -> dict[str, Any]:
    """Ask every service of a type below a namespace; by its name, None where it does not answer."""
    below = f"/{namespace.strip('/')}/".replace("//", "/")
    clients: dict[str, Any] = {}
    futures: dict[str, Any] = {}
    begun = time.monotonic()
    with _asking() as node:
        while (now := time.monotonic() - begun) < PATIENCE + (DISCOVERS if clients else 0.0):
            for name, types in node.get_service_names_and_types():
                fits = interface_name(service_type) in types and name.startswith(below)
                if fits and name not in clients:
                    clients[name] = node.create_client(service_type, name)
            for name, client in clients.items():
                if name not in futures and client.service_is_ready():
                    futures[name] = client.call_async(service_type.Request())
            all_called = 0 < len(futures) == len(clients)
            if now >= DISCOVERS and all_called and all(each.done() for each in futures.values()):
                break
            node.executor.spin_once(GLANCE)
    return {name: futures[name].result() if name in futures else None for name in sorted(clients)}
