"""Goal requests on their way to a decision: counted, struck by faults, written down. No ROS.

A request is known by its message until rclpy asks for the decision, because rclpy tells no more
then, and by its goal's id from the decision to the start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bt_actions.simulation.fault_plan import GoalFaults
from bt_actions.simulation.faults import FaultKind
from bt_actions.simulation.journal import Event
from bt_actions.utilities.plain_text import raised


@dataclass(frozen=True, slots=True)
class GoalRequest:
    """A request for a goal."""

    goal_id: str
    number: int
    faults: GoalFaults

    @property
    def is_lost(self) -> bool:
        """Whether no goal follows: the request kills the server, or is never decided."""
        return self.faults.dies("accept") or FaultKind.DROP_GOAL in self.faults


class Intake:
    """The intake of one server, which counts its goals and decides on them."""

    def __init__(
        self,
        server: str,
        strike: Callable[[Any, int], GoalFaults],
        *,
        record: Callable[..., None],
        warn: Callable[[str], None],
    ) -> None:
        """Make an intake; `strike` returns the faults of a goal, `record` and `warn` write lines.

        `record` writes into the journal, `warn` into the log.
        """
        self.count = 0
        self._server = server
        self._strike = strike
        self._record = record
        self._warn = warn
        self._undecided: dict[int, GoalRequest] = {}
        self._accepted: dict[str, GoalRequest] = {}

    def receive(self, goal: object, goal_id: str) -> GoalRequest:
        """Take in a request for `goal`, whose message lives until the decision."""
        self.count += 1
        faults = self._strike(goal, self.count)
        request = GoalRequest(goal_id, self.count, faults)
        more = {"faults": str(faults)} if faults else {}
        self._record(goal_id, Event.RECEIVED, number=request.number, **more)
        if not request.is_lost:
            self._undecided[id(goal)] = request
        return request

    def decide(self, goal: Any, refusal: Callable[[Any], str | None]) -> bool:
        """Return whether `goal` is accepted."""
        request = self._undecided.pop(id(goal), None)
        if request is None:
            return False
        if FaultKind.REJECT in request.faults:
            reason: str | None = "fault: reject"
        else:
            try:
                reason = refusal(goal)
            except Exception as error:  # noqa: BLE001 - an error would end the executor's spin
                reason = f"it could not be checked: {raised(error)}"
        if reason:
            self._reject(request, reason)
            return False
        self._accepted[request.goal_id] = request
        return True

    def close_request(self, goal: object, goal_id: str) -> bool:
        """Close an answered request; return whether its goal was accepted, and not started."""
        request = self._undecided.pop(id(goal), None)
        if request is not None:
            self._reject(request, "its id is already in use")
        return goal_id in self._accepted

    def start(self, goal_id: str) -> GoalRequest | None:
        """Return the request of an accepted goal, once."""
        request = self._accepted.pop(goal_id, None)
        if request is not None:
            self._record(goal_id, Event.ACCEPTED, number=request.number)
        return request

    def clear(self) -> None:
        """Forget all requests; the count goes on."""
        self._undecided.clear()
        self._accepted.clear()

    def _reject(self, request: GoalRequest, reason: str) -> None:
        self._warn(f"{self._server}: goal {request.number} refused: {reason}")
        self._record(request.goal_id, Event.REJECTED, reason=reason)
