"""The RunTree action on its node: rclpy's server, whose goals are carried out elsewhere.

No callback here waits, and none runs a tree. rclpy looks again and again at what it awaits (and a
multi-threaded executor may forget to), so a goal is never awaited: it is marked as executing, and
answered when it has ended.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.action.server import ActionServer, ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future

__all__ = ["OffTheExecutor", "RunTreeServer"]

_SENT = 0.25
"""Seconds in which an executor that is spun sends a result, once that is set."""
_NUDGE = 0.01
"""Seconds between two reminders of an executor that something awaited is there."""
_SPUN = 10.0
"""Seconds after which nobody spins it any more."""


class RunTreeServer(ActionServer):  # type: ignore[misc]
    """An action server that leaves it to others when a goal is executed and when it has ended."""

    request_is_over: Callable[[Any], None] = staticmethod(lambda goal: None)
    """Called when a goal request was answered, or could not be: its client may have gone away, and
    then rclpy drops the goal without a word."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self._told = threading.Condition()
        self._unset = 0
        """Goals that have ended, and whose result nobody has set yet."""
        super().__init__(*arguments, **options)

    def notify_execute(
        self, goal_handle: ServerGoalHandle, execute_callback: Callable[..., Any]
    ) -> None:
        """Do nothing: `goal_handle.execute()` has marked the goal as executing, and that is all."""

    def finish(self, goal_handle: ServerGoalHandle, result: Any) -> None:
        """Answer whoever asks for the result of a goal in its terminal state; on any thread."""
        if (executor := self._node.executor) is None:  # nobody will spin it any more
            return
        with self._told:
            self._unset += 1

        async def finish() -> None:
            try:
                await self._execute_goal(lambda _: result, goal_handle)  # waits for nothing
            finally:
                with self._told:
                    self._unset -= 1
                    self._told.notify_all()

        executor.create_task(finish)

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

    async def _execute_goal_request(self, request_header_and_message: Any) -> None:
        try:
            await super()._execute_goal_request(request_header_and_message)
        finally:
            self.request_is_over(request_header_and_message[1].goal)


class OffTheExecutor:
    """What callbacks await that is done on other threads; who closes waits until it is answered."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._awaited = 0
        self._fewer = threading.Condition()

    async def __call__(
        self, submit: Callable[[Callable[[], None]], Any], work: Callable[[], Any]
    ) -> Any:
        """Await what `work` returns or raises; `submit` has it done on another thread."""
        with self._fewer:
            self._awaited += 1
        try:
            return await _off_the_executor(self._node.executor, submit, work)
        finally:
            with self._fewer:
                self._awaited -= 1
                self._fewer.notify_all()

    def wait(self, patience: float) -> None:
        """Wait until nothing is awaited any more, for so many seconds at most."""
        with self._fewer:
            self._fewer.wait_for(lambda: not self._awaited, patience)


async def _off_the_executor(
    executor: Any, submit: Callable[[Callable[[], None]], Any], work: Callable[[], Any]
) -> Any:
    future, taken = Future(executor=executor), threading.Event()

    def do() -> None:
        try:
            future.set_result(work())
        except Exception as error:  # noqa: BLE001 - raised again where it is awaited
            future.set_exception(error)
        # An executor that has just looked may wait for something else to happen now.
        until = time.monotonic() + _SPUN
        while executor.context.ok() and time.monotonic() < until and not taken.wait(_NUDGE):
            executor.wake()

    submit(do)
    try:
        return await future
    finally:
        taken.set()
