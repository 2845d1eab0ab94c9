"""rclpy's action server, whose goals are admitted, carried out and ended elsewhere.

No callback here waits. rclpy polls what a callback awaits (and a multi-threaded executor may forget
to), so no goal is awaited: it is marked as executing, and answered at its end. Decides nothing.
"""

from __future__ import annotations

import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action.server import CancelResponse, GoalResponse, RCLError, ServerGoalHandle

from bt_actions.ros.naming import warn_of_remapping
from bt_actions.ros.serving.endpoints import Endpoints
from bt_actions.ros.workarounds.action_server import ClosableActionServer


class DeferredActionServer(ClosableActionServer):
    """An action server that leaves it to others when a goal is executed and when it has ended.

    Args:
        admit: awaited with a goal request; its return value goes to `accepted`. None rejects the
            goal.
        accepted: called with the goal once its client knows of the acceptance.
        dropped: called with the goal's id where the client could not be told of that.
        cancel: called with a goal once its client has been granted the cancel, and again as long as
            that is under way; it may come before `accepted` and `dropped`.
        yields: returns whether another server of this name answers: this one then answers for its
            own goals only, as a client takes the first answer.
        keeps: seconds for which a result can be asked for.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        action_type: type,
        name: str,
        *,
        admit: Callable[[Any], Awaitable[Any]],
        accepted: Callable[[ServerGoalHandle, Any], None],
        dropped: Callable[[bytes], None],
        cancel: Callable[[ServerGoalHandle], None],
        yields: Callable[[], bool],
        keeps: int,
    ) -> None:
        self._yields = yields
        self._admit, self._accepted, self._dropped = admit, accepted, dropped
        self._cancel = cancel
        self._admitted: dict[int, Any] = {}
        """The return values of `admit` that wait for `accepted`; by the request's id in Python, as
        rclpy tells of no other.
        """
        warn_of_remapping(endpoints.node, name)
        super().__init__(
            endpoints.node,
            action_type,
            name,
            callback_group=endpoints.group,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
            result_timeout=keeps,
        )

    def begin(self, goal: ServerGoalHandle) -> None:
        """Mark a goal as executing, unless it is being canceled."""
        with contextlib.suppress(RCLError):  # a cancel comes at this moment
            goal.execute()

    def answer(self, goal: ServerGoalHandle, result: Any, status: int) -> None:
        """End a goal with a status of GoalStatus, and answer its client; on any thread.

        A goal that would end as CANCELED without its client's request is aborted.
        """
        if goal.status == GoalStatus.STATUS_ACCEPTED:
            goal.execute()
        if status == GoalStatus.STATUS_SUCCEEDED:
            goal.succeed()
        elif status == GoalStatus.STATUS_CANCELED and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        response = self.action_type.Impl.GetResultService.Response(
            status=goal.status, result=result
        )
        self._result_futures[bytes(goal.goal_id.uuid)].set_result(response)

    # Requests; on the executor's threads

    async def execute(self, taken_data: dict[str, Any]) -> None:
        """Handle taken requests as rclpy does, unless another server is to answer."""
        if taken_data and self._yields():
            taken_data = {
                what: taken for what, taken in taken_data.items() if self._is_own(what, taken)
            }
        await super().execute(taken_data)

    def _is_own(self, what: str, taken: Any) -> bool:
        if what == "expired":
            return True
        request = taken[1]
        goal = request.goal_info if what == "cancel" else request
        goal_id = bytes(goal.goal_id.uuid)
        own = self._goal_handles.keys() | ({bytes(16)} if self._goal_handles else set())
        return what != "goal" and goal_id in own  # zeros: whoever cancels all, cancels ours

    async def _execute_goal_request(self, request_header_and_message: Any) -> None:
        try:
            await super()._execute_goal_request(request_header_and_message)
        finally:
            request = request_header_and_message[1]
            if self._admitted.pop(id(request.goal), None) is not None:
                # Its client has gone away; rclpy says nothing of that
                self._dropped(bytes(request.goal_id.uuid))

    async def _on_goal(self, goal: Any) -> GoalResponse:
        admitted = await self._admit(goal)
        if admitted is None:
            return GoalResponse.REJECT
        self._admitted[id(goal)] = admitted
        return GoalResponse.ACCEPT

    def _on_accepted(self, goal: ServerGoalHandle) -> None:
        self._accepted(goal, self._admitted.pop(id(goal.request)))

    async def _execute_cancel_request(self, request_header_and_message: Any) -> None:
        await super()._execute_cancel_request(request_header_and_message)
        for goal in list(self._goal_handles.values()):
            if goal.is_cancel_requested:  # now it can end so
                self._cancel(goal)
