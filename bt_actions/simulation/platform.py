"""The platform of simulated servers: an rclpy node, or the virtual network of `bt_actions.testing`.

Protocols alone. Goal ids are in hex; messages are Any, because rosidl gives them no common base.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol


class Request(Protocol):
    """A request of a client to an action server."""

    @property
    def kind(self) -> Literal["goal", "cancel", "result"]:
        """The called service, of three."""

    @property
    def goal_id(self) -> str:
        """The goal in question; zeros in a request to cancel mean all goals."""

    @property
    def goal(self) -> Any:
        """The goal message of a goal request."""


class RequestHandler(Protocol):
    """The decisions of an action server; no method raises."""

    def on_request(self, request: Request) -> bool:
        """Return whether to answer now.

        A kept request may be given to `Wire.answer_soon`, or is lost.
        """

    def on_answered(self, request: Request) -> None:
        """Take note that the request has been answered."""

    def decide(self, goal: Any) -> bool:
        """Return whether to accept a goal."""

    def start(self, goal_id: str, goal: Any) -> None:
        """Start an accepted goal, whose client has been told."""

    def cancel(self, goal_id: str) -> bool:
        """Return whether to cancel an accepted goal."""


class Wire(Protocol):
    """The server side of an action, with the state of each goal, for messages both ways."""

    def answer_soon(self, request: Request, *, silent: bool = False) -> None:
        """Answer a kept request; `silent` accepts a goal without telling its client."""

    def knows(self, goal_id: str) -> bool:
        """Return whether this goal was accepted and is not forgotten yet."""

    def start(self, goal_id: str) -> None:
        """Set an accepted goal to EXECUTING."""

    def feedback(self, goal_id: str, message: Any) -> None:
        """Publish feedback."""

    def end(self, goal_id: str, status: int) -> int:
        """Set a goal to a terminal status.

        Return its status, which may be an earlier terminal one.
        """

    def finish(self, goal_id: str, result: Any) -> None:
        """Send the result of an ended goal to all clients that ask for it."""

    def destroy(self) -> None:
        """Go away, at once and without a word to the clients."""


class Publisher(Protocol):
    """A publisher on one topic."""

    def publish(self, message: Any) -> None:
        """Publish a message, and set the stamp of its header, if it has one."""

    def destroy(self) -> None:
        """Publish no more."""


class Timer(Protocol):
    """A timer that rings once, when its time has come."""

    def set(self, when: float | None) -> None:
        """Ring at `when` in place of any earlier setting; None: not at all."""

    def destroy(self) -> None:
        """Ring no more."""


class SimulationLog(Protocol):
    """The log of the servers."""

    def info(self, text: str) -> None:
        """Log good news."""

    def warning(self, text: str) -> None:
        """Log a fault of a client."""

    def error(self, text: str) -> None:
        """Log a fault of the simulation."""


class Platform(Protocol):
    """The platform of simulated servers."""

    @property
    def log(self) -> SimulationLog:
        """The log of the platform."""

    def now(self) -> float:
        """Return the seconds of a steady clock."""

    def timer(self, ring: Callable[[], None]) -> Timer:
        """Make a timer, which is off."""

    def expand(self, name: str) -> str:
        """Return the full name of a topic or an action."""

    def serve(
        self, action_type: Any, name: str, server: RequestHandler, result_timeout: float
    ) -> Wire:
        """Serve an action; an ended goal is forgotten after `result_timeout` seconds."""

    def publisher(self, message_type: Any, topic: str) -> Publisher:
        """Make a publisher."""
