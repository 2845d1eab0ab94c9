"""A network in virtual time, for trees and simulated servers in place of an rclpy node.

This is the Platform of simulation/platform.py, with topics and services. It decides nothing.
"""

from __future__ import annotations

import copy
import itertools
import reprlib
from collections.abc import Callable
from typing import Any

from bt_actions.messages.interfaces import interface, interface_name, short_name
from bt_actions.simulation.platform import RequestHandler
from bt_actions.testing.action_server import VirtualActionServer
from bt_actions.testing.medium import Medium
from bt_actions.testing.timeline import Alarm, Timeline

Subscription = tuple[type, Callable[[Any], None]]
"""The type of the messages, and the function that takes them."""


class Lines:
    """A log that keeps its lines."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []
        """The level and the text of each line, in order."""

    def add(self, level: str, text: str) -> None:
        """Add a line of this level."""
        self.lines.append((level, text))

    def info(self, text: str) -> None:
        self.add("info", text)

    def warning(self, text: str) -> None:
        self.add("warning", text)

    def error(self, text: str) -> None:
        self.add("error", text)

    def flush(self) -> None:
        """Do nothing: no line waits."""


class VirtualNetwork(Medium):
    """The network of participants and simulated servers; `timeline` is its time."""

    def __init__(self, namespace: str = "/") -> None:
        """Make a network; `namespace` is that of the servers on it, and of trees that run on it."""
        super().__init__(Timeline())
        self.log = Lines()
        self.numbers = itertools.count()
        """The numbers of its participants."""
        self.namespace = f"/{namespace.strip('/')}"
        self.topics: dict[str, Topic] = {}
        """The topics by full name."""
        self._publishers: dict[tuple[str, type, bool], VirtualPublisher] = {}
        """The publishers behind `publish`."""
        self.services: dict[str, tuple[type, Callable[[Any], Any], float]] = {}
        """The type of each service, its function, and the seconds that an answer takes, by full
        name."""

    def __repr__(self) -> str:
        return f"<VirtualNetwork {', '.join(self.actions) or 'without servers'}, {self.timeline!r}>"

    # The platform of simulated servers

    def now(self) -> float:
        """Return the virtual time."""
        return self.timeline.now

    def timer(self, ring: Callable[[], None]) -> VirtualTimer:
        return VirtualTimer(self.timeline, ring)

    def expand(self, name: str) -> str:
        return name if name.startswith("/") else f"{self.namespace.rstrip('/')}/{name}"

    def serve(
        self, action_type: Any, name: str, server: RequestHandler, result_timeout: float
    ) -> VirtualActionServer:
        return VirtualActionServer(self, self.expand(name), action_type, server, result_timeout)

    def publisher(
        self, message_type: Any, topic: str, *, latched: bool = False
    ) -> VirtualPublisher:
        """Make a publisher on a topic, which stamps headers with the virtual time."""
        return VirtualPublisher(self, message_type, topic, latched=latched, stamps=True)

    # Topics

    def topic(self, name: str) -> Topic:
        """Return a topic, with its publishers and listeners."""
        return self.topics.setdefault(self.expand(name), Topic())

    def subscribe(
        self,
        message_type: type | str,
        topic: str,
        take: Callable[[Any], None],
        *,
        latched: bool = False,
    ) -> Subscription:
        """Have `take` called with each message of this type.

        `latched` adds the latest message of each latched publisher from before.
        """
        message_type = interface(message_type, "msg")
        subscription, its = (message_type, take), self.topic(topic)
        its.subscriptions.append(subscription)
        for publisher in its.publishers:
            if latched and publisher.message_type is message_type and publisher.kept is not None:
                self.soon(its.bring, subscription, publisher.kept)
        return subscription

    def publish(self, topic: str, message: Any, *, latched: bool = False) -> None:
        """Publish a message, by a publisher of its type that stays; no stamp is set.

        `latched` messages also reach later subscriptions that are latched.
        """
        key = self.expand(topic), type(message), latched
        if not _is_message(message):
            raise TypeError(f"{key[0]} was given {told(message)}, and that is no message")
        if key not in self._publishers:
            self._publishers[key] = VirtualPublisher(self, key[1], topic, latched=latched)
        self._publishers[key].publish(message)

    # Services

    def provide(
        self,
        service_type: type | str,
        name: str,
        answer: Callable[[Any], Any],
        *,
        takes: float = 0.0,
    ) -> None:
        """Serve a service: `answer` makes the response of a request, which takes so long (s)."""
        self.services[self.expand(name)] = (interface(service_type, "srv"), answer, takes)

    def service(self, service_type: type, name: str) -> tuple[Callable[[Any], Any], float] | None:
        """Return the function of a service, and its seconds; None where there is none."""
        found = self.services.get(self.expand(name))
        return found[1:] if found is not None and found[0] is service_type else None


class Topic:
    """The publishers and the listeners of a topic."""

    def __init__(self) -> None:
        self.publishers: list[VirtualPublisher] = []
        self.subscriptions: list[Subscription] = []

    @property
    def published(self) -> set[type]:
        """The types of published messages."""
        return {each.message_type for each in self.publishers}

    @property
    def listened(self) -> set[type]:
        """The types of awaited messages."""
        return {each for each, _ in self.subscriptions}

    def bring(self, subscription: Subscription, message: Any) -> None:
        """Give an arriving message to its subscription, if that still listens."""
        if subscription in self.subscriptions:
            subscription[1](message)


class VirtualPublisher:
    """A publisher of messages of one type on a topic."""

    def __init__(
        self,
        network: VirtualNetwork,
        message_type: Any,
        topic: str,
        *,
        latched: bool,
        stamps: bool = False,
    ) -> None:
        """Appear on the topic; `stamps` sets the headers of messages to the virtual time."""
        self.message_type: Any = interface(message_type, "msg")
        self.topic = network.expand(topic)
        self.kept: Any = None
        """The latest message, where it is `latched`: later subscriptions get it."""
        self._network = network
        self._latched = latched
        self._stamps = stamps
        network.topic(topic).publishers.append(self)

    @property
    def listeners(self) -> int:
        subscriptions = self._network.topic(self.topic).subscriptions
        return sum(each is self.message_type for each, _ in subscriptions)

    def publish(self, message: Any) -> None:
        """Publish. Raises TypeError for a message of another type."""
        if not isinstance(message, self.message_type):
            kind = interface_name(self.message_type)
            raise TypeError(f"{self.topic} was given {told(message)}, and is a topic of {kind}")
        message = copy.deepcopy(message)  # the caller may change it before it arrives
        if self._stamps and hasattr(message, "header"):
            nanoseconds = int(self._network.now() * 1e9)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanoseconds, 10**9)
        if self._latched:
            self.kept = message
        its = self._network.topic(self.topic)
        for subscription in its.subscriptions:
            if subscription[0] is self.message_type:
                self._network.soon(its.bring, subscription, message)

    def destroy(self) -> None:
        its = self._network.topic(self.topic)
        if self in its.publishers:
            its.publishers.remove(self)


class VirtualTimer:
    """A timer that rings once."""

    def __init__(self, timeline: Timeline, ring: Callable[[], None]) -> None:
        self._timeline = timeline
        self._ring = ring
        self._alarm: Alarm | None = None

    @property
    def is_off(self) -> bool:
        """Whether the timer will not ring."""
        return self._alarm is None

    def set(self, when: float | None) -> None:
        self.destroy()
        if when is not None:
            self._alarm = self._timeline.call_at(when, self._rings)

    def destroy(self) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _rings(self) -> None:
        self._alarm = None
        self._ring()


def _is_message(value: object) -> bool:
    return hasattr(value, "get_fields_and_field_types") and not isinstance(value, type)


def told(value: object) -> str:
    """Return the words for an object in place of a message, for an error."""
    if isinstance(value, type):
        return f"the class {short_name(value)}"
    return f"a {short_name(type(value))}" if _is_message(value) else reprlib.repr(value)
