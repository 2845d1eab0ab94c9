"""The alarm is awake when it was asked to be, and knows a stall from Python's own work."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest

from bt_actions.ros import host as module
from bt_actions.ros.host import RosHost
from bt_actions.traffic.scheduler import AT_LEAST_EVERY
from bt_actions.traffic.stalls import STOOD_STILL
from tests.support.waiting import until


class Scheduled:
    """A line that wants nothing, but that the next look comes when it says so."""

    def __init__(self) -> None:
        self.host = RosHost()
        self.looks: list[float] = []
        self.wants = 10.0
        """Seconds of its own, told by `attend`;"""
        self.asks: float | None = None
        """and seconds for which it calls `wake_by` in its next look."""
        self.asked: list[float] = []

    def run_due(self, now: float) -> float:
        self.looks.append(now)
        if self.asks is not None:
            self.asked.append(now + self.asks)
            self.host.scheduler.wake_by(now + self.asks)
            self.asks = None
        return self.wants


@pytest.fixture
def attended() -> Iterator[Scheduled]:
    each = Scheduled()
    with each.host.lock:
        each.host.scheduler.add(each)
    until(lambda: len(each.looks) > 1)
    yield each
    with each.host.lock:
        each.host.scheduler.remove(each)


def test_who_asks_to_be_woken_while_it_is_attended_is_heard(attended: Scheduled) -> None:
    """The alarm would otherwise look again after 0.2 s."""
    lateness = []
    for _ in range(10):  # one of them may be late because the machine is
        attended.asks = 0.02
        until(lambda: attended.asks is None)
        until(lambda: attended.looks[-1] >= attended.asked[-1])
        lateness.append(next(at for at in attended.looks if at >= attended.asked[-1]))
        lateness[-1] -= attended.asked[-1]
    assert min(lateness) < AT_LEAST_EVERY / 4


def test_work_is_no_stall() -> None:
    """A garbage collection, say: threads that take in what is sent do not wait for it."""
    began, idle_before = time.monotonic(), module._idle(0.0)
    end = time.thread_time() + STOOD_STILL
    while time.thread_time() < end:
        pass
    assert time.monotonic() - began - (module._idle(0.0) - idle_before) >= STOOD_STILL - 0.01


def test_the_alarm_notices_what_happens_while_it_works(attended: Scheduled) -> None:
    with attended.host.lock:
        threading.Event().wait(4 * STOOD_STILL)
        assert attended.host.stalls.answers_take(time.monotonic())
