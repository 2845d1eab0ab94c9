"""Why a topic or a service finds nobody, as far as the ROS graph shows it. Only reads.

What is there in vain is told first: another type, or a quality of service that does not match; then
one of the same type in another namespace. The texts follow a name and go on as a sentence.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from bt_actions.utilities.suggest import did_you_mean, listing

NAMED = 3
"""Names of one type in other namespaces that are told, at most."""

ALIKE = 0.75
"""How alike two full names must be: they share their namespaces."""


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


def elsewhere(name: str, kind: str, known: Mapping[str, Collection[str]]) -> str:
    """Name those of a type that end as `name` does, in other namespaces; or what looks like it.

    `known` has the types of each full name.
    """
    of_kind = [each for each, kinds in known.items() if kind in kinds and each != name]
    base = name.rpartition("/")[2]
    found = sorted(each for each in of_kind if each.rpartition("/")[2] == base)
    if found:
        return f"; there is {listing(found, NAMED)} of that type"
    return did_you_mean(name, of_kind, cutoff=ALIKE)


def without_topic(node: Node, topic: str, kind: str, qos: QoSProfile, *, publish: bool) -> str:
    """Say, behind a colon, why nobody is heard on a topic (or, without `publish`, hears us)."""
    look = node.get_publishers_info_by_topic if publish else node.get_subscriptions_info_by_topic
    try:
        others = look(topic)
        why = mismatch(kind, qos, others, publish=publish)
        known = {} if others else dict(node.get_topic_names_and_types())
    except Exception:  # noqa: BLE001 - our node was destroyed
        return ""
    return (f": {why}" if why else "") + elsewhere(topic, kind, known)


def without_service(node: Node, service: str, kind: str) -> str:
    """Say, behind a colon, what is in sight where a service is not."""
    try:
        known: dict[str, list[str]] = {
            name: kinds
            for name, kinds in node.get_service_names_and_types()
            if node.count_services(name)  # and not only clients, as ours
        }
    except Exception:  # noqa: BLE001 - our node was destroyed
        return ""
    others = sorted(set(known.get(service, ())) - {kind})
    if others:
        return f": what is there is {listing(others)}, not {kind}"
    if service in known:
        return ": it is in sight, but was not ready"
    return f": nobody offers it{elsewhere(service, kind, known)}"
