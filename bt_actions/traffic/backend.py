"""The surroundings of a leaf or a run, as protocols; `setup(node=...)` finds the objects.

This is the third part of the seam, beside transport.py and host.py, for the rooms above traffic/:
behaviours/ and running/. No file of traffic/ uses this part. ros/node_participant.py implements
these protocols over rclpy, for one node; testing/backend.py needs no node. This file does not
import ROS.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from bt_actions.goals.terms import Now

if TYPE_CHECKING:
    from bt_actions.traffic.traffic import Traffic

LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}
"""The levels of a log line, with Python's numbers for them."""

ARRIVES = 1.0
"""Seconds in which a message arrives: a first message, once the publisher is in sight, and a last
message, before the process ends."""


class Call(Protocol):
    """A call of a service, in the form of a future."""

    def done(self) -> bool:
        """Return whether the answer is here."""

    def result(self) -> Any:
        """Return the answer of a call that is done."""

    def cancel(self) -> object:
        """Give up the call: its answer is dropped."""


class Connection(Protocol):
    """Our end of a topic or a service."""

    name: str
    """The topic's or the service's full name."""

    def why_nobody(self) -> str:
        """Say, behind a colon, why nobody is at the other end.

        Return "" where nothing explains that.
        """

    def close(self) -> None:
        """Close the connection; a publisher waits, a second at most, for its messages to arrive."""


class Service(Connection, Protocol):
    """A client of one service."""

    @property
    def ready(self) -> bool:
        """Whether the service is there."""

    def call(self, request: Any) -> Call:
        """Begin a call; the answer wakes the run of the caller."""


class Subscription(Connection, Protocol):
    """One topic, with a reader here."""

    def may_come(self) -> float:
        """Return the seconds in which a first message may still be on its way; 0 afterwards."""


class Publisher(Connection, Protocol):
    """One topic, with a writer here."""

    @property
    def listeners(self) -> int:
        """The number of subscriptions that get each message."""

    def may_come(self) -> float:
        """Return the seconds in which a listener may still be undiscovered; 0 afterwards."""

    def publish(self, message: Any) -> None:
        """Publish a message, and return at once."""


@runtime_checkable
class Backend(Protocol):
    """The world as one node sees it. Relative names are in the node's namespace."""

    traffic: Traffic
    """The goals of this node."""

    randomness: random.Random
    """The source of variation for the pauses before retries."""

    def now(self) -> Now:
        """Return this moment, by the steady clock and by the node's own."""

    def stamp(self) -> int:
        """Return the node's own clock in nanoseconds, as the headers of messages have it."""

    def service(self, service_type: type, name: str) -> Service:
        """Open a client of a service.

        Raises TwoTypes where the name is in use here with another type; so do the next two.
        """

    def subscription(
        self, message_type: type, topic: str, qos: str, take: Callable[[Any], None]
    ) -> Subscription:
        """Open a subscription; `take` gets each message, on any thread, and only stores it.

        `qos` is a name of the tree language.
        """

    def publisher(self, message_type: type, topic: str, qos: str) -> Publisher:
        """Open a publisher."""

    def log(self, level: str, text: str) -> None:
        """Write a line of the tree to the log; `level` is one of `LEVELS`."""
