"""What a tree is set up with in virtual time: the Backend of traffic/backend.py.

Topics and services are those of the network; nothing on it is ever undiscovered.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from bt_actions.messages.conversion import show
from bt_actions.messages.interfaces import short_name
from bt_actions.testing.host import VirtualHost
from bt_actions.testing.network import VirtualNetwork
from bt_actions.testing.transport import VirtualParticipant
from bt_actions.traffic.backend import ARRIVES
from bt_actions.traffic.handle import waker
from bt_actions.traffic.traffic import Traffic


class VirtualBackend:
    """The virtual network as one node sees it; give it to `setup` in a node's place."""

    def __init__(
        self, network: VirtualNetwork, *, seed: int = 0, host: VirtualHost | None = None
    ) -> None:
        """Goal ids, and the pauses before retries, depend on `seed` and the number on the network.

        `host` is that of another backend, where both stand for nodes of one process.
        """
        self.network = network
        seed += next(network.numbers) << 64  # what two make from one seed differs
        self.host = host or VirtualHost(network.timeline, network.log, seed)
        self.participant = VirtualParticipant(network, "tree", network.namespace)
        self.traffic = Traffic(self.host, self.participant)
        self.now = self.participant.now
        self.randomness = self.host.randomness

    def stamp(self) -> int:
        """This moment in nanoseconds."""
        return int(self.network.now() * 1e9)

    def service(self, service_type: type, name: str) -> VirtualService:
        """Become a client of a service."""
        return VirtualService(self.network, service_type, name)

    def subscription(
        self, message_type: type, topic: str, qos: str, take: Callable[[Any], None]
    ) -> VirtualSubscription:
        """Listen to a topic."""
        return VirtualSubscription(self.network, message_type, topic, qos, take)

    def publisher(self, message_type: type, topic: str, qos: str) -> VirtualSpeaker:
        """Become a publisher on a topic."""
        return VirtualSpeaker(self.network, message_type, topic, qos)

    def log(self, level: str, text: str) -> None:
        """Write a line of the tree's to the network's log."""
        self.network.log.add(level, text)


class _Connection:
    """What all have in common: whoever is there was discovered long ago."""

    def __init__(self, network: VirtualNetwork, name: str) -> None:
        self.name = network.expand(name)
        self._network = network

    def may_come(self) -> float:
        """Say that nobody may."""
        return 0.0

    def why_nobody(self) -> str:
        """Say nothing more."""
        return ""

    def close(self) -> None:
        """Have nothing to let go of."""


class VirtualService(_Connection):
    """A client of one service."""

    def __init__(self, network: VirtualNetwork, service_type: Any, name: str) -> None:
        super().__init__(network, name)
        self._type = service_type

    @property
    def ready(self) -> bool:
        """Whether the service is there."""
        return self._network.service(self._type, self.name) is not None

    def call(self, request: Any) -> Future[Any]:
        """Begin a call."""
        call, wake = Future[Any](), waker()
        if served := self._network.service(self._type, self.name):
            answer, takes = served

            def reply() -> None:
                response = self._response(answer(request))
                self._network.timeline.call_in(takes, lambda: self._network.soon(arrive, response))

            def arrive(response: Any) -> None:
                if not call.cancelled():
                    call.set_result(response)
                    wake()

            self._network.soon(reply)
        return call

    def _response(self, given: Any) -> Any:
        """Return what a service has answered. Raises TypeError for what rclpy would not send."""
        if isinstance(given, self._type.Response):
            return given
        wanted, was = short_name(self._type.Response), "None" if given is None else show(given)
        if isinstance(given, type):
            was = f"the class {short_name(given)}"
        raise TypeError(f"the service {self.name} has to return a {wanted}, and returned {was}")


class VirtualSubscription(_Connection):
    """One topic, listened to."""

    def __init__(
        self,
        network: VirtualNetwork,
        message_type: type,
        topic: str,
        qos: str,
        take: Callable[[Any], None],
    ) -> None:
        super().__init__(network, topic)
        self._topic = network.topic(topic)
        self._type = message_type
        self._made_at = network.now()
        self._mine = network.subscribe(message_type, topic, take)
        self._awaits_latched = qos == "latched" and isinstance(self._topic.latched, message_type)
        if self._awaits_latched:
            network.soon(self._topic.bring, self._mine, self._topic.latched)

    def may_come(self) -> float:
        """Seconds for which the first message of a publisher that is there may be on its way."""
        if not self._awaits_latched and self._type not in self._topic.publishers:
            return 0.0
        return max(0.0, self._made_at + ARRIVES - self._network.now())

    def close(self) -> None:
        """Unsubscribe."""
        if self._mine in self._topic.subscriptions:
            self._topic.subscriptions.remove(self._mine)


class VirtualSpeaker(_Connection):
    """One topic, spoken on by a leaf."""

    def __init__(self, network: VirtualNetwork, message_type: type, topic: str, qos: str) -> None:
        super().__init__(network, topic)
        self._latched = qos == "latched"
        self._topic = network.topic(topic)
        self._type = message_type
        self._last: Any = None
        self._topic.publishers.append(message_type)

    @property
    def listeners(self) -> int:
        """How many subscriptions there are."""
        return len(self._topic.subscriptions)

    def publish(self, message: Any) -> None:
        """Publish."""
        self._last = message
        self._network.publish(self.name, message, latched=self._latched)

    def close(self) -> None:
        """Publish no more; what was latched goes with its publisher."""
        self._topic.leave(self._type)
        if self._latched and self._topic.latched is self._last:
            self._topic.latched = None
