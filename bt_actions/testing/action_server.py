"""The server side of an action on the virtual network: the states of its goals, as rcl has them.

This is the Wire of simulation/platform.py. It carries messages; the server behind it decides the
course of a goal.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from bt_actions.goals.terms import (
    CANCEL_ACCEPTED,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN_GOAL,
    STATUS_EXECUTING,
    STATUS_SUCCEEDED,
)
from bt_actions.messages.interfaces import short_name
from bt_actions.simulation.platform import Request, RequestHandler
from bt_actions.testing.medium import Medium, VirtualRequest

ACCEPTED, CANCELING = 1, 3
"""States of action_msgs/msg/GoalStatus."""


@dataclass(slots=True)
class _Goal:
    status: int = ACCEPTED
    result: Any = None
    asked: list[VirtualRequest] = field(default_factory=list)
    """Requests for a result that is not there yet."""


class VirtualActionServer:
    """One action server, from its opening until it is destroyed."""

    def __init__(
        self,
        medium: Medium,
        name: str,
        action_type: Any,
        server: RequestHandler,
        result_timeout: float,
    ) -> None:
        self.gid = medium.new_gid()
        self.name = name
        self.action_type = action_type
        self._medium = medium
        self._server = server
        self._result_timeout = result_timeout
        self._goals: dict[str, _Goal] = {}
        self._gone = False
        medium.add_server(self)

    def receive(self, request: VirtualRequest) -> None:
        if not self._gone and self._server.on_request(request):
            self._answer(request)

    @property
    def statuses(self) -> dict[bytes, int]:
        return {bytes.fromhex(goal_id): goal.status for goal_id, goal in self._goals.items()}

    # For the server

    def answer_soon(self, request: Request, *, silent: bool = False) -> None:
        self._medium.timeline.call_in(0.0, lambda: self._answer(request, silent=silent))

    def knows(self, goal_id: str) -> bool:
        return goal_id in self._goals

    def start(self, goal_id: str) -> None:
        self._set(goal_id, STATUS_EXECUTING)

    def feedback(self, goal_id: str, message: Any) -> None:
        if not isinstance(message, self.action_type.Feedback):
            raise TypeError(f"{message!r} is no {short_name(self.action_type.Feedback)}")
        self._medium.publish_feedback(self, bytes.fromhex(goal_id), message)

    def end(self, goal_id: str, status: int) -> int:
        if self._goals[goal_id].status < STATUS_SUCCEEDED:
            self._set(goal_id, status)
        return self._goals[goal_id].status

    def finish(self, goal_id: str, result: Any) -> None:
        goal = self._goals[goal_id]
        goal.result = result
        for request in goal.asked:
            request.reply((goal.status, result))
        goal.asked.clear()
        self._medium.timeline.call_in(self._result_timeout, lambda: self._forget(goal_id))

    def destroy(self) -> None:
        self._gone = True
        self._goals.clear()
        self._medium.remove_server(self)

    def _forget(self, goal_id: str) -> None:
        self._goals.pop(goal_id, None)

    def _set(self, goal_id: str, status: int) -> None:
        self._goals[goal_id].status = status
        self._medium.publish_status(self)

    def _answer(self, request: Any, *, silent: bool = False) -> None:
        if self._gone:
            return
        if request.kind == "goal":
            self._decide(request, silent=silent)
        elif request.kind == "cancel":
            request.reply(self._cancel(request.goal_id))
        else:
            self._result(request)
        if not self._gone:
            self._server.on_answered(request)

    def _decide(self, request: VirtualRequest, *, silent: bool) -> None:
        goal_id = request.goal_id
        accepted = goal_id not in self._goals and self._server.decide(request.goal)
        if not silent:
            request.reply(accepted)
        if accepted:
            self._goals[goal_id] = _Goal()
            self._medium.publish_status(self)
            self._server.start(goal_id, request.goal)

    def _cancel(self, goal_id: str) -> int:
        goal = self._goals.get(goal_id)
        if goal is None:
            return CANCEL_UNKNOWN_GOAL
        if goal.status >= STATUS_SUCCEEDED:
            return CANCEL_TERMINATED
        if not self._server.cancel(goal_id):
            return CANCEL_REJECTED
        self._set(goal_id, CANCELING)
        return CANCEL_ACCEPTED

    def _result(self, request: VirtualRequest) -> None:
        goal = self._goals.get(request.goal_id)
        if goal is None:
            request.reply((0, None))
        elif goal.result is None:
            goal.asked.append(request)
        else:
            request.reply((goal.status, goal.result))
