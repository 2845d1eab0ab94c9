"""Questions to servers in sight, from a participant that is gone afterwards. All calls block."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from bt_actions.messages.interfaces import interface_name
from bt_actions.ros.connections import DISCOVERS
from bt_actions.ros.naming import passing_node
from bt_actions.ros.serving.endpoints import kept

PATIENCE = 5.0
"""Seconds for a server to come in sight, and for one to answer."""
AGAIN = 1.0
"""Seconds after which a request without an answer is sent again."""
GLANCE = 0.05
"""Seconds between two looks."""


class _Question:
    """A request that is sent again each second until an answer comes.

    Of several servers of a service, the one that answers may be discovered last.
    """

    def __init__(self, node: Node, service_type: Any, name: str, request: Any) -> None:
        self._client = node.create_client(service_type, name)
        self._request = request
        self._sent: list[Any] = []
        self._next = 0.0

    def answer(self) -> Any:
        """Return the answer, or None without one yet; send the request again where it is time."""
        for future in self._sent:
            if future.done():
                return future.result()
        if time.monotonic() >= self._next and self._client.service_is_ready():
            self._sent.append(self._client.call_async(self._request))
            self._next = time.monotonic() + AGAIN
        return None


class Asker:
    """A node that hears topics and calls services, and is spun here."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def heard(self, message_type: type, depth: int) -> Iterator[Any]:
        """Yield the kept messages of every topic of a type, for some seconds; see `kept`."""
        came: list[Any] = []
        known: set[str] = set()
        for _ in self._looks(PATIENCE):
            yield from came
            came.clear()
            for topic, types in self._node.get_topic_names_and_types():
                if interface_name(message_type) in types and topic not in known:
                    known.add(topic)
                    self._node.create_subscription(message_type, topic, came.append, kept(depth))

    def find(self, service_type: type, fits: Callable[[str], bool]) -> str:
        """Return the first service of a type whose name fits; "" where none comes in sight."""
        for _ in self._looks(PATIENCE):
            for name, types in sorted(self._node.get_service_names_and_types()):
                if interface_name(service_type) in types and fits(name):
                    return str(name)
        return ""

    def ask(self, service_type: Any, name: str, request: Any) -> Any:
        """Return the answer of a service; None without one."""
        question = _Question(self._node, service_type, name, request)
        answers = (question.answer() for _ in self._looks(PATIENCE))
        return next((each for each in answers if each is not None), None)

    def answers(self, service_type: Any, namespace: str) -> dict[str, Any]:
        """Ask all services of a type below a namespace; return answers by name, None for none."""
        below = f"/{namespace.strip('/')}/".replace("//", "/")
        asked: dict[str, _Question] = {}
        for passed in self._looks(PATIENCE + DISCOVERS):
            for name, types in self._node.get_service_names_and_types():
                fits = interface_name(service_type) in types and name.startswith(below)
                if fits and name not in asked:
                    request = service_type.Request()
                    asked[name] = _Question(self._node, service_type, name, request)
            missing = [each for each in asked.values() if each.answer() is None]
            if passed >= (DISCOVERS if asked else PATIENCE) and not missing:
                break
        return {name: asked[name].answer() for name in sorted(asked)}

    def _looks(self, seconds: float) -> Iterator[float]:
        """Yield the passed time again and again; take in messages in between."""
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < seconds:
            yield passed
            self._node.executor.spin_once(GLANCE)


@contextlib.contextmanager
def asking() -> Iterator[Asker]:
    """Yield an asker with a participant of its own, and take both away afterwards."""
    with passing_node("bt_actions_asks") as node:
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        try:
            yield Asker(node)
        finally:
            executor.shutdown()
