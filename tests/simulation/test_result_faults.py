"""Lost and late results, without ROS."""

from __future__ import annotations

import heapq
from collections.abc import Callable

import pytest

from bt_actions.simulation.fault_plan import FaultPlan
from bt_actions.simulation.result_faults import ResultFaults


class Clock:
    """A clock that is set forward by hand, and rings."""

    def __init__(self) -> None:
        self.time = 0.0
        self.alarms: list[tuple[float, int, Callable[[float], None]]] = []

    def now(self) -> float:
        return self.time

    def call_at(self, when: float, callback: Callable[[float], None]) -> None:
        heapq.heappush(self.alarms, (when, len(self.alarms), callback))

    def go_to(self, time: float) -> None:
        while self.alarms and self.alarms[0][0] <= time:
            self.time = self.alarms[0][0]
            heapq.heappop(self.alarms)[2](self.time)
        self.time = time


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def answered() -> list[str]:
    return []


@pytest.fixture
def results(clock: Clock, answered: list[str]) -> ResultFaults:
    return ResultFaults(clock, answered.append)


def expect(results: ResultFaults, fault: str) -> None:
    results.expect("a", FaultPlan.of([f"*:1:{fault}"]).strike("/s", 1))


def test_a_goal_without_faults_is_answered_now(results: ResultFaults) -> None:
    expect(results, "slow")
    assert results.on_request("a", "request")
    assert results.on_request("unknown", "request")


def test_drop_result_loses_every_answer(results: ResultFaults) -> None:
    expect(results, "drop_result")
    assert not any(results.on_request("a", "request") for _ in range(5))


def test_drop_result_with_a_count_loses_so_many(results: ResultFaults) -> None:
    expect(results, "drop_result=2")
    assert [results.on_request("a", "request") for _ in range(3)] == [False, False, True]


def test_delay_result_answers_so_long_after_the_end(
    results: ResultFaults, clock: Clock, answered: list[str]
) -> None:
    expect(results, "delay_result=2")
    assert not results.on_request("a", "before the end")
    clock.go_to(10.0)
    results.ended("a", 10.0, remembered=5.0)
    clock.go_to(11.0)
    assert not results.on_request("a", "after the end")
    assert answered == []
    clock.go_to(12.0)
    assert answered == ["before the end", "after the end"]
    assert results.on_request("a", "late enough")


def test_a_goal_is_forgotten_when_its_server_has_forgotten_it(
    results: ResultFaults, clock: Clock
) -> None:
    expect(results, "drop_result")
    results.ended("a", 0.0, remembered=5.0)
    clock.go_to(5.0)
    assert results.on_request("a", "request"), "the server answers that it knows no such goal"


def test_a_dead_server_has_forgotten_all(results: ResultFaults) -> None:
    expect(results, "drop_result")
    results.clear()
    assert results.on_request("a", "request")
