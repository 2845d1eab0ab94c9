"""The one timer: steps in time, rings in time, is off when there is nothing to do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from bt_actions.simulation.server import platform_of
from bt_actions.simulation.stepper import CATCH_UP, Stepper
from tests.simulation.conftest import Bench, RosBench


class Walker:
    """Moves for so many steps."""

    def __init__(self, steps: float = math.inf) -> None:
        self.left = steps
        self.times: list[float] = []

    def step(self, now: float) -> bool:
        self.times.append(now)
        self.left -= 1
        return self.left > 0


@pytest.fixture
def stepper(bench: Bench) -> Iterator[Stepper]:
    each = Stepper(platform_of(bench.node), speed=1.0, step_period=0.02)
    yield each
    each.close()


def is_off(stepper: Stepper) -> bool:
    timer: Any = stepper._timer
    on_rclpy = getattr(timer, "rclpy_timer", None)
    return bool(on_rclpy.is_canceled()) if on_rclpy else timer.is_off


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, math.inf])
def test_a_senseless_speed_is_an_error(bench: Bench, speed: float) -> None:
    with pytest.raises(ValueError, match="speed"):
        Stepper(platform_of(bench.node), speed=speed)
    with pytest.raises(ValueError, match="step_period"):
        Stepper(platform_of(bench.node), step_period=speed)


def test_what_raises_is_dropped_and_the_others_go_on(bench: Bench, stepper: Stepper) -> None:
    class Broken(Walker):
        def step(self, now: float) -> bool:
            super().step(now)
            raise RuntimeError("a bug")

    broken, going = Broken(), Walker(5)
    stepper.start(broken.step)
    stepper.start(going.step)
    stepper.call_at(0.0, lambda now: 1 / 0)
    bench.until(lambda: going.left == 0)
    assert len(broken.times) == 1


def test_a_late_timer_makes_up_for_a_moment_but_not_for_ever(ros_bench: RosBench) -> None:
    bench, walker = ros_bench, Walker()
    stepper = Stepper(platform_of(bench.node), speed=1.0, step_period=0.02)
    stepper.start(walker.step)
    bench.until(lambda: walker.times)
    with stepper.lock:  # as a process that was stopped with SIGSTOP
        before = len(walker.times)
        bench.go_on_for(1.0)
    bench.until(lambda: len(walker.times) > before)
    stepper.stop(walker.step)
    most = CATCH_UP / 0.02
    assert most / 2 <= len(walker.times) - before <= most + 5, "1 s would be 50 steps"
    stepper.close()


def test_closing_ends_everything_and_may_be_done_twice(bench: Bench, stepper: Stepper) -> None:
    walker = Walker()
    rung: list[float] = []
    stepper.start(walker.step)
    stepper.call_at(stepper.now() + 0.05, rung.append)
    stepper.close()
    stepper.close()
    count = len(walker.times)
    stepper.start(walker.step)
    bench.go_on_for(0.15)
    assert len(walker.times) == count
    assert rung == []
