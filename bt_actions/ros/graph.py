"""Which servers of an action the ROS graph shows to a node, and what it says of that node itself.

A server is known by the GID of its reader of goal requests: who has one takes what is sent, from
the moment on that it is shown; the rest of a server that opens follows (within 18 ms, in 12
openings).
"""

from __future__ import annotations

import contextlib
import sys

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier


def servers(node: Node, action: str) -> frozenset[bytes]:
    """Return the GIDs of the servers of an action, as far as this node knows by now.

    Raises InvalidHandle when the node was destroyed.
    """
    if not _IN_DDS:
        infos = node.get_publishers_info_by_topic(f"{action}/_action/status")
        return frozenset(bytes(info.endpoint_gid) for info in infos)
    service = node.resolve_service_name(f"{action}/_action/send_goal")
    with node.handle:  # the node's own method makes more objects of it, in thrice the time
        found = _rclpy.rclpy_get_subscriptions_info_by_topic(
            node.handle, f"rq{service}Request", True
        )
    return frozenset(bytes(info["endpoint_gid"]) for info in found)


def enclave(node: Node) -> str:
    """Return the SROS 2 enclave of a node of ours, by whatever way it was given.

    Where there are more nodes of its name, the one that this program was started with. Without any,
    and of a node that was destroyed, it is "/", as rcl has it.
    """
    same: list[str] = []
    with contextlib.suppress(Exception):
        for name, namespace, its_enclave in node.get_node_names_and_namespaces_with_enclaves():
            if (name, namespace) == (node.get_name(), node.get_namespace()):
                same.append(its_enclave)
    return max(same, key=lambda its: its in sys.argv, default="/")


_IN_DDS = get_rmw_implementation_identifier() in (
    "rmw_fastrtps_cpp",
    "rmw_fastrtps_dynamic_cpp",
    "rmw_cyclonedds_cpp",
    "rmw_connextdds",
)
"""Where services are pairs of DDS topics, as REP 2008's predecessors name them; elsewhere the graph
shows no readers of requests, and the publisher of the status topic has to do."""
