"""A node in the roles of traffic/ (transport.Participant) and of leaves (backend.Backend).

Names, clocks, topics, services and the graph of rclpy; decides nothing about a goal.
"""

from __future__ import annotations

import atexit
import functools
import os
import random
import weakref
from typing import Any

from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node

from bt_actions.goals.terms import NEVER
from bt_actions.messages.interfaces import interface_name
from bt_actions.ros.action_transport import RosTransport
from bt_actions.ros.clocks import Clocks
from bt_actions.ros.connections import RosPublisher, RosService, RosSubscription
from bt_actions.ros.environment import of_other_users, sees_nobody_else
from bt_actions.ros.exit import close_process, disown
from bt_actions.ros.graph import enclave, is_shut_down, is_valid
from bt_actions.ros.host import host
from bt_actions.ros.in_sight import unmatched_action
from bt_actions.ros.log import log
from bt_actions.ros.naming import server_name, warn_of_remapping
from bt_actions.ros.receiving import Receiver
from bt_actions.ros.rediscovery import look_for
from bt_actions.traffic.state import Endpoint
from bt_actions.traffic.traffic import Traffic
from bt_actions.traffic.transport import Listener
from bt_actions.utilities.suggest import did_you_mean, elsewhere, listing

FEEDBACK = "/_action/feedback"
_ON_NODE = "_bt_actions_participant"


class _Sight:
    """The sight of a context, as long as any of its nodes is there: the next node gets a new one.

    A node of the user in the same context may keep the old sight alive, which nobody tells us.
    """

    def __init__(self, before: _Sight | None) -> None:
        self.since = host.steady()
        """The moment at which the context became known here; a new one has dropped no server yet.
        """
        now = host.stalls.long_times
        self.long_stalls: int = now if before is None else before.long_stalls
        """The number of this process' long stalls by then: after more of them, an endpoint may hear
        nothing.
        """
        self.nodes: weakref.WeakSet[Node] = weakref.WeakSet()


_sights: weakref.WeakKeyDictionary[Any, _Sight] = weakref.WeakKeyDictionary()


class NodeParticipant:
    """The sight and hearing of goals and leaves through one node; each node has one."""

    randomness = random.Random()

    def __init__(self, node: Node) -> None:
        """Make the one of a node; the caller holds the lock."""
        self.node = node
        clocks = Clocks(node)
        self.now, self.stamp = clocks.now, clocks.stamp
        self.domain: int = node.context.get_domain_id()
        self.name: str = node.get_name()
        self.namespace: str = node.get_namespace()
        sight = _sights.get(node.context)
        if sight is None or not any(is_valid(each) for each in sight.nodes):
            host.appears()
            sight = _sights[node.context] = _Sight(sight)
        sight.nodes.add(node)
        self.seen_since, self.long_stalls = sight.since, sight.long_stalls
        self.service = functools.partial(RosService, node)
        self.subscription = functools.partial(RosSubscription, node, sight.since)
        self.publisher = functools.partial(RosPublisher, node, sight.since)
        self.traffic = Traffic(host, self)
        self._receiver = Receiver(node)
        self._servers: dict[str, str] = {}
        self._asked_by: dict[str, str] = {}
        """The action by which our node asks a server, by the server's name; both are full names."""

    @classmethod
    def of(cls, node: Node) -> NodeParticipant:
        """Return the one of `node`, or a new one where its traffic was destroyed."""
        with host.lock:
            found: NodeParticipant | None = getattr(node, _ON_NODE, None)
            if found is None or found.traffic.closed:
                found = cls(node)
                setattr(node, _ON_NODE, found)  # lives as long as the node does
            return found

    # What leaves ask for

    def log(self, level: str, text: str) -> None:
        log.by(self.node.get_logger().name, level, text)

    # What traffic asks for

    def alive(self) -> bool:
        return is_valid(self.node)

    def shut_down(self) -> bool:
        return is_shut_down(self.node)

    def full_name(self, action: str) -> str:
        if action not in self._servers:
            full = expand_topic_name(action, self.name, self.namespace)
            self._servers[action] = server = server_name(self.node, full)
            self._asked_by.setdefault(server, full)
            warn_of_remapping(self.node, full)
        return self._servers[action]

    def open_transport(self, action_type: Any, name: str, listener: Listener) -> RosTransport:
        """Open a client of an action, under the name whose parts rules may remap."""
        action = self._asked_by.get(name, name)
        is_private = sees_nobody_else()  # no server can come to be seen later than another
        seen_since = NEVER if is_private else self.seen_since
        leave = self._receiver.leave
        transport = RosTransport(self.node, action_type, action, listener, seen_since, leave)
        self._receiver.join(transport)
        return transport

    def seek(self, endpoint: Endpoint) -> None:
        if self._is_one_server(endpoint.name):
            look_for(endpoint, self.domain, self._enclave)

    @functools.cached_property
    def _enclave(self) -> str:
        return enclave(self.node)

    def _is_one_server(self, name: str) -> bool:
        """Return whether remapping rules lead all parts of an action to one server."""
        parts = {
            self.node.resolve_topic_name: ("status", "feedback"),
            self.node.resolve_service_name: ("send_goal", "cancel_goal", "get_result"),
        }
        action = self._asked_by.get(name, name)
        return all(
            resolve(f"{action}/_action/{part}") == f"{name}/_action/{part}"
            for resolve, its in parts.items()
            for part in its
        )

    def unheard(self) -> str:
        return of_other_users()

    def instead(self, action_type: Any, name: str) -> str:
        actions, ours = dict[str, str](), interface_name(action_type)
        try:
            for topic, _ in self.node.get_topic_names_and_types():
                if topic.endswith(FEEDBACK):
                    for info in self.node.get_publishers_info_by_topic(topic):
                        kind = info.topic_type.removesuffix("_FeedbackMessage")
                        actions[topic.removesuffix(FEEDBACK)] = kind
            kind = actions.get(name)
            why = unmatched_action(self.node, name) if kind == ours else ""
        except Exception:  # noqa: BLE001 - our node was destroyed
            return ""
        if kind == ours:
            why = why or f"was not ready, or has requests enough to answer{of_other_users()}"
            return f": it is in sight, but {why}"
        if kind is not None:
            return f"; there is one of another type or version, {kind}"
        if not actions:
            return "; no action server at all is in sight in this ROS domain"
        if found := elsewhere(name, ours, {name: (its,) for name, its in actions.items()}):
            return found
        if of_its_type := sorted(name for name in actions if actions[name] == ours):
            return f"; of its type there is {listing(of_its_type)}"
        return did_you_mean(name, actions)


def traffic_of(node: Node) -> Traffic:
    """Return the one Traffic of `node`, or a new one where that was destroyed."""
    return NodeParticipant.of(node).traffic


atexit.register(close_process)
os.register_at_fork(after_in_child=disown)
