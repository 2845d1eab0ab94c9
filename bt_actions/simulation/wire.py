"""An rclpy action server whose requests pass through other hands first.

What the middleware brings is shown to an `Interceptor`, which may keep it: to lose it, or to give
it back later. Goals are executed by whoever holds their handle: `execute()` only changes the state,
`finish` sends the result. Destroying the server while its executor spins is safe here; in rclpy it
is not (a request taken at that moment raises InvalidHandle in the executor, which ends its spin).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Coroutine, Iterator
from functools import partial
from typing import Any, Protocol

from action_msgs.msg import GoalInfo
from rclpy.action.server import ActionServer, GoalResponse, RCLError, ServerGoalHandle
from rclpy.exceptions import InvalidHandle
from rclpy.task import Future
from rclpy.waitable import NumberOfEntities

from bt_actions.utilities.plain_text import raised

Taken = tuple[Any, Any]
"""A request as rclpy takes it: its header, and the message."""


class Interceptor(Protocol):
    """Looks at each request before it is answered, and is told when it has been."""

    def on_request(self, kind: str, taken: Taken) -> bool:
        """Return whether to answer; `kind` is goal, cancel or result."""

    def on_answered(self, kind: str, taken: Taken) -> None:
        """The request has been answered."""


class InterceptedActionServer(ActionServer):  # type: ignore[misc]
    """See the head of this file."""

    def __init__(self, *args: Any, interceptor: Interceptor, **settings: Any) -> None:
        """Take what rclpy's ActionServer takes; executing is left to `finish`."""
        self._interceptor = interceptor
        self._gone = False
        super().__init__(*args, execute_callback=_nothing, **settings)

    # rclpy calls these four while it builds its wait set and takes data, from the spinning thread,
    # without expecting that the server may have been destroyed since the loop began.

    def get_num_entities(self) -> NumberOfEntities:
        with self._unless_gone():
            return super().get_num_entities()
        return NumberOfEntities(0, 0, 0, 0, 0)

    def add_to_wait_set(self, wait_set: Any) -> None:
        with self._unless_gone():
            super().add_to_wait_set(wait_set)

    def is_ready(self, wait_set: Any) -> bool:
        with self._unless_gone():
            return not self._gone and bool(super().is_ready(wait_set))
        return False

    def take_data(self) -> dict[str, Any]:
        with self._unless_gone():
            return {} if self._gone else dict(super().take_data())
        return {}

    async def execute(self, taken_data: dict[str, Any]) -> None:
        """Answer what was taken, each request on its own, unless the interceptor keeps it."""
        for kind, taken in taken_data.items():
            if kind == "expired":
                await self._guarded(super().execute({kind: taken}))
            elif self._shown(kind, taken):
                await self.answer(kind, taken)

    async def answer(self, kind: str, taken: Taken) -> None:
        """Answer a request now, also one that was kept earlier."""
        if self._gone:
            return
        await self._guarded(super().execute({kind: taken}))
        self._tell(kind, taken)

    def notify_execute(self, goal_handle: ServerGoalHandle, execute_callback: Any) -> None:
        """Run nothing: the goal is executed step by step, see `finish`."""

    def finish(self, goal_handle: ServerGoalHandle, result: Any) -> None:
        """Send `result` for a goal that has reached its terminal state."""
        self._soon(self._execute_goal, lambda handle: result, goal_handle)

    def later(self, kind: str, taken: Taken, *, silent: bool = False) -> None:
        """Have a request that was kept answered by the executor, as soon as it can.

        `silent` accepts a goal as rclpy does, but sends no answer.
        """
        self._soon(self._accept_silently if silent else self.answer, kind, taken)

    def _soon(self, work: Callable[..., Coroutine[Any, Any, None]], *arguments: Any) -> None:
        """Have the executor do work that waits for nothing, unless it is shut down before.

        Of a coroutine that it has and never begins Python would warn.
        """
        if not self._gone and (executor := self._node.executor) is not None:
            executor.create_task(partial(_to_its_end, work, *arguments))

    def handle_of(self, goal_id: str) -> ServerGoalHandle | None:
        """Return the handle of an accepted goal by its id in hex."""
        return self._goal_handles.get(bytes.fromhex(goal_id))

    def destroy(self) -> None:
        """Go, at once and without a word to the clients."""
        if self._gone:
            return
        self._gone = True
        super().destroy()

    def _send_result_response(self, request_header: Any, future: Any) -> None:
        try:
            super()._send_result_response(request_header, future)
        except Exception as error:  # noqa: BLE001 - rclpy calls this as a task: it would end spin()
            if not self._gone:
                self._logger.error(f"simulation: a result could not be sent: {raised(error)}")

    async def _execute_goal(self, execute_callback: Any, goal_handle: ServerGoalHandle) -> None:
        # The server may go, or the goal expire, between `finish` and this task of the executor.
        if not self._gone and bytes(goal_handle.goal_id.uuid) in self._result_futures:
            await self._guarded(super()._execute_goal(execute_callback, goal_handle))

    async def _accept_silently(self, kind: str, taken: Taken) -> None:
        if not self._gone:
            await self._guarded(self._accept_unanswered(taken[1]))
            self._tell(kind, taken)

    async def _accept_unanswered(self, request: Any) -> None:
        """Do what rclpy's _execute_goal_request does, without its answer."""
        info = GoalInfo()
        info.goal_id = request.goal_id
        with self._lock:
            if self._handle.goal_exists(info):
                return
        if self._goal_callback(request.goal) is not GoalResponse.ACCEPT:
            return
        info.stamp = self._node.get_clock().now().to_msg()
        with self._lock:
            handle = ServerGoalHandle(self, info, request.goal)
        key = bytes(request.goal_id.uuid)
        self._goal_handles[key] = handle
        self._result_futures[key] = Future()
        self.add_future(self._result_futures[key])
        self._handle.publish_status()
        self._handle_accepted_callback(handle)

    def _shown(self, kind: str, taken: Taken) -> bool:
        if self._gone:
            return False
        try:
            return self._interceptor.on_request(kind, taken)
        except Exception as error:  # noqa: BLE001 - it would end spin()
            self._logger.error(f"simulation: at a {kind} request: {raised(error)}")
            return True

    def _tell(self, kind: str, taken: Taken) -> None:
        if self._gone:
            return
        try:
            self._interceptor.on_answered(kind, taken)
        except Exception as error:  # noqa: BLE001 - it would end spin()
            self._logger.error(f"simulation: after a {kind} request: {raised(error)}")

    @contextlib.contextmanager
    def _unless_gone(self) -> Iterator[None]:
        try:
            yield
        except (InvalidHandle, RCLError):
            if not self._gone:
                raise

    async def _guarded(self, work: Any) -> None:
        try:
            await work
        except Exception as error:  # noqa: BLE001 - it would end spin()
            if not self._gone:
                self._logger.error(f"simulation: {raised(error)}")


def _to_its_end(work: Callable[..., Coroutine[Any, Any, None]], *arguments: Any) -> None:
    with contextlib.suppress(StopIteration):
        work(*arguments).send(None)


def _nothing(goal_handle: ServerGoalHandle) -> None:
    """Stand in where rclpy wants an execute callback; it is never called."""
