"""rclpy's action server, whose goals are admitted, carried out and ended elsewhere.

No callback here waits. rclpy looks again and again at what it awaits (and a multi-threaded executor
may forget to), so a goal is never awaited: it is marked as executing, and answered when it has
ended. Decides nothing.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Awaitable, Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action.server import (
    ActionServer,
    CancelResponse,
    GoalResponse,
    RCLError,
    ServerGoalHandle,
)

from bt_actions.ros.serving.endpoints import Endpoints

_SENT = 0.25
"""Seconds in which an executor that is spun sends a result, once that is set."""
_NUDGE = 0.01
"""Seconds between two tasks of an executor that is to send one."""
_GRANTED = 2.0
"""Seconds for the executor to say that a cancel is granted."""


class AcceptedGoal:
    """A goal whose client knows that it was accepted."""

    def __init__(self, handle: ServerGoalHandle, canceled: Callable[[], bool]) -> None:
        self.handle = handle
        self.id = bytes(handle.goal_id.uuid)
        self.canceled = canceled
        """Whether its client asked for its cancel before it was handed over."""

    def begin(self) -> None:
        """Mark it as executing, unless it is being canceled."""
        with contextlib.suppress(RCLError):  # a cancel comes at this moment
            if not self.handle.is_cancel_requested:
                self.handle.execute()

    def tell(self, feedback: Any) -> None:
        """Publish feedback."""
        self.handle.publish_feedback(feedback)


class DeferredActionServer(ActionServer):  # type: ignore[misc]
    """An action server that leaves it to others when a goal is executed and when it has ended.

    Args:
        admit: awaited with a goal request; what it returns is handed to `accepted`, or to `dropped`
            where the client could not be told. None rejects the goal.
        cancel: called with a goal's id; whether that is canceled now.
        keeps: seconds for which a result can be asked for.
    """

    def __init__(
        self,
        endpoints: Endpoints,
        action_type: type,
        name: str,
        *,
        admit: Callable[[Any], Awaitable[Any]],
        accepted: Callable[[AcceptedGoal, Any], None],
        dropped: Callable[[Any], None],
        cancel: Callable[[bytes], bool],
        keeps: int,
    ) -> None:
        self._admit, self._accepted, self._dropped = admit, accepted, dropped
        self._cancel = cancel
        self._admitted: dict[int, Any] = {}
        """What `admit` returned, until the request is over; by the request's id in Python, as rclpy
        tells of no other. None once it is handed over."""
        self._canceled_early: set[int] = set()
        self._told = threading.Condition()
        self._unset = 0
        """Goals that have ended, and whose result nobody has set yet."""
        super().__init__(
            endpoints.node,
            action_type,
            name,
            execute_callback=self.answer,  # never called: see notify_execute
            callback_group=endpoints.group,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
            result_timeout=keeps,
        )

    def notify_execute(
        self, goal_handle: ServerGoalHandle, execute_callback: Callable[..., Any]
    ) -> None:
        """Do nothing: `goal_handle.execute()` has marked the goal as executing, and that is all."""

    def answer(self, goal: AcceptedGoal, result: Any, status: int, *, after_cancel: bool) -> None:
        """End a goal with a status of GoalStatus, and answer its client; on any thread.

        `after_cancel`: its client has asked for that, which the executor is about to grant; a goal
        that it does not grant is aborted.
        """
        handle = goal.handle
        until = time.monotonic() + _GRANTED
        while after_cancel and not handle.is_cancel_requested and time.monotonic() < until:
            time.sleep(0.001)
        if handle.status == GoalStatus.STATUS_ACCEPTED:
            handle.execute()
        if status == GoalStatus.STATUS_SUCCEEDED:
            handle.succeed()
        elif status == GoalStatus.STATUS_CANCELED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        self._set_result(handle, result)

    def flush(self, patience: float) -> None:
        """Wait until all results are set, for so many seconds at most, and sent."""
        executor = self._node.executor
        with self._told:
            if executor is None or not self._told.wait_for(lambda: not self._unset, patience):
                return
        until = time.monotonic() + _SENT
        while time.monotonic() < until:
            done = threading.Event()
            executor.create_task(done.set)
            done.wait(_NUDGE)

    def _set_result(self, handle: ServerGoalHandle, result: Any) -> None:
        if (executor := self._node.executor) is None:  # nobody will spin it any more
            return
        with self._told:
            self._unset += 1

        async def finish() -> None:
            try:
                await self._execute_goal(lambda _: result, handle)  # waits for nothing
            finally:
                with self._told:
                    self._unset -= 1
                    self._told.notify_all()

        executor.create_task(finish)

    # Requests; on the executor's threads

    async def _execute_goal_request(self, request_header_and_message: Any) -> None:
        request = id(request_header_and_message[1].goal)
        try:
            await super()._execute_goal_request(request_header_and_message)
        finally:
            self._canceled_early.discard(request)
            if (admitted := self._admitted.pop(request, None)) is not None:
                self._dropped(admitted)  # its client has gone away; rclpy says nothing of that

    async def _on_goal(self, goal: Any) -> GoalResponse:
        admitted = await self._admit(goal)
        if admitted is None:
            return GoalResponse.REJECT
        self._admitted[id(goal)] = admitted
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        request = id(handle.request)
        admitted, self._admitted[request] = self._admitted[request], None
        self._accepted(AcceptedGoal(handle, lambda: request in self._canceled_early), admitted)

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        request = id(handle.request)
        if early := request in self._admitted:
            self._canceled_early.add(request)  # for who is just handed the goal
        canceled = self._cancel(bytes(handle.goal_id.uuid))
        return CancelResponse.ACCEPT if canceled or early else CancelResponse.REJECT
