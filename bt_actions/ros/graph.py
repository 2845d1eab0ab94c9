"""A node's view of an action's servers in the ROS graph, and the state of the node itself.

A server is known by the GID of its reader of goal requests: from the moment the graph shows the
reader, the server gets requests. The rest of an opening server follows (within 18 ms, in 12
openings). Services are pairs of DDS topics, whose names are those of ROS 2's middlewares for DDS;
of another middleware this graph would show no server.
"""

from __future__ import annotations

import contextlib

from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node


def servers(node: Node, action: str) -> frozenset[bytes]:
    """Return the GIDs of the servers of an action that this node knows by now.

    Raises InvalidHandle where the node was destroyed.
    """
    service = node.resolve_service_name(f"{action}/_action/send_goal")
    with node.handle:  # the node's own method makes more objects of it, in thrice the time
        found = _rclpy.rclpy_get_subscriptions_info_by_topic(
            node.handle, f"rq{service}Request", True
        )
    return frozenset(bytes(info["endpoint_gid"]) for info in found)


def is_valid(node: Node) -> bool:
    """Return whether the node is there, and its context was not shut down.

    The lock of the context is not taken: rclpy holds it while it calls back on shutdown.
    """
    try:
        context = node.context.handle
        with node.handle, context:
            return bool(context.ok())
    except InvalidHandle:  # either was destroyed
        return False


def is_shut_down(node: Node) -> bool:
    """Return whether a node's context was shut down, as by Ctrl-C; takes no lock, as `is_valid`."""
    try:
        context = node.context.handle
        with context:
            return not context.ok()
    except InvalidHandle:
        return True


def enclave(node: Node) -> str:
    """Return the SROS 2 enclave of a node of ours, whatever set it.

    Without any, and of a destroyed node, the enclave is "/", as in rcl.
    """
    with contextlib.suppress(Exception):
        mine = node.get_name(), node.get_namespace()
        for name, namespace, its in node.get_node_names_and_namespaces_with_enclaves():
            if (name, namespace) == mine:
                return str(its)
    return "/"
