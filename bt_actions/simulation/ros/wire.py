"""The server side of an action on rclpy.

An action server that shows its requests to a handler first.

A `RequestHandler` may keep a request: to lose it, or to give it back later. rclpy's server keeps
the states of goals: `start` only changes the state, `finish` sends the result. Nothing is decided
here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from action_msgs.msg import GoalInfo
from rclpy.action.server import (
    CancelResponse,
    GoalEvent,
    GoalResponse,
    RCLError,
    ServerGoalHandle,
)
from rclpy.node import Node
from rclpy.task import Future

from bt_actions.goals.terms import STATUS_CANCELED, STATUS_SUCCEEDED
from bt_actions.ros.workarounds.action_server import ClosableActionServer
from bt_actions.simulation.platform import Request, RequestHandler


@dataclass(frozen=True, slots=True)
class Taken:
    """A request as rclpy takes it."""

    kind: Literal["goal", "cancel", "result"]
    header: Any
    message: Any

    @property
    def goal_id(self) -> str:
        about = self.message.goal_info if self.kind == "cancel" else self.message
        return _hex(about.goal_id)

    @property
    def goal(self) -> Any:
        return self.message.goal


class InterceptedActionServer(ClosableActionServer):
    """An action server with a handler in front."""

    def __init__(
        self, node: Node, action_type: Any, name: str, server: RequestHandler, **settings: Any
    ) -> None:
        """Serve on `node`; `settings` are those of rclpy's ActionServer."""
        self._server = server
        super().__init__(
            node,
            action_type,
            name,
            goal_callback=self._decided,
            handle_accepted_callback=self._accepted,
            cancel_callback=self._canceled,
            **settings,
        )

    async def execute(self, taken_data: Any) -> None:
        """Answer the taken requests, one by one, unless the handler keeps them."""
        for kind, taken in taken_data.items():
            if kind == "expired":
                await super().execute({kind: taken})
            else:
                await self.guarded(self._show, Taken(kind, *taken))

    # For the server

    def answer_soon(self, request: Request, *, silent: bool = False) -> None:
        self._soon(self._accept_silently if silent else self._answer, request)

    def knows(self, goal_id: str) -> bool:
        return bytes.fromhex(goal_id) in self._goal_handles

    def start(self, goal_id: str) -> None:
        self._handle_of(goal_id).execute()

    def feedback(self, goal_id: str, message: Any) -> None:
        self._handle_of(goal_id).publish_feedback(message)

    def end(self, goal_id: str, status: int) -> int:
        handle = self._handle_of(goal_id)
        with contextlib.suppress(RCLError):  # no way from its present status to this one
            if status == STATUS_SUCCEEDED:
                handle.succeed()
            elif status == STATUS_CANCELED:
                if not handle.is_cancel_requested:  # nobody has asked: the goal cancels by itself
                    handle._update_state(GoalEvent.CANCEL_GOAL)  # noqa: SLF001
                handle.canceled()
            else:
                handle.abort()
        return int(handle.status)

    def finish(self, goal_id: str, result: Any) -> None:
        self._soon(self._finish, goal_id, result)

    def _handle_of(self, goal_id: str) -> ServerGoalHandle:
        return self._goal_handles[bytes.fromhex(goal_id)]

    def _soon(self, work: Callable[..., Coroutine[Any, Any, None]], *arguments: Any) -> None:
        """Have the executor do work that waits for nothing, unless it is shut down before.

        Python would warn of a coroutine that the executor has and never begins.
        """
        if not self.gone and (executor := self._node.executor) is not None:
            executor.create_task(partial(_to_its_end, self.guarded, work, *arguments))

    async def _finish(self, goal_id: str, result: Any) -> None:
        # The server may go, or the goal expire, between `finish` and this task of the executor.
        handle = self._goal_handles.get(bytes.fromhex(goal_id))
        if not self.gone and handle is not None:
            await self._execute_goal(lambda handle: result, handle)

    async def _show(self, request: Taken) -> None:
        if not self.gone and self._server.on_request(request):
            await self._answer(request)

    async def _answer(self, request: Taken) -> None:
        await super().execute({request.kind: (request.header, request.message)})
        self._tell(request)

    async def _accept_silently(self, request: Taken) -> None:
        await self._accept_unanswered(request.message)
        self._tell(request)

    def _tell(self, request: Taken) -> None:
        if not self.gone:
            self._server.on_answered(request)

    async def _accept_unanswered(self, request: Any) -> None:
        """Do what rclpy's _execute_goal_request does, without its answer."""
        info = GoalInfo()
        info.goal_id = request.goal_id
        with self._lock:
            if self._handle.goal_exists(info):
                return
        if not self._server.decide(request.goal):
            return
        info.stamp = self._node.get_clock().now().to_msg()
        with self._lock:
            handle = ServerGoalHandle(self, info, request.goal)
        key = bytes(request.goal_id.uuid)
        self._goal_handles[key] = handle
        self._result_futures[key] = Future()
        self._handle.publish_status()
        self._accepted(handle)

    def _decided(self, goal: Any) -> GoalResponse:
        return GoalResponse.ACCEPT if self._server.decide(goal) else GoalResponse.REJECT

    def _accepted(self, handle: ServerGoalHandle) -> None:
        self._server.start(_hex(handle.goal_id), handle.request)

    def _canceled(self, handle: ServerGoalHandle) -> CancelResponse:
        granted = self._server.cancel(_hex(handle.goal_id))
        return CancelResponse.ACCEPT if granted else CancelResponse.REJECT


def _to_its_end(work: Callable[..., Coroutine[Any, Any, None]], *arguments: Any) -> None:
    with contextlib.suppress(StopIteration):
        work(*arguments).send(None)


def _hex(goal_id: Any) -> str:
    return bytes(goal_id.uuid).hex()
