"""What a process may not conclude, and for how long, after it stood still."""

from __future__ import annotations

import pytest

from bt_actions.servers.reachability import DOUBT_LASTS
from bt_actions.traffic.stalls import (
    ANSWERS_TAKE,
    BACK_IN_SIGHT,
    IN_A_ROW,
    OUT_OF_SIGHT,
    STOOD_STILL,
    Stalls,
)


@pytest.fixture
def stalls() -> Stalls:
    """Of a process that lives, and means to sleep from second 10.0 to 10.2."""
    alive = Stalls()
    alive.lives(10.0)
    alive.sleeps(10.0, 10.2)
    return alive


def test_who_is_in_time_waits_for_nothing(stalls: Stalls) -> None:
    assert stalls.answers_take(10.1 + STOOD_STILL) == 0.0
    assert not stalls.servers_take(10.1 + STOOD_STILL)


def test_whoever_asks_first_notices(stalls: Stalls) -> None:
    end = 10.3 + STOOD_STILL
    assert stalls.answers_take(end) == pytest.approx(ANSWERS_TAKE)
    assert stalls.answers_take(end + 0.2) == pytest.approx(ANSWERS_TAKE - 0.2)
    assert not stalls.servers_take(end), "no lease is so short"
    assert stalls.long_times == 0


def test_servers_are_out_of_sight_where_a_lease_may_have_run_out(stalls: Stalls) -> None:
    end = 10.3 + OUT_OF_SIGHT
    assert stalls.servers_take(end)
    assert stalls.long_times == 1
    for tenth in range(1, int(10 * BACK_IN_SIGHT)):
        moment = end + tenth / 10
        stalls.lives(moment)
        assert stalls.servers_take(moment)
        assert bool(stalls.answers_take(moment)) == (moment < end + ANSWERS_TAKE)
    assert not stalls.servers_take(end + BACK_IN_SIGHT)


def test_after_a_rest_nobody_knows_whether_this_process_is_heard(stalls: Stalls) -> None:
    stalls.rests(10.0)
    stalls.lives(10.0 + OUT_OF_SIGHT)
    assert stalls.long_times == 0, "no lease is so short"
    stalls.rests(20.0)
    stalls.lives(99.0)
    stalls.lives(99.2)
    assert stalls.long_times == 1


def test_a_machine_that_was_suspended_stood_still_though_its_clock_did_not_go_on() -> None:
    asleep = 0.0
    stalls = Stalls(lambda now: now + asleep)
    stalls.lives(10.0)
    asleep = 60.0
    assert stalls.answers_take(10.1) == ANSWERS_TAKE
    assert stalls.servers_take(10.2) > 0.0
    assert stalls.long_times == 1


def stand_still(stalls: Stalls, moment: float, seconds: float, then: float) -> float:
    """Do so from this moment, and live on; return the moment after that."""
    stalls.lives(moment)
    stalls.lives(moment + seconds)
    return moment + seconds + then


@pytest.mark.parametrize("seconds", [0.5, OUT_OF_SIGHT + 0.1])
def test_stalls_in_a_row_are_borne_with_and_no_more_until_it_is_calm(
    stalls: Stalls, seconds: float
) -> None:
    is_long = seconds > OUT_OF_SIGHT
    moment = 10.3
    for _ in range(IN_A_ROW):
        moment = stand_still(stalls, moment, seconds, 0.2)
        assert stalls.answers_take(moment)
        assert bool(stalls.servers_take(moment)) is is_long
    for _ in range(100):
        moment = stand_still(stalls, moment, seconds, 0.2)
    assert not stalls.answers_take(moment)
    assert not stalls.servers_take(moment)
    assert stalls.long_times == (IN_A_ROW if is_long else 0)
    stalls.sleeps(moment, moment + DOUBT_LASTS)
    calm = stand_still(stalls, moment + DOUBT_LASTS, seconds, 0.0)
    assert stalls.answers_take(calm)
    assert bool(stalls.servers_take(calm)) is is_long


def test_who_looked_at_the_clock_before_a_stall_hears_of_it_as_of_now() -> None:
    clock = [10.0]
    stalls = Stalls(lambda _: clock[0], lambda _: clock[0])
    stalls.lives(10.0)
    stalls.sleeps(10.0, 10.2)
    clock[0] = 14.2
    assert stalls.answers_take(10.0)
    assert stalls.servers_take(15.0)
