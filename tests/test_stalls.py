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
    Stalls,
)


@pytest.fixture
def stalls() -> Stalls:
    """Of a process that has lived for 10 seconds."""
    alive = Stalls()
    for moment in range(101):
        alive.lives(moment / 10)
    return alive


def test_who_is_in_time_waits_for_nothing(stalls: Stalls) -> None:
    assert stalls.answers_take(10.2) == 0.0
    assert not stalls.servers_take(10.2)


def test_whoever_asks_first_notices(stalls: Stalls) -> None:
    end = 10.0 + ANSWERS_TAKE
    assert stalls.answers_take(end) == pytest.approx(ANSWERS_TAKE)
    assert stalls.answers_take(end + 0.2) == pytest.approx(ANSWERS_TAKE - 0.2)
    assert not stalls.servers_take(end), "no lease is so short"
    assert (stalls.times, stalls.long_times) == (1, 0)


def test_a_short_one_takes_no_more_than_twice_its_time(stalls: Stalls) -> None:
    still = STOOD_STILL + 0.1
    assert stalls.answers_take(10.0 + still) == pytest.approx(2 * still)


def test_a_short_one_takes_nothing_from_the_grace_of_a_long_one(stalls: Stalls) -> None:
    stalls.lives(20.0)
    assert stalls.answers_take(20.31) == pytest.approx(ANSWERS_TAKE - 0.31)


def test_servers_are_hidden_where_a_lease_may_have_run_out(stalls: Stalls) -> None:
    end = 10.0 + OUT_OF_SIGHT + 0.1
    assert stalls.servers_take(end)
    assert stalls.long_times == 1
    moment = end
    while moment + 0.2 < end + BACK_IN_SIGHT:
        moment += 0.2
        assert stalls.servers_take(moment)
        assert bool(stalls.answers_take(moment)) == (moment < end + ANSWERS_TAKE)
    assert not stalls.servers_take(end + BACK_IN_SIGHT)


def test_a_rest_is_no_standstill(stalls: Stalls) -> None:
    stalls.rests(10.0)
    assert stalls.answers_take(99.0) == 0.0
    assert not stalls.servers_take(99.0)
    assert stalls.times == 0


def test_after_a_rest_nobody_knows_whether_this_process_is_still_heard(
    stalls: Stalls,
) -> None:
    stalls.rests(10.0)
    stalls.lives(10.0 + OUT_OF_SIGHT)
    assert stalls.long_times == 0, "no lease is so short"
    stalls.rests(20.0)
    stalls.lives(99.0)
    stalls.lives(99.2)
    assert stalls.long_times == 1


def test_a_machine_that_was_suspended_stood_still_though_its_clock_did_not_go_on(
    stalls: Stalls,
) -> None:
    asleep = [60.0]
    stalls._take_asleep = lambda: asleep.pop() if asleep else 0.0
    assert stalls.answers_take(10.1) == ANSWERS_TAKE
    assert stalls.servers_take(10.2) > 0.0
    assert (stalls.times, stalls.long_times) == (1, 1)


def test_a_time_in_which_python_alone_stood_still_does_not_count(stalls: Stalls) -> None:
    stalls._take_busy = lambda: 2.0
    assert stalls.answers_take(12.0 + STOOD_STILL / 2) == 0.0
    stalls._take_busy = lambda: 0.1
    assert stalls.answers_take(12.2 + STOOD_STILL) == 0.0
    assert stalls.answers_take(15.0) == ANSWERS_TAKE, "it was stopped as well"
    assert (stalls.times, stalls.long_times) == (1, 1)


def test_leniency_bears_with_so_many_in_a_row_and_no_more(stalls: Stalls) -> None:
    leniency, moment = Leniency(), 10.0
    for _ in range(AT_MOST):
        assert leniency.bears(stalls, cause=True)
        stalls.lives(moment := moment + 1.0)
    assert not leniency.bears(stalls, cause=True)
    assert not leniency.bears(stalls, cause=True)


def test_leniency_begins_anew_where_there_was_no_cause_for_it(stalls: Stalls) -> None:
    leniency, moment = Leniency(), 10.0
    assert not leniency.bears(stalls, cause=False)
    for _ in range(2 * AT_MOST):
        stalls.lives(moment := moment + 1.0)
    assert leniency.bears(stalls, cause=True), "what was before it does not count"
    for _ in range(AT_MOST):
        stalls.lives(moment := moment + 1.0)
    assert not leniency.bears(stalls, cause=True)
    assert not leniency.bears(stalls, cause=False)
    assert leniency.bears(stalls, cause=True)


def test_many_of_them_use_up_nothing_of_what_the_next_one_is_granted(
    stalls: Stalls,
) -> None:
    moment = 10.0
    for _ in range(100):
        stalls.lives(moment := moment + OUT_OF_SIGHT + 0.1)
    assert stalls.answers_take(moment + 3.0) == ANSWERS_TAKE
    assert stalls.servers_take(moment + 3.0) == BACK_IN_SIGHT
