"""The RunTree action on its node: rclpy's server, whose goals are carried out elsewhere.

No callback here waits, and none runs a tree. rclpy looks again and again at what it awaits (and a
multi-threaded executor may forget to), so a goal is never awaited: it is marked as executing, and
answered when it has ended.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.action.server import ActionServer, ServerGoalHandle
from rclpy.task import Future

__all__ = ["RunTreeServer", "off_the_executor"]

_ROUNDS = 5
"""Rounds of an executor in which a result is set, and then sent to all who wait for it."""
_NUDGE = 0.01
"""Seconds between two reminders of an executor that something awaited is there."""


class RunTreeServer(ActionServer):  # type: ignore[misc]
    """An action server that leaves it to others when a goal is executed and when it has ended."""

    request_is_over: Callable[[Any], None] = staticmethod(lambda goal: None)
    """Called when a goal request was answered, or could not be: its client may have gone away, and
    then rclpy drops the goal without a word."""

    def notify_execute(
        self, goal_handle: ServerGoalHandle, execute_callback: Callable[..., Any]
    ) -> None:
        """Do nothing: `goal_handle.execute()` has marked the goal as executing, and that is all."""

    def finish(self, goal_handle: ServerGoalHandle, result: Any) -> None:
        """Answer whoever asks for the result of a goal in its terminal state; on any thread."""
        if self._node.executor is not None:  # else nobody will spin it any more
            super().notify_execute(goal_handle, lambda _: result)

    def flush(self, patience: float) -> None:
        """Wait until the executor has done what it was given, for so many seconds at most."""
        executor, done = self._node.executor, threading.Event()

        def after(rounds: int) -> None:
            if rounds:
                executor.create_task(after, rounds - 1)
            else:
                done.set()

        if executor is not None:
            executor.create_task(after, _ROUNDS)
            done.wait(patience)

    async def _execute_goal_request(self, request_header_and_message: Any) -> None:
        try:
            await super()._execute_goal_request(request_header_and_message)
        finally:
            self.request_is_over(request_header_and_message[1].goal)


async def off_the_executor(
    executor: Any, submit: Callable[[Callable[[], None]], Any], work: Callable[[], Any]
) -> Any:
    """Await what `work` returns or raises; `submit` has it done on another thread."""
    future, taken = Future(executor=executor), threading.Event()

    def do() -> None:
        try:
            future.set_result(work())
        except Exception as error:  # noqa: BLE001 - raised again where it is awaited
            future.set_exception(error)
        # An executor that has just looked may wait for something else to happen now.
        while executor.context.ok() and not taken.wait(_NUDGE):
            executor.wake()

    submit(do)
    try:
        return await future
    finally:
        taken.set()
