"""Questions to servers of trees in sight, from outside: which trees, and why a goal was rejected.

Each is asked by a participant of its own, which is gone afterwards. All of them block.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from bt_actions_interfaces.msg import Rejection, TreeInfo
from bt_actions_interfaces.srv import ListTrees
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bt_actions.ros.topics import DISCOVERS
from bt_actions.ros.workarounds import participant
from bt_actions.serving.rejections import REJECTIONS

__all__ = ["trees_in_sight", "why_rejected"]

PATIENCE = 5.0
"""Seconds for a server to come in sight, and for one to answer."""
Spin = Callable[[], None]


@contextlib.contextmanager
def _asking() -> Iterator[tuple[Node, Spin]]:
    context = Context()
    context.init()
    node = Node("bt_actions_asks", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, lambda: executor.spin_once(timeout_sec=0.05)
    finally:
        executor.shutdown()
        participant.close(node, context)


def why_rejected(goal_name: str) -> Rejection | None:
    """The last rejection of a goal of this name that any server in sight tells of."""
    heard: list[Rejection] = []
    known: set[str] = set()
    kept = QoSProfile(depth=REJECTIONS, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    until = time.monotonic() + PATIENCE
    with _asking() as (node, spin):
        while time.monotonic() < until:
            for topic, types in node.get_topic_names_and_types():
                if "bt_actions_interfaces/msg/Rejection" in types and topic not in known:
                    known.add(topic)
                    node.create_subscription(Rejection, topic, heard.append, kept)
            spin()
            for each in heard:
                if each.goal_name == goal_name:
                    return each
    return None


def trees_in_sight(namespace: str = "") -> dict[str, list[TreeInfo] | None]:
    """The trees of each server below a namespace, by its node's name; None: it does not answer."""
    below = f"/{namespace.strip('/')}/" if namespace.strip("/") else "/"
    futures = {}
    begun = time.monotonic()
    with _asking() as (node, spin):

        def look() -> None:
            for service, types in node.get_service_names_and_types():
                if "bt_actions_interfaces/srv/ListTrees" not in types or service in futures:
                    continue
                if service.startswith(below):
                    client = node.create_client(ListTrees, service)
                    futures[service] = client, None

        def ask() -> bool:
            """Whether all have answered."""
            for service, (client, future) in futures.items():
                if future is None and client.service_is_ready():
                    futures[service] = client, client.call_async(ListTrees.Request())
            return all(future is not None and future.done() for _, future in futures.values())

        while (now := time.monotonic() - begun) < PATIENCE + (DISCOVERS if futures else 0.0):
            if now < DISCOVERS or not futures:
                look()
            if ask() and futures and now >= DISCOVERS:
                break
            spin()
    return {
        service.removesuffix("/list_trees"): (
            list(future.result().trees) if future is not None and future.done() else None
        )
        for service, (_, future) in sorted(futures.items())
    }
