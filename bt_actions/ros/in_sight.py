"""Why a topic or a service finds nobody, in words, of what the ROS graph shows.

What is there in vain is told first: another type, or a quality of service that does not match; then
one of the same type in another namespace. The texts follow a name and go on as a sentence.
"""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from bt_actions.utilities.suggest import listing


def mismatch(
    kind: str, qos: QoSProfile, others: Sequence[TopicEndpointInfo], *, publish: bool
) -> str:
    """Say why the others on our topic, who `publish` or else subscribe, do not match; or ""."""
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
