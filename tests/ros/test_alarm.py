"""The alarm is awake when it was asked to be, and knows a stall from Python's own work."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Iterator

import pytest

from bt_actions.ros.collector import FULL, Collector
from bt_actions.ros.suspended import Suspended
from bt_actions.servers.stalls import STOOD_STILL
from bt_actions.traffic import alarm
from bt_actions.traffic.shared import lock
from tests.support.waiting import until


class Attended:
    """A line that wants nothing, but that the next look comes when it says so."""

    def __init__(self) -> None:
        self.looks: list[float] = []
        self.wants = 10.0
        """Seconds of its own, told by `attend`;"""
        self.asks: float | None = None
        """and seconds for which it calls `wake_by` in its next look."""
        self.asked: list[float] = []

    def attend(self, now: float) -> float:
        self.looks.append(now)
        if self.asks is not None:
            self.asked.append(now + self.asks)
            alarm.wake_by(now + self.asks)
            self.asks = None
        return self.wants


@pytest.fixture
def attended() -> Iterator[Attended]:
    each = Attended()
    with lock:
        alarm.mind(each)
    until(lambda: len(each.looks) > 1)
    yield each
    with lock:
        alarm.forget(each)


def test_who_asks_to_be_woken_while_it_is_attended_is_heard(attended: Attended) -> None:
    """The alarm would otherwise look again after 0.2 s."""
    lateness = []
    for _ in range(10):  # one of them may be late because the machine is
        attended.asks = 0.02
        until(lambda: attended.asks is None)
        until(lambda: attended.looks[-1] >= attended.asked[-1])
        lateness.append(next(at for at in attended.looks if at >= attended.asked[-1]))
        lateness[-1] -= attended.asked[-1]
    assert min(lateness) < alarm.AT_LEAST_EVERY / 4


def test_the_garbage_collector_is_no_standstill(attended: Attended) -> None:
    """Python's threads wait for it, and those that take in what is sent do not."""
    times = alarm.stalls.times
    work = threading.Event()

    def as_long_as(phase: str, info: dict[str, int]) -> None:
        if phase == "start" and info["generation"] == 2 and work.is_set():
            end = time.thread_time() + 2 * STOOD_STILL
            while time.thread_time() < end:
                pass

    gc.callbacks.append(as_long_as)
    try:
        work.set()
        with lock:  # the alarm waits for it, as it does for a collector
            gc.collect()
        work.clear()
        looks = len(attended.looks)
        until(lambda: len(attended.looks) > looks + 1)
    finally:
        gc.callbacks.remove(as_long_as)
    assert alarm.stalls.times == times


def test_a_wait_without_work_is_one(attended: Attended) -> None:
    times = alarm.stalls.times
    with lock:
        threading.Event().wait(2 * STOOD_STILL)
    until(lambda: alarm.stalls.times > times)


def test_a_collector_counts_what_full_collections_took_and_only_while_it_watches() -> None:
    collector = Collector()
    gc.collect()
    assert collector.take() == 0.0
    collector.watch()
    gc.collect(1)
    assert collector.take() == 0.0
    gc.collect()
    assert collector.take() > 0.0
    assert collector.take() == 0.0
    collector.unwatch()
    assert collector._note not in gc.callbacks
    collector.unwatch()


def test_a_collection_whose_thread_has_gone_is_forgotten() -> None:
    """A fork in the middle of it, say, or an alarm that ended."""
    collector = Collector()
    thread = threading.Thread(target=collector._note, args=("start", {"generation": FULL}))
    thread.start()
    thread.join()
    until(lambda: collector.take() == 0.0)  # joined, it still takes a moment to go
    collector._note("stop", {"generation": FULL})
    assert collector.take() == 0.0


def test_suspension_is_what_the_steady_clock_does_not_count() -> None:
    clocks = {"steady": 100.0, "boot": 700.0}
    suspended = Suspended(lambda: clocks["steady"], lambda: clocks["boot"])
    clocks["steady"] += 5.0
    clocks["boot"] += 5.0
    assert suspended.take() == 0.0
    clocks["steady"] += 1.0
    clocks["boot"] += 61.0
    assert suspended.take() == pytest.approx(60.0)
    assert suspended.take() == 0.0


def test_a_reading_that_took_long_is_worth_nothing() -> None:
    moments = iter([0.0, 0.0, 10.0, 13.0, 20.0, 20.0])
    boot = iter([500.0, 513.0, 580.0])
    suspended = Suspended(lambda: next(moments), lambda: next(boot))
    assert suspended.take() == 0.0, "stopped between the two"
    assert suspended.take() == pytest.approx(60.0), "the next one tells"


def test_this_machine_was_not_suspended_just_now() -> None:
    assert Suspended().take() == 0.0
