"""When silence may mean that a server does not hear what it is asked."""

from __future__ import annotations

import pytest

from bt_actions.servers.reachability import (
    DOUBT_LASTS,
    TRIES,
    TRY_AGAIN,
    TRY_LASTS,
    UNRESPONSIVE_AFTER,
    Reachability,
)


@pytest.fixture
def reachability() -> Reachability:
    """Asked at 10 s, and answered."""
    fresh = Reachability()
    fresh.asked(10.0)
    fresh.answer_came(10.0)
    return fresh


def test_who_is_asked_nothing_owes_nothing() -> None:
    fresh = Reachability()
    assert not fresh.heard
    assert not fresh.take_question(99.0)
    assert not fresh.is_unresponsive(99.0)
    assert not fresh.in_doubt(99.0)


def test_who_has_answered_owes_nothing(reachability: Reachability) -> None:
    assert reachability.heard
    assert not reachability.is_unresponsive(99.0)


def test_who_is_silent_may_not_hear_and_is_not_pestered(reachability: Reachability) -> None:
    reachability.asked(20.0)
    reachability.asked(20.0 + UNRESPONSIVE_AFTER - 0.1)
    assert not reachability.is_unresponsive(20.0 + UNRESPONSIVE_AFTER - 0.1)
    assert reachability.is_unresponsive(20.0 + UNRESPONSIVE_AFTER), (
        "questions that get lost do not put it off"
    )
    assert not reachability.take_question(99.0)
    reachability.answer_came(20.0 + UNRESPONSIVE_AFTER - 0.1)
    assert not reachability.is_unresponsive(99.0)


def test_an_answer_of_before_the_stall_proves_nothing(reachability: Reachability) -> None:
    reachability.asked(20.0)
    reachability.doubt(30.0)
    reachability.answer_came(20.0)
    assert reachability.in_doubt(31.0) == DOUBT_LASTS - 1.0
    assert reachability.is_unresponsive(30.0 + UNRESPONSIVE_AFTER)
    reachability.answer_came(30.0)
    assert not reachability.in_doubt(31.0)
    assert not reachability.is_unresponsive(99.0)


def test_another_way_is_looked_for_now_and_then(reachability: Reachability) -> None:
    reachability.asked(20.0)
    now = 30.0
    for number in range(1, TRIES + 1):
        assert reachability.is_unresponsive(now), number
        reachability.tried(now)
        assert reachability.is_unresponsive(now + TRY_LASTS - 0.1), "a look is not broken off"
        now += TRY_LASTS
    assert not reachability.is_unresponsive(now)
    assert not reachability.is_unresponsive(now - TRY_LASTS + TRY_AGAIN - 0.1)
    assert reachability.is_unresponsive(now - TRY_LASTS + TRY_AGAIN)


def test_a_doubt_without_an_end_ends(reachability: Reachability) -> None:
    reachability.doubt(30.0)
    assert not reachability.in_doubt(30.0 + DOUBT_LASTS)
    assert reachability.is_unresponsive(99.0)
