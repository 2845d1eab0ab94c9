"""What callbacks await, done on other threads. Does nothing by itself.

rclpy's executor looks again and again at what is awaited, and a multi-threaded one may forget to:
it is reminded until it has.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.task import Future

_NUDGE = 0.01
"""Seconds between two reminders of an executor that something awaited is there."""
_SPUN = 10.0
"""Seconds after which nobody spins it any more."""


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
        executor: Any = self._node.executor
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

        with self._fewer:
            self._awaited += 1
        try:
            submit(do)
            return await future
        finally:
            taken.set()
            with self._fewer:
                self._awaited -= 1
                self._fewer.notify_all()

    def wait(self, patience: float) -> None:
        """Wait until nothing is awaited any more, for so many seconds at most."""
        with self._fewer:
            self._fewer.wait_for(lambda: not self._awaited, patience)
