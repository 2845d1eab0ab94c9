"""A network in virtual time: what simulated servers stand on, as on an rclpy node, and trees.

The Platform of simulation/platform.py, with topics and services. It decides nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from bt_actions.messages.conversion import show
from bt_actions.messages.interfaces import short_name
from bt_actions.simulation.platform import Server
from bt_actions.testing.action_server import VirtualActionServer
from bt_actions.testing.medium import Medium
from bt_actions.testing.timeline import Alarm, Timeline

Subscription = tuple[type, Callable[[Any], None]]
"""The type of the messages, and what takes them."""


class Lines:
    """A log that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []
        """Level and text of each, in order."""

    def add(self, level: str, text: str) -> None:
        """Take a line of this level."""
        self.lines.append((level, text))

    def info(self, text: str) -> None:
        """Log at info level."""
        self.add("info", text)

    def warning(self, text: str) -> None:
        """Log at warning level."""
        self.add("warning", text)

    def error(self, text: str) -> None:
        """Log at error level."""
        self.add("error", text)

    def flush(self) -> None:
        """Have nothing to do."""


class VirtualNetwork(Medium):
    """What participants and simulated servers are on; `timeline` is its time."""

    def __init__(self, namespace: str = "/") -> None:
        """`namespace` is that of the servers on it, and of trees that are run on it."""
        super().__init__(Timeline())
        self.log = Lines()
        self.numbers = itertools.count()
        """Those of its participants."""
        self.namespace = f"/{namespace.strip('/')}"
        self._topics: dict[str, _Topic] = {}
        self._services: dict[str, tuple[type, Callable[[Any], Any], float]] = {}

    def __repr__(self) -> str:
        return f"<VirtualNetwork {', '.join(self.actions) or 'without servers'}, {self.timeline!r}>"

    # What simulated servers stand on

    def now(self) -> float:
        """Return the virtual time."""
        return self.timeline.now

    def timer(self, ring: Callable[[], None]) -> VirtualTimer:
        """Make a timer."""
        return VirtualTimer(self.timeline, ring)

    def expand(self, name: str) -> str:
        """Return a name in the namespace of the network."""
        return name if name.startswith("/") else f"{self.namespace.rstrip('/')}/{name}"

    def serve(
        self, action_type: Any, name: str, server: Server, result_timeout: float
    ) -> VirtualActionServer:
        """Serve an action."""
        return VirtualActionServer(self, self.expand(name), action_type, server, result_timeout)

    def publisher(self, message_type: Any, topic: str) -> VirtualPublisher:
        """Make a publisher on a topic."""
        return VirtualPublisher(self, message_type, self.expand(topic))

    # Topics

    def topic(self, name: str) -> _Topic:
        """Return what is known of a topic."""
        return self._topics.setdefault(self.expand(name), _Topic())

    def subscribe(
        self, message_type: type, topic: str, take: Callable[[Any], None]
    ) -> Subscription:
        """Have `take` called with each message of this type."""
        subscription = (message_type, take)
        self.topic(topic).subscriptions.append(subscription)
        return subscription

    def publish(self, topic: str, message: Any, *, latched: bool = False) -> None:
        """Bring a message to all subscriptions of its type; `latched` ones to later ones, too."""
        each = self.topic(topic)
        if latched:
            each.latched = message
        for subscription in each.subscriptions:
            if isinstance(message, subscription[0]):
                self.soon(each.bring, subscription, message)

    # Services

    def provide(
        self, service_type: type, name: str, answer: Callable[[Any], Any], *, takes: float = 0.0
    ) -> None:
        """Serve a service: `answer` makes the response of a request, which takes so long (s)."""
        self._services[self.expand(name)] = (service_type, answer, takes)

    def service(self, service_type: type, name: str) -> tuple[Callable[[Any], Any], float] | None:
        """Return how a service answers, and how long that takes; None where there is none."""
        found = self._services.get(self.expand(name))
        return found[1:] if found is not None and found[0] is service_type else None


class _Topic:
    """Who listens to a topic and who speaks on it, and what later listeners are told."""

    def __init__(self) -> None:
        self.subscriptions: list[Subscription] = []
        self.publishers: list[type] = []
        """The message types of those who may publish on it."""
        self.latched: Any = None

    def leave(self, message_type: type) -> None:
        """Count one of its publishers off, if there is one."""
        if message_type in self.publishers:
            self.publishers.remove(message_type)

    def bring(self, subscription: Subscription, message: Any) -> None:
        """Give a message that arrives to who still listens."""
        if subscription in self.subscriptions:
            subscription[1](message)


class VirtualPublisher:
    """That of a simulated server, or of a test."""

    def __init__(self, network: VirtualNetwork, message_type: Any, topic: str) -> None:
        self._network = network
        self._type = message_type
        self.topic = topic
        network.topic(topic).publishers.append(message_type)

    def publish(self, message: Any) -> None:
        """Publish, with the virtual time in the header. Raises TypeError for another message."""
        if not isinstance(message, self._type):
            wanted = short_name(self._type)
            raise TypeError(f"{self.topic} takes a {wanted}, not {show(message)}")
        if hasattr(message, "header"):
            nanoseconds = int(self._network.now() * 1e9)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanoseconds, 10**9)
        self._network.publish(self.topic, message)

    def destroy(self) -> None:
        """Publish no more."""
        self._network.topic(self.topic).leave(self._type)


class VirtualTimer:
    """Rings once."""

    def __init__(self, timeline: Timeline, ring: Callable[[], None]) -> None:
        self._timeline = timeline
        self._ring = ring
        self._alarm: Alarm | None = None

    @property
    def is_off(self) -> bool:
        """Whether it will not ring."""
        return self._alarm is None

    def set(self, when: float | None) -> None:
        """Ring at `when`; None: not at all."""
        self.destroy()
        if when is not None:
            self._alarm = self._timeline.call_at(when, self._rings)

    def destroy(self) -> None:
        """Ring no more."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None

    def _rings(self) -> None:
        self._alarm = None
        self._ring()
