"""Why a goal was rejected, asked from outside: ROS itself gives a rejection no reason."""

from __future__ import annotations

import time

from bt_actions_interfaces.msg import Rejection
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bt_actions.ros import participant
from bt_actions.serving.rejections import REJECTIONS

__all__ = ["why_rejected"]

TYPE = "bt_actions_interfaces/msg/Rejection"
PATIENCE = 5.0
"""Seconds for the server's topic to be found."""


def why_rejected(goal_name: str, patience: float = PATIENCE) -> Rejection | None:
    """The last rejection of a goal of this name that any server of trees in sight tells of.

    Blocks, for `patience` seconds at most.
    """
    context = Context()
    context.init()
    node = Node("bt_actions_why", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    heard: list[Rejection] = []
    known: set[str] = set()
    kept = QoSProfile(depth=REJECTIONS, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    until = time.monotonic() + patience
    try:
        while time.monotonic() < until:
            for topic, types in node.get_topic_names_and_types():
                if TYPE in types and topic not in known:
                    known.add(topic)
                    node.create_subscription(Rejection, topic, heard.append, kept)
            executor.spin_once(timeout_sec=0.05)
            for each in heard:
                if each.goal_name == goal_name:
                    return each
        return None
    finally:
        executor.shutdown()
        participant.close(node, context)
