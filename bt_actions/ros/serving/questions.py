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
AGAIN = 1.0
"""Seconds after which a request without an answer is sent again."""
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


class _Question:
    """A request that is sent again each second until it is answered.

    Of several servers of a service, the one that answers may be discovered last.
    """

    def __init__(self, node: Node, service_type: Any, name: str, request: Any) -> None:
        self._client = node.create_client(service_type, name)
        self._request = request
        self._sent: list[Any] = []
        self._next = 0.0

    def answer(self) -> Any:
        """Return the answer; None as long as there is none. Sends the request where it is time."""
        for future in self._sent:
            if future.done():
                return future.result()
        if time.monotonic() >= self._next and self._client.service_is_ready():
            self._sent.append(self._client.call_async(self._request))
            self._next = time.monotonic() + AGAIN
        return None


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
        question = _Question(self._node, service_type, name, request)
        until = time.monotonic() + PATIENCE
        while (answer := question.answer()) is None and time.monotonic() < until:
            self._node.executor.spin_once(GLANCE)
        return answer


def answers(service_type: Any, namespace: str) -> dict[str, Any]:
    """Ask every service of a type below a namespace; by its name, None where it does not answer."""
    below = f"/{namespace.strip('/')}/".replace("//", "/")
    asked: dict[str, _Question] = {}
    begun = time.monotonic()
    with _asking() as node:
        while (now := time.monotonic() - begun) < PATIENCE + (DISCOVERS if asked else 0.0):
            for name, types in node.get_service_names_and_types():
                fits = interface_name(service_type) in types and name.startswith(below)
                if fits and name not in asked:
                    asked[name] = _Question(node, service_type, name, service_type.Request())
            missing = [each for each in asked.values() if each.answer() is None]
            if now >= DISCOVERS and asked and not missing:
                break
            node.executor.spin_once(GLANCE)
        return {name: asked[name].answer() for name in sorted(asked)}
