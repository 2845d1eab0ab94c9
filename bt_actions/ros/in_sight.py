"""Why a topic or a service finds nobody, as far as the ROS graph shows it. Only reads.

What is there in vain is told first: another type, or a quality of service that does not match; then
one of the same type in another namespace. The texts follow a name and go on as a sentence.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from bt_actions.utilities.suggest import did_you_mean, listing

__all__ = ["Ends", "elsewhere", "without_service", "without_topic"]

NAMED = 3
"""Names of one type in other namespaces that are told, at most."""

ALIKE = 0.75
"""How alike two full names must be: they share their namespaces."""


@dataclass(frozen=True, slots=True)
class Ends:
    """What the publishers, or the subscriptions, of a topic have in common with ours."""

    type: str
    reliable: bool = True
    durable: bool = False
    """Whether what was published before is kept, or asked for."""


def mismatch(ours: Ends, others: Iterable[Ends], *, publish: bool) -> str:
    """Say why the others on our topic, who `publish` or else subscribe, do not match; or ""."""
    others = list(others)
    theirs = "what is published there" if publish else "what is asked for there"
    if not others:
        return "nobody publishes on it" if publish else ""
    same = [each for each in others if each.type == ours.type]
    if not same:
        return f"{theirs} is {listing(sorted({each.type for each in others}))}, not {ours.type}"
    offers, wants = (same, [ours]) if publish else ([ours], same)
    if all(each.reliable for each in wants) and not any(each.reliable for each in offers):
        word = "best effort, write 'qos: best_effort'" if publish else "reliable, not best effort"
        return f"{theirs} is {word}"
    if all(each.durable for each in wants) and not any(each.durable for each in offers):
        word = "not latched, write 'qos: default'" if publish else "latched, write 'qos: latched'"
        return f"{theirs} is {word}"
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
        others = [_ends(info.topic_type, info.qos_profile) for info in look(topic)]
        why = mismatch(_ends(kind, qos), others, publish=publish)
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


def _ends(kind: str, qos: Any) -> Ends:
    return Ends(
        kind,
        qos.reliability is not ReliabilityPolicy.BEST_EFFORT,
        qos.durability is DurabilityPolicy.TRANSIENT_LOCAL,
    )
