"""What simulated servers stand on: an rclpy node, or the virtual network of `bt_actions.testing`.

Protocols alone. Goal ids are in hex; messages are Any, because rosidl gives them no common base.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol


class Request(Protocol):
    """What a client has sent to an action server."""

    @property
    def kind(self) -> Literal["goal", "cancel", "result"]:
        """Which of the three services was called."""

    @property
    def goal_id(self) -> str:
        """The goal it is about; zeros in a request to cancel mean all goals."""

    @property
    def goal(self) -> Any:
        """The goal message, of a request for a goal."""


class RequestHandler(Protocol):
    """What an action server decides; none of it raises."""

    def on_request(self, request: Request) -> bool:
        """Return whether to answer now; one that is kept may be given back to `Wire.answer_soon`.

        What is never answered is lost.
        """

    def on_answered(self, request: Request) -> None:
        """The request has been answered."""

    def decide(self, goal: Any) -> bool:
        """Return whether to accept a goal."""

    def start(self, goal_id: str, goal: Any) -> None:
        """A goal has been accepted, and its client told."""

    def cancel(self, goal_id: str) -> bool:
        """Return whether to cancel an accepted goal."""


class Wire(Protocol):
    """The server side of an action. It knows the state of each goal, and carries messages."""

    def answer_soon(self, request: Request, *, silent: bool = False) -> None:
        """Answer a request that was kept; `silent` accepts a goal without telling its client."""

    def knows(self, goal_id: str) -> bool:
        """Whether this goal was accepted and is not forgotten yet."""

    def start(self, goal_id: str) -> None:
        """Set an accepted goal to EXECUTING."""

    def feedback(self, goal_id: str, message: Any) -> None:
        """Publish feedback."""

    def end(self, goal_id: str, status: int) -> int:
        """Set a goal to a terminal status; return that which it has now: it may have had one."""

    def finish(self, goal_id: str, result: Any) -> None:
        """Send the result of a goal that has ended to all who ask for it."""

    def destroy(self) -> None:
        """Go, at once and without a word to the clients."""


class Publisher(Protocol):
    """Publishes on one topic."""

    def publish(self, message: Any) -> None:
        """Publish a message; where it has a header, its stamp is set."""

    def destroy(self) -> None:
        """Publish no more."""


class Timer(Protocol):
    """Rings once, when its time has come."""

    def set(self, when: float | None) -> None:
        """Ring at `when` in place of any earlier setting; None: not at all."""

    def destroy(self) -> None:
        """Ring no more."""


class SimulationLog(Protocol):
    """Where servers say what goes wrong."""

    def info(self, text: str) -> None:
        """Say what is as it should be."""

    def warning(self, text: str) -> None:
        """Say what a client did wrong."""

    def error(self, text: str) -> None:
        """Say what went wrong here."""


class Platform(Protocol):
    """What simulated servers stand on."""

    @property
    def log(self) -> SimulationLog:
        """Its log."""

    def now(self) -> float:
        """Return the seconds of a steady clock."""

    def timer(self, ring: Callable[[], None]) -> Timer:
        """Make a timer, which is off."""

    def expand(self, name: str) -> str:
        """Return the full name of a topic or an action."""

    def serve(
        self, action_type: Any, name: str, server: RequestHandler, result_timeout: float
    ) -> Wire:
        """Serve an action; a goal that has ended is forgotten after `result_timeout` seconds."""

    def publisher(self, message_type: Any, topic: str) -> Publisher:
        """Make a publisher."""
