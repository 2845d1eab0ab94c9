"""When silence may mean that a server does not hear what it is asked."""

from __future__ import annotations

import pytest

from bt_actions.servers.reachability import (
    AT_ONCE,
    DOUBT_LASTS,
    MUTE_AFTER,
    TRIES,
    TRY_AGAIN,
    TRY_LASTS,
    TWICE,
    Hearing,
)


@pytest.fixture
def hearing() -> Hearing:
    """Asked at 10 s, and answered."""
    fresh = Hearing()
    fresh.asked(10.0)
    fresh.answered(10.0)
    return fresh


def test_who_is_asked_nothing_owes_nothing() -> None:
    fresh = Hearing()
    assert not fresh.heard
    assert not fresh.take_question(99.0)
    assert not fresh.is_mute(99.0)
    assert not fresh.in_doubt(99.0)


def test_who_has_answered_owes_nothing(hearing: Hearing) -> None:
    assert hearing.heard
    assert not hearing.is_mute(99.0)


def test_who_is_silent_may_be_deaf_and_is_not_pestered(hearing: Hearing) -> None:
    hearing.asked(20.0)
    hearing.asked(20.0 + MUTE_AFTER - 0.1)
    assert not hearing.is_mute(20.0 + MUTE_AFTER - 0.1)
    assert hearing.is_mute(20.0 + MUTE_AFTER), "questions that get lost do not put it off"
    assert not hearing.take_question(99.0)
    hearing.answered(20.0 + MUTE_AFTER - 0.1)
    assert not hearing.is_mute(99.0)


def test_an_answer_of_before_the_standstill_proves_nothing(hearing: Hearing) -> None:
    hearing.asked(20.0)
    hearing.doubt(30.0)
    hearing.answered(20.0)
    assert hearing.in_doubt(31.0) == DOUBT_LASTS - 1.0
    assert hearing.is_mute(30.0 + MUTE_AFTER)
    hearing.answered(30.0)
    assert not hearing.in_doubt(31.0)
    assert not hearing.is_mute(99.0)


@pytest.mark.parametrize("ask_after", [AT_ONCE, TWICE])
def test_in_a_doubt_it_is_asked_so_often(hearing: Hearing, ask_after: tuple[float, ...]) -> None:
    hearing.doubt(30.0, ask_after)
    asked = [now / 10 for now in range(300, 1000) if hearing.take_question(now / 10)]
    assert asked == [30.0 + seconds for seconds in ask_after]
    hearing.doubt(100.0)
    hearing.answered(100.0)
    assert not hearing.take_question(199.0), "it was answered"


def test_standstills_that_follow_each_other_are_one_doubt(hearing: Hearing) -> None:
    for now in (30.0, 36.0, 42.0):
        hearing.doubt(now)
        assert hearing.take_question(now) is (now == 30.0)
        assert hearing.in_doubt(now) == DOUBT_LASTS
        assert hearing.is_mute(now + MUTE_AFTER) is (now < 42.0)
        hearing.tried(now + MUTE_AFTER)


def test_an_answer_to_what_was_asked_before_is_no_proof_but_a_reason_to_ask(
    hearing: Hearing,
) -> None:
    """A standstill after the first question, and before its answer was taken."""
    hearing.doubt(30.0)
    assert hearing.take_question(30.0)
    hearing.asked(30.0)
    hearing.doubt(32.0)
    assert not hearing.take_question(33.0), "a busy server is not asked twice"
    hearing.answered(30.0)
    assert hearing.in_doubt(33.0)
    assert hearing.take_question(33.0)
    hearing.answered(33.0)
    assert not hearing.in_doubt(33.0)
    hearing.answered(30.0)
    assert not hearing.take_question(34.0)


def test_another_way_is_looked_for_now_and_then(hearing: Hearing) -> None:
    hearing.asked(20.0)
    now = 30.0
    for number in range(1, TRIES + 1):
        assert hearing.is_mute(now), number
        hearing.tried(now)
        assert hearing.is_mute(now + TRY_LASTS - 0.1), "a look is not broken off"
        now += TRY_LASTS
    assert not hearing.is_mute(now)
    assert not hearing.is_mute(now - TRY_LASTS + TRY_AGAIN - 0.1)
    assert hearing.is_mute(now - TRY_LASTS + TRY_AGAIN)


def test_a_doubt_without_an_end_ends(hearing: Hearing) -> None:
    hearing.doubt(30.0)
    assert not hearing.in_doubt(30.0 + DOUBT_LASTS)
    assert hearing.is_mute(99.0)
