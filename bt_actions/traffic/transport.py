"""The seam to what carries messages: one action as one participant sees it, and who listens.

`ros/` implements these protocols with rclpy, `testing/` on a network in virtual time. Both sides of
the seam keep one contract (tests/traffic/test_transport.py). All of it is called under the host's
lock, but for what takes messages from the middleware.
"""

from __future__ import annotations

from typing import Any, Literal, Protocol

from bt_actions.servers.presence import GID
from bt_actions.servers.reachability import Reachability

GOALS_KEPT = 20
"""Goal requests, of those that are forgotten, of which a further acceptance is told all the same: a
server that wakes up has the last ten in its queue."""
Request = Literal["goal", "cancel", "result"]
"""What a server can be asked of a goal: to take it, to cancel it, and for its result."""


def nobodys(probe: int) -> bytes:
    """Return the goal id that a probe asks for, which no goal has."""
    return b"bt_probe" + probe.to_bytes(8, "big")


def send_probe(transport: ActionTransport, number: int, now: float) -> None:
    """Ask for a goal that nobody knows: each live server answers at once, with status 0."""
    transport.ask_result(nobodys(number))
    transport.reachability.asked(now)


class Listener(Protocol):
    """Who is told what the servers say: under the host's lock, from whichever thread delivers."""

    def answer_came(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        """A server answered a request that was sent at `asked` (seconds, steady clock).

        `answers` are all that it has had by now, the newest last: one of each server, and none says
        whose it is. To a goal request: accepted or not, told of forgotten goals, too. To a cancel
        request: a return code of action_msgs/srv/CancelGoal. To a question for the result: status
        and result; 0 and None mean that the server does not know the goal.
        """

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        """Feedback came, of a goal that may be anybody's."""

    def statuses_came(self, statuses: dict[bytes, int]) -> None:
        """The server published the status of its goals."""

    def all_delivered(self) -> None:
        """Nothing that has been taken waits any more."""


class ActionTransport(Protocol):
    """One action as one participant sees it: requests out, answers to its listener.

    A request raises whatever the middleware raises where it cannot be sent.
    """

    closed: bool
    beside_another: bool
    """The listener has another transport, and hears of feedback by that alone."""

    seen_since: float
    """Since when its participant sees others (seconds, steady clock)."""

    reachability: Reachability
    """What is known of whether a server hears these requests.

    It is told of all answers, and of each request that is answered at once (of others, by whoever
    asks)."""

    def send(self, goal_id: bytes, goal: Any) -> None:
        """Send the goal request."""

    def ask_result(self, goal_id: bytes) -> None:
        """Ask for the result, which the server answers when the goal has ended."""

    def cancel(self, goal_id: bytes) -> None:
        """Ask to cancel this goal, and no other."""

    def forget(self, goal_id: bytes) -> None:
        """Tell no more answers about a goal.

        But for further acceptances of the newest `GOALS_KEPT` goals.
        """

    def deliver_arrived(self) -> None:
        """Deliver what has arrived, here and now."""

    @property
    def has_more(self) -> bool:
        """Whether something has been taken, and not been delivered yet."""

    def servers(self) -> frozenset[GID]:
        """Return who is shown to take goal requests; raises where the participant is gone."""

    def count(self) -> int:
        """How many `servers` are shown, for a fraction of the time; raises as that does."""

    def ready(self) -> bool:
        """Whether a server is shown with all of its parts; raises as `servers` does."""

    def close(self) -> None:
        """Send and deliver nothing any more; what is still under way is lost. Twice: fine."""
