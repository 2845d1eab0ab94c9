"""The executor that hands work to its pool once: what it calls, and that it runs in no circle."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.waiting import until

THREADS = 2


@pytest.fixture
def executor(context: Any) -> Iterator[Any]:
    from bt_actions.ros.workarounds.once_executor import OnceExecutor

    executor = OnceExecutor(THREADS, context=context)
    yield executor
    executor._executor.shutdown()
    executor.shutdown()


def spin(executor: Any, times: int) -> None:
    for _ in range(times):
        executor.spin_once(timeout_sec=0.05)


def test_work_that_waits_for_a_thread_is_handed_over_once(executor: Any) -> None:
    go_on = threading.Event()
    calls: list[str] = []
    blocked = [executor.create_task(go_on.wait) for _ in range(THREADS)]
    until(lambda: all(task.executing() for task in blocked), meanwhile=lambda: spin(executor, 1))
    waits = executor.create_task(calls.append, "called")
    spin(executor, 30)
    handed_over = len(executor._futures)
    go_on.set()
    until(lambda: waits.done() and all(task.done() for task in blocked))
    spin(executor, 3)
    assert handed_over == THREADS + 1
    assert calls == ["called"]


def test_a_coroutine_that_waits_for_a_future_goes_on(executor: Any) -> None:
    from rclpy.task import Future

    future: Any = Future(executor=executor)

    async def wait() -> Any:
        return await future

    task = executor.create_task(wait)
    spin(executor, 5)
    assert not task.done()
    future.set_result("there")
    until(task.done, meanwhile=lambda: spin(executor, 1))
    assert task.result() == "there"


def test_what_a_callback_raises_is_raised_by_who_spins(executor: Any) -> None:
    def fail() -> None:
        raise ValueError("a callback's")

    def spin_on() -> None:
        for _ in range(100):
            executor.spin_once(timeout_sec=0.05)
            executor.create_task(str)  # rclpy's looks at what has ended when it hands over more

    executor.create_task(fail)
    with pytest.raises(ValueError, match="a callback's"):
        spin_on()
