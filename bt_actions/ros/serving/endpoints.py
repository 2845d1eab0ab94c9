"""The services, publishers and timers of one server on its node; all of them go at once.

Their callbacks run side by side, on the executor's threads. No callback may wait: `off` gives slow
work to another thread. rclpy's executor polls what a callback awaits, and a multi-threaded one may
forget to: it is reminded until it has. Must not spin the node, nor destroy it.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

from bt_actions.ros.workarounds.closable import closable, closable_service

_NUDGE = 0.01
"""Seconds between two reminders of an executor that an awaited result is there."""
_SPUN = 10.0
"""Seconds after which the executor counts as dead."""


def kept(depth: int) -> QoSProfile:
    """Return the quality of service of a topic that keeps last messages for late subscribers."""
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Endpoints:
    """The endpoints of one server, made here and taken away together."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.group = ReentrantCallbackGroup()
        self._made = contextlib.ExitStack()

    async def off(
        self, submit: Callable[[Callable[[], None]], Any], work: Callable[[], Any]
    ) -> Any:
        """Await in a callback the result of `work`, or its error; `submit` starts another thread.

        That thread is done with the work when the callback has the result.
        """
        executor: Any = self.node.executor
        future, taken = Future(executor=executor), threading.Event()

        def do() -> None:
            try:
                future.set_result(work())
            except BaseException as error:  # noqa: BLE001 - raised again where it is awaited
                future.set_exception(error)
            # It does not wake the executor by itself; and one that has just looked may not hear it.
            until = time.monotonic() + _SPUN
            while executor.context.ok() and time.monotonic() < until:
                executor.wake()
                if taken.wait(_NUDGE):
                    break

        try:
            submit(do)
            return await future
        finally:
            taken.set()

    def service(
        self,
        kind: type,
        name: str,
        callback: Callable[..., Any],
        *,
        silent: Callable[[], bool] = lambda: False,
    ) -> None:
        """Offer a service; the callback may be a coroutine.

        While the server is `silent`, no client is answered: of two answers a client takes the
        first.
        """
        made = self.node.create_service(kind, name, callback, callback_group=self.group)
        service = closable_service(made, silent)
        self._made.callback(self.node.destroy_service, service)

    def publisher(self, kind: type, topic: str, qos: QoSProfile | int) -> Any:
        """Return a publisher."""
        publisher = closable(self.node.create_publisher(kind, topic, qos))
        self._made.callback(self.node.destroy_publisher, publisher)
        return publisher

    def timer(
        self, period: float, callback: Callable[[], object], *, autostart: bool = True
    ) -> Any:
        """Return a timer on the steady clock."""
        timer = self.node.create_timer(
            period,
            callback,
            callback_group=self.group,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
            autostart=autostart,
        )
        self._made.callback(self.node.destroy_timer, timer)
        return timer

    def close(self) -> None:
        """Destroy all endpoints, the latest first."""
        self._made.close()
