"""The Backend of traffic/backend.py in virtual time, for the setup of a tree.

Topics and services are those of the network; nothing there is ever undiscovered.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from bt_actions.messages.interfaces import interface_name, short_name
from bt_actions.testing.host import VirtualHost
from bt_actions.testing.network import VirtualNetwork, VirtualPublisher, told
from bt_actions.testing.transport import VirtualParticipant
from bt_actions.traffic.backend import ARRIVES
from bt_actions.traffic.state import waker
from bt_actions.traffic.traffic import Traffic
from bt_actions.utilities.suggest import elsewhere, listing


class VirtualBackend:
    """The virtual network as one node sees it; give it to `setup` in a node's place."""

    def __init__(
        self, network: VirtualNetwork, *, seed: int = 0, host: VirtualHost | None = None
    ) -> None:
        """Make a backend; goal ids and pauses depend on `seed` and the number on the network.

        `host` is that of another backend, where both stand for nodes of one process.
        """
        self.network = network
        seed += next(network.numbers) << 64  # two backends of one seed differ
        self.host = host or VirtualHost(network.timeline, network.log, seed)
        self.participant = VirtualParticipant(network, "tree", network.namespace)
        self.traffic = Traffic(self.host, self.participant)
        self.now = self.participant.now
        self.randomness = self.host.randomness

    def stamp(self) -> int:
        """Return this moment in nanoseconds."""
        return int(self.network.now() * 1e9)

    def service(self, service_type: type, name: str) -> VirtualService:
        return VirtualService(self.network, service_type, name)

    def subscription(
        self, message_type: type, topic: str, qos: str, take: Callable[[Any], None]
    ) -> VirtualSubscription:
        return VirtualSubscription(self.network, message_type, topic, qos, take)

    def publisher(self, message_type: type, topic: str, qos: str) -> VirtualSpeaker:
        return VirtualSpeaker(self.network, message_type, topic, qos)

    def log(self, level: str, text: str) -> None:
        self.network.log.add(level, text)


class _Connection:
    """The common part of connections, whose other ends are discovered from the beginning."""

    _theirs = "what is there"
    _nobody = ": nobody offers it"

    def __init__(self, network: VirtualNetwork, its_type: type, name: str) -> None:
        self.name = network.expand(name)
        self._network = network
        self._type = its_type

    def may_come(self) -> float:
        """Return 0: nobody else may come."""
        return 0.0

    def why_nobody(self) -> str:
        """Say what is there instead, as ros/connections.py does."""
        kind, there = interface_name(self._type), self._there()
        known = {name: sorted(map(interface_name, types)) for name, types in there.items() if types}
        types = known.get(self.name, [])
        if kind in types:
            return ""
        if types:
            return f": {self._theirs} is {listing(types)}, not {kind}"
        return self._nobody + elsewhere(self.name, kind, known)

    def _there(self) -> dict[str, set[type]]:
        """Return the types at the possible other ends, by full name."""
        raise NotImplementedError


class VirtualService(_Connection):
    """A client of one service."""

    @property
    def ready(self) -> bool:
        return self._network.service(self._type, self.name) is not None

    def call(self, request: Any) -> Future[Any]:
        """Begin a call. Its answer raises TypeError where the service returns no response."""
        call, wake = Future[Any](), waker()
        if served := self._network.service(self._type, self.name):
            answer, takes = served

            def reply() -> None:
                response = answer(request)
                expected: Any = self._type
                if not isinstance(response, expected.Response):
                    raise TypeError(
                        f"the service {self.name} was answered with {told(response)}: what plays "
                        f"it has to return an instance of {short_name(expected.Response)}"
                    )
                response = copy.deepcopy(response)  # the service may change it for the next answer
                self._network.timeline.call_in(takes, lambda: self._network.soon(arrive, response))

            def arrive(response: Any) -> None:
                if not call.cancelled():
                    call.set_result(response)
                    wake()

            self._network.soon(reply)
        return call

    def close(self) -> None:
        """Do nothing: a client holds nothing."""

    def _there(self) -> dict[str, set[type]]:
        return {name: {its_type} for name, (its_type, *_) in self._network.services.items()}


class VirtualSubscription(_Connection):
    """One topic, with a reader here."""

    _theirs = "what is published there"
    _nobody = ": nobody publishes on it"

    def __init__(
        self,
        network: VirtualNetwork,
        message_type: type,
        topic: str,
        qos: str,
        take: Callable[[Any], None],
    ) -> None:
        super().__init__(network, message_type, topic)
        self._topic = network.topic(topic)
        self._given_until = network.now() + ARRIVES
        self._mine = network.subscribe(message_type, topic, take, latched=qos == "latched")

    def may_come(self) -> float:
        left = self._given_until - self._network.now()
        return max(0.0, left) if self._type in self._topic.published else 0.0

    def close(self) -> None:
        if self._mine in self._topic.subscriptions:
            self._topic.subscriptions.remove(self._mine)

    def _there(self) -> dict[str, set[type]]:
        return {name: topic.published for name, topic in self._network.topics.items()}


class VirtualSpeaker(_Connection):
    """One topic, with a leaf as its writer."""

    _theirs = "what is asked for there"
    _nobody = ""

    def __init__(self, network: VirtualNetwork, message_type: type, topic: str, qos: str) -> None:
        super().__init__(network, message_type, topic)
        latched = qos == "latched"
        self._publisher = VirtualPublisher(network, message_type, topic, latched=latched)
        self.publish = self._publisher.publish
        self.close = self._publisher.destroy

    @property
    def listeners(self) -> int:
        return self._publisher.listeners

    def _there(self) -> dict[str, set[type]]:
        return {name: topic.listened for name, topic in self._network.topics.items()}
