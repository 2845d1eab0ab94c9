"""The seam to the middleware: one action as one participant sees it, and its listener.

`ros/` implements these protocols with rclpy, `testing/` on a network in virtual time. Both sides of
the seam keep one contract (tests/traffic/test_transport.py). The caller holds the host's lock; only
the code that takes messages from the middleware runs without it.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol

from bt_actions.servers.presence import GID
from bt_actions.servers.reachability import Reachability

GOALS_KEPT = 20
"""Forgotten goal requests, the newest, of which a further acceptance is told all the same: a server
that wakes up has the last ten in its queue."""
Request = Literal["goal", "cancel", "result"]
"""The kinds of request about a goal: take it, cancel it, tell its result."""


def nobodys(probe: int) -> bytes:
    """Return the goal id that a probe asks for, which no goal has."""
    return b"bt_probe" + probe.to_bytes(8, "big")


def send_probe(transport: ActionTransport, number: int, now: float) -> None:
    """Ask for a goal that no server knows: each live server answers at once, with status 0."""
    transport.ask_result(nobodys(number))
    transport.reachability.asked(now)


class Listener(Protocol):
    """The receiver of the servers' words: under the host's lock, from whichever thread delivers."""

    def answer_came(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        """Take an answer to a request that was sent at `asked` (seconds, steady clock).

        `answers` are all answers to that request by now, the newest last: one of each server, and
        no answer says which server's it is. To a goal request: accepted or not, for forgotten
        goals, too. To a cancel request: a return code of action_msgs/srv/CancelGoal. To a question
        for the result: status and result; 0 and None mean that the server does not know the goal.
        """

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        """Take feedback, which may belong to any client's goal."""

    def statuses_came(self, statuses: dict[bytes, int]) -> None:
        """Take the status of each goal of the server."""

    def all_delivered(self) -> None:
        """Take note that every message taken so far has been delivered."""


class ActionTransport(Protocol):
    """One action as one participant sees it: requests out, answers to its listener.

    A request raises whatever the middleware raises where it cannot be sent.
    """

    closed: bool
    beside_another: bool
    """Whether the listener has another transport, and hears feedback by that one alone."""

    seen_since: float
    """The moment from which on its participant sees others (seconds, steady clock)."""

    reachability: Reachability
    """The knowledge whether a server hears these requests.

    The transport reports all answers to it, and each request that is answered at once; the sender
    of any other request reports that.
    """

    def send(self, goal_id: bytes, goal: Any) -> None:
        """Send the goal request."""

    def ask_result(self, goal_id: bytes) -> None:
        """Ask for the result, which the server answers when the goal has ended."""

    def cancel(self, goal_id: bytes) -> None:
        """Ask to cancel this goal, and no other."""

    def forget(self, goal_id: bytes) -> None:
        """Tell no more answers about a goal, but for acceptances of the newest `GOALS_KEPT`."""

    def deliver_arrived(self) -> None:
        """Deliver what has arrived, here and now."""

    @property
    def has_more(self) -> bool:
        """Whether a message has been taken, and not been delivered yet."""

    def servers(self) -> frozenset[GID]:
        """Return the servers that are shown to take goal requests.

        Raises where the participant is gone.
        """

    def count(self) -> int:
        """Return the number of `servers`, for a fraction of their time; raises as that does."""

    def ready(self) -> bool:
        """Return whether a server is shown with all of its parts; raises as `servers` does."""

    def close(self) -> None:
        """Close the transport; messages under way are lost, and a second call does nothing."""
