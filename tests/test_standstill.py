"""What a process may not conclude, and for how long, after it stood still."""

from __future__ import annotations

import pytest

from bt_actions.servers.stalls import (
    ANSWERS_TAKE,
    AT_MOST,
    BACK_IN_SIGHT,
    OUT_OF_SIGHT,
    STOOD_STILL,
    Leniency,
    Standstill,
)


@pytest.fixture
def standstill() -> Standstill:
    """Of a process that has lived for 10 seconds."""
    alive = Standstill()
    for moment in range(101):
        alive.lives(moment / 10)
    return alive


def test_who_is_in_time_waits_for_nothing(standstill: Standstill) -> None:
    assert standstill.answers_take(10.2) == 0.0
    assert not standstill.servers_take(10.2)


def test_whoever_asks_first_notices(standstill: Standstill) -> None:
    end = 10.0 + ANSWERS_TAKE
    assert standstill.answers_take(end) == pytest.approx(ANSWERS_TAKE)
    assert standstill.answers_take(end + 0.2) == pytest.approx(ANSWERS_TAKE - 0.2)
    assert not standstill.servers_take(end), "no lease is so short"
    assert (standstill.times, standstill.long_times) == (1, 0)


def test_a_short_one_takes_no_more_than_twice_its_time(standstill: Standstill) -> None:
    still = STOOD_STILL + 0.1
    assert standstill.answers_take(10.0 + still) == pytest.approx(2 * still)


def test_a_short_one_takes_nothing_from_the_grace_of_a_long_one(standstill: Standstill) -> None:
    standstill.lives(20.0)
    assert standstill.answers_take(20.31) == pytest.approx(ANSWERS_TAKE - 0.31)


def test_servers_are_hidden_where_a_lease_may_have_run_out(standstill: Standstill) -> None:
    end = 10.0 + OUT_OF_SIGHT + 0.1
    assert standstill.servers_take(end)
    assert standstill.long_times == 1
    moment = end
    while moment + 0.2 < end + BACK_IN_SIGHT:
        moment += 0.2
        assert standstill.servers_take(moment)
        assert bool(standstill.answers_take(moment)) == (moment < end + ANSWERS_TAKE)
    assert not standstill.servers_take(end + BACK_IN_SIGHT)


def test_a_rest_is_no_standstill(standstill: Standstill) -> None:
    standstill.rests(10.0)
    assert standstill.answers_take(99.0) == 0.0
    assert not standstill.servers_take(99.0)
    assert standstill.times == 0


def test_after_a_rest_nobody_knows_whether_this_process_is_still_heard(
    standstill: Standstill,
) -> None:
    standstill.rests(10.0)
    standstill.lives(10.0 + OUT_OF_SIGHT)
    assert standstill.long_times == 0, "no lease is so short"
    standstill.rests(20.0)
    standstill.lives(99.0)
    standstill.lives(99.2)
    assert standstill.long_times == 1


def test_a_machine_that_was_suspended_stood_still_though_its_clock_did_not_go_on(
    standstill: Standstill,
) -> None:
    asleep = [60.0]
    standstill._take_asleep = lambda: asleep.pop() if asleep else 0.0
    assert standstill.answers_take(10.1) == ANSWERS_TAKE
    assert standstill.servers_take(10.2) > 0.0
    assert (standstill.times, standstill.long_times) == (1, 1)


def test_a_time_in_which_python_alone_stood_still_does_not_count(standstill: Standstill) -> None:
    standstill._take_busy = lambda: 2.0
    assert standstill.answers_take(12.0 + STOOD_STILL / 2) == 0.0
    standstill._take_busy = lambda: 0.1
    assert standstill.answers_take(12.2 + STOOD_STILL) == 0.0
    assert standstill.answers_take(15.0) == ANSWERS_TAKE, "it was stopped as well"
    assert (standstill.times, standstill.long_times) == (1, 1)


def test_leniency_bears_with_so_many_in_a_row_and_no_more(standstill: Standstill) -> None:
    leniency, moment = Leniency(), 10.0
    for _ in range(AT_MOST):
        assert leniency.bears(standstill, cause=True)
        standstill.lives(moment := moment + 1.0)
    assert not leniency.bears(standstill, cause=True)
    assert not leniency.bears(standstill, cause=True)


def test_leniency_begins_anew_where_there_was_no_cause_for_it(standstill: Standstill) -> None:
    leniency, moment = Leniency(), 10.0
    assert not leniency.bears(standstill, cause=False)
    for _ in range(2 * AT_MOST):
        standstill.lives(moment := moment + 1.0)
    assert leniency.bears(standstill, cause=True), "what was before it does not count"
    for _ in range(AT_MOST):
        standstill.lives(moment := moment + 1.0)
    assert not leniency.bears(standstill, cause=True)
    assert not leniency.bears(standstill, cause=False)
    assert leniency.bears(standstill, cause=True)


def test_many_of_them_use_up_nothing_of_what_the_next_one_is_granted(
    standstill: Standstill,
) -> None:
    moment = 10.0
    for _ in range(100):
        standstill.lives(moment := moment + OUT_OF_SIGHT + 0.1)
    assert standstill.answers_take(moment + 3.0) == ANSWERS_TAKE
    assert standstill.servers_take(moment + 3.0) == BACK_IN_SIGHT
