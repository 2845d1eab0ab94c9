"""What `setup(node=...)` resolves to: all that a leaf, or a run, asks of the world, as protocols.

The third part of the seam, beside transport.py and host.py, for what is above traffic/: behaviours/
and running/ use it, and nothing in traffic/. ros/node_participant.py keeps these protocols over
rclpy, for one node; testing/backend.py without a node. Nothing of ROS is imported here.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from bt_actions.goals.terms import Now

if TYPE_CHECKING:
    from bt_actions.traffic.traffic import Traffic

LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}
"""What lines of a log may be called, and Python's numbers for it."""

ARRIVES = 1.0
"""Seconds that a message is given to arrive: the first one, once its publisher is in sight, and
what we have published, before the process ends."""


class Call(Protocol):
    """A call of a service, as futures are."""

    def done(self) -> bool:
        """Whether the answer is here."""

    def result(self) -> Any:
        """The answer of a call that is done."""

    def cancel(self) -> object:
        """Take no interest in an answer any more."""


class Connection(Protocol):
    """Our end of a topic or a service."""

    name: str
    """The topic's or the service's full name."""

    def why_nobody(self) -> str:
        """What explains that nobody is at the other end, behind a colon; or an empty text."""

    def close(self) -> None:
        """Let go of it; where we publish, once all have it, or a second after the last message."""


class Service(Connection, Protocol):
    """A client of one service."""

    @property
    def ready(self) -> bool:
        """Whether the service is there."""

    def call(self, request: Any) -> Call:
        """Begin a call, which wakes who has called when it is done."""


class Subscription(Connection, Protocol):
    """One topic, listened to."""

    def may_come(self) -> float:
        """Seconds for which a first message may be on its way; 0 afterwards."""


class Publisher(Connection, Protocol):
    """One topic, spoken on."""

    @property
    def listeners(self) -> int:
        """How many subscriptions get what is published."""

    def may_come(self) -> float:
        """Seconds for which a listener may be there that is not discovered yet; 0 afterwards."""

    def publish(self, message: Any) -> None:
        """Publish; returns at once."""


@runtime_checkable
class Backend(Protocol):
    """The world as one node sees it. Relative names are in the node's namespace."""

    traffic: Traffic
    """The goals of this node."""

    randomness: random.Random
    """What varies the pauses before retries."""

    def now(self) -> Now:
        """This moment, by the steady clock and by the node's own."""

    def stamp(self) -> int:
        """The node's own clock in nanoseconds, as the headers of messages have it."""

    def service(self, service_type: type, name: str) -> Service:
        """Become a client of a service. Raises TwoTypes, as the next two do."""

    def subscription(
        self, message_type: type, topic: str, qos: str, take: Callable[[Any], None]
    ) -> Subscription:
        """Listen; `take` is called with each message, on any thread, and only takes note of it.

        `qos` is as the tree language calls it.
        """

    def publisher(self, message_type: type, topic: str, qos: str) -> Publisher:
        """Become a publisher."""

    def log(self, level: str, text: str) -> None:
        """Write a line of the tree's; `level` is one of `LEVELS`."""
