"""What a node sees of an action's servers in the ROS graph, and what is known of the node itself.

A server is known by the GID of its reader of goal requests: who has one takes what is sent, from
the moment on that it is shown; the rest of a server that opens follows (within 18 ms, in 12
openings). Services are pairs of DDS topics, whose names are those of ROS 2's middlewares for DDS;
of another middleware this graph would show no server.
"""

from __future__ import annotations

import contextlib

from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node


def servers(node: Node, action: str) -> frozenset[bytes]:
    """Return the GIDs of the servers of an action, as far as this node knows by now.

    Raises InvalidHandle when the node was destroyed.
    """
    service = node.resolve_service_name(f"{action}/_action/send_goal")
    with node.handle:  # the node's own method makes more objects of it, in thrice the time
        found = _rclpy.rclpy_get_subscriptions_info_by_topic(
            node.handle, f"rq{service}Request", True
        )
    return frozenset(bytes(info["endpoint_gid"]) for info in found)


def is_valid(node: Node) -> bool:
    """Whether the node is there, and its context was not shut down.

    Asked without the lock of its context, which rclpy holds while it calls back on shutdown.
    """
    try:
        context = node.context.handle
        with node.handle, context:
            return bool(context.ok())
    except InvalidHandle:  # either was destroyed
        return False


def is_shut_down(node: Node) -> bool:
    """Whether the context of a node was shut down, as by Ctrl-C; asked as `is_valid` does it."""
    try:
        context = node.context.handle
        with context:
            return not context.ok()
    except InvalidHandle:
        return True


def enclave(node: Node) -> str:
    """Return the SROS 2 enclave of a node of ours, by whatever way it was given.

    Without any, and of a node that was destroyed, it is "/", as rcl has it.
    """
    with contextlib.suppress(Exception):
        mine = node.get_name(), node.get_namespace()
        for name, namespace, its in node.get_node_names_and_namespaces_with_enclaves():
            if (name, namespace) == mine:
                return str(its)
    return "/"
