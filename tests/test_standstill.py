"""When a process that stood still must not conclude anything from what is missing."""

from __future__ import annotations

import pytest

from bt_actions.standstill import (
    ANSWERS_TAKE,
    BACK_IN_SIGHT,
    CALM,
    IN_A_ROW,
    OUT_OF_SIGHT,
    STOOD_STILL,
    Standstill,
)


@pytest.fixture
def standstill() -> Standstill:
    """Of a process that has lived until second 10."""
    made = Standstill()
    for tenth in range(101):
        made.lives(tenth / 10)
    return made


def test_who_is_in_time_waits_for_nothing(standstill: Standstill) -> None:
    assert standstill.answers_take(10.2) == 0.0
    assert not standstill.servers_take(10.2)


def test_whoever_asks_first_notices(standstill: Standstill) -> None:
    end = 10.0 + STOOD_STILL + 0.1
    assert standstill.answers_take(end) == pytest.approx(ANSWERS_TAKE)
    assert standstill.answers_take(end + 0.4) == pytest.approx(ANSWERS_TAKE - 0.4)
    assert not standstill.servers_take(end), "no lease is so short"


def test_servers_are_hidden_where_a_lease_may_have_run_out(standstill: Standstill) -> None:
    end = 10.0 + OUT_OF_SIGHT + 0.1
    assert standstill.servers_take(end)
    moment = end
    while moment < end + BACK_IN_SIGHT - 0.2:
        assert standstill.servers_take(moment)
        moment += 0.2
    assert not standstill.servers_take(end + BACK_IN_SIGHT)


def test_a_rest_is_no_standstill(standstill: Standstill) -> None:
    standstill.rests()
    assert standstill.answers_take(99.0) == 0.0
    assert not standstill.servers_take(99.0)


def test_where_a_machine_is_never_in_time_what_is_due_takes_effect_all_the_same(
    standstill: Standstill,
) -> None:
    moment, held = 10.0, 0
    while standstill.answers_take(moment := moment + 2.0):
        held += 1
    assert held == IN_A_ROW
    for _ in range(int(CALM / 0.2) + 1):
        standstill.lives(moment := moment + 0.2)
    assert standstill.answers_take(moment + 2.0), "once more, after a calm"


def test_many_short_ones_use_up_nothing_of_what_a_long_one_is_granted(
    standstill: Standstill,
) -> None:
    moment = 10.0
    for _ in range(2 * IN_A_ROW):
        standstill.lives(moment := moment + STOOD_STILL + 0.1)
    assert not standstill.answers_take(moment + 0.1)
    assert standstill.servers_take(moment + 3.5) == pytest.approx(BACK_IN_SIGHT)
