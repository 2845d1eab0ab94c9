"""The reason why a topic or a service finds nobody, in words, from the ROS graph.

A useless find is told first: one of another type, or with a quality of service that does not match;
then one of the same type in another namespace. The texts follow a name and go on as a sentence. The
graph is asked only where a reason is given.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_action_status_default,
    qos_profile_services_default,
)
from rclpy.topic_endpoint_info import TopicEndpointInfo

from bt_actions.utilities.suggest import listing


def mismatch(
    kind: str, qos: QoSProfile, others: Sequence[TopicEndpointInfo], *, publish: bool
) -> str:
    """Say why the others on our topic, which `publish` or else subscribe, do not match; or ""."""
    theirs = "what is published there" if publish else "what is asked for there"
    if not others:
        return "nobody publishes on it" if publish else ""
    same = [each.qos_profile for each in others if each.topic_type == kind]
    if not same:
        return f"{theirs} is {listing(sorted({each.topic_type for each in others}))}, not {kind}"
    offers, wants = (same, [qos]) if publish else ([qos], same)
    for keeps, published, asked in (
        (
            lambda qos: qos.reliability is not ReliabilityPolicy.BEST_EFFORT,
            "best effort, write 'qos: best_effort'",
            "reliable, not best effort",
        ),
        (
            lambda qos: qos.durability is DurabilityPolicy.TRANSIENT_LOCAL,
            "not latched, write 'qos: default'",
            "latched, write 'qos: latched'",
        ),
    ):
        if all(map(keeps, wants)) and not any(map(keeps, offers)):
            return f"{theirs} is {published if publish else asked}"
    return ""


def unmatched_action(node: Node, action: str) -> str:
    """Say what in the quality of service of an action's server keeps our clients from it; or ""."""
    said: dict[str, list[str]] = defaultdict(list)
    for part, ours in (
        ("feedback", qos_profile_services_default),
        ("status", qos_profile_action_status_default),
    ):
        topic = node.get_publishers_info_by_topic(f"{action}/_action/{part}")
        said[_gap([each.qos_profile for each in topic], [ours])].append(part)
    for part in ("send_goal", "get_result", "cancel_goal"):
        said[unmatched_service(node, f"{action}/_action/{part}")].append(f"{part} service")
    said.pop("", None)
    return "; ".join(f"its {listing(parts)} {why}" for why, parts in said.items())


def unmatched_service(node: Node, service: str) -> str:
    """Say the same of a service, whose two topics have the names of ROS 2's middlewares for DDS."""
    name, ours = node.resolve_service_name(service), [qos_profile_services_default]
    replies = node.get_publishers_info_by_topic(f"rr{name}Reply", no_mangle=True)
    requests = node.get_subscriptions_info_by_topic(f"rq{name}Request", no_mangle=True)
    return _gap([each.qos_profile for each in replies], ours) or _gap(
        ours, [each.qos_profile for each in requests], "asks for {asks}, and gets {offers}"
    )


def _gap(
    offers: Sequence[QoSProfile],
    asks: Sequence[QoSProfile],
    words: str = "is {offers}, and {asks} is asked for",
) -> str:
    """Name the policy by which what a publisher offers is less than a subscription asks for."""
    for offered, asked in itertools.product(offers, asks):
        if offered.reliability is ReliabilityPolicy.BEST_EFFORT is not asked.reliability:
            return words.format(offers="best effort", asks="reliable")
        if offered.durability is DurabilityPolicy.VOLATILE is not asked.durability:
            return words.format(offers="volatile", asks="transient local")
    return ""
