"""The one timer: steps in time, rings in time, is off when there is nothing to do."""

from __future__ import annotations

import math
import threading
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


def test_it_is_off_until_something_moves_and_after(bench: Bench, stepper: Stepper) -> None:
    assert is_off(stepper)
    walker = Walker(3)
    stepper.start(walker)
    assert not is_off(stepper)
    bench.until(lambda: walker.left == 0)
    bench.until(lambda: is_off(stepper))
    assert len(walker.times) == 3


def test_steps_come_in_their_period(bench: Bench, stepper: Stepper) -> None:
    walker = Walker(25)
    began = stepper.now()
    stepper.start(walker)
    bench.until(lambda: walker.left == 0)
    assert walker.times[-1] - began >= 25 * 0.02 - 0.001
    assert walker.times[0] - began >= 0.02


def test_a_high_speed_makes_several_steps_at_once(bench: Bench) -> None:
    stepper = Stepper(platform_of(bench.node), speed=1000.0, step_period=0.1)
    walker = Walker(2000)
    began = stepper.now()
    stepper.start(walker)
    bench.until(lambda: walker.left == 0)
    assert 0.2 <= walker.times[-1] - began + 0.02 < 2.0, "one by one it would take 2 s at least"
    assert len(set(walker.times)) < 60
    stepper.close()


def test_what_is_stopped_is_stepped_no_more(bench: Bench, stepper: Stepper) -> None:
    stopped, going = Walker(), Walker(10)
    stepper.start(stopped)
    stepper.start(going)
    bench.until(lambda: stopped.times)
    stepper.stop(stopped)
    count = len(stopped.times)
    bench.until(lambda: going.left == 0)
    assert len(stopped.times) <= count + 1


def test_alarms_ring_in_order_at_their_time(bench: Bench, stepper: Stepper) -> None:
    rung: list[str] = []
    now = stepper.now()
    for name, after in (("late", 0.2), ("soon", 0.05), ("past", -1.0)):
        stepper.call_at(now + after, lambda when, name=name: rung.append(name))
    bench.until(lambda: len(rung) == 3)
    assert rung == ["past", "soon", "late"]
    assert stepper.now() - now >= 0.2
    bench.until(lambda: is_off(stepper))


def test_an_alarm_may_set_another_and_start_a_motion(bench: Bench, stepper: Stepper) -> None:
    walker = Walker(1)
    stepper.call_at(0.0, lambda now: stepper.call_at(now, lambda now: stepper.start(walker)))
    bench.until(lambda: walker.left == 0)


def test_what_raises_is_dropped_and_the_others_go_on(bench: Bench, stepper: Stepper) -> None:
    class Broken(Walker):
        def step(self, now: float) -> bool:
            super().step(now)
            raise RuntimeError("a bug")

    broken, going = Broken(), Walker(5)
    stepper.start(broken)
    stepper.start(going)
    stepper.call_at(0.0, lambda now: 1 / 0)
    bench.until(lambda: going.left == 0)
    assert len(broken.times) == 1


def test_a_late_timer_makes_up_for_a_moment_but_not_for_ever(ros_bench: RosBench) -> None:
    bench, walker = ros_bench, Walker()
    stepper = Stepper(platform_of(bench.node), speed=1.0, step_period=0.02)
    stepper.start(walker)
    bench.until(lambda: walker.times)
    with stepper.lock:  # as a process that was stopped with SIGSTOP
        before = len(walker.times)
        bench.go_on_for(1.0)
    bench.until(lambda: len(walker.times) > before)
    stepper.stop(walker)
    most = CATCH_UP / 0.02
    assert most / 2 <= len(walker.times) - before <= most + 5, "1 s would be 50 steps"
    stepper.close()


def test_closing_ends_everything_and_may_be_done_twice(bench: Bench, stepper: Stepper) -> None:
    walker = Walker()
    rung: list[float] = []
    stepper.start(walker)
    stepper.call_at(stepper.now() + 0.05, rung.append)
    stepper.close()
    stepper.close()
    count = len(walker.times)
    stepper.start(walker)
    bench.go_on_for(0.15)
    assert len(walker.times) == count
    assert rung == []


def test_it_can_be_used_from_another_thread(bench: Bench, stepper: Stepper) -> None:
    walkers = [Walker(5) for _ in range(20)]
    threads = [threading.Thread(target=stepper.start, args=(walker,)) for walker in walkers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    bench.until(lambda: all(walker.left == 0 for walker in walkers))
