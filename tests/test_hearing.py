"""When silence may mean that a server does not hear what it is asked."""

from __future__ import annotations

import pytest

from bt_actions.hearing import ASK_EVERY, DOUBT_LASTS, MUTE_AFTER, Hearing


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
    assert not fresh.wants_question(99.0)
    assert not fresh.is_mute(99.0)
    assert not fresh.in_doubt(99.0)


def test_who_has_answered_owes_nothing(hearing: Hearing) -> None:
    assert hearing.heard
    assert not hearing.asks
    assert not hearing.wants_question(99.0)
    assert not hearing.is_mute(99.0)


def test_who_is_silent_is_asked_again_and_may_be_deaf(hearing: Hearing) -> None:
    hearing.asked(20.0)
    assert hearing.asks
    assert not hearing.wants_question(20.0 + ASK_EVERY - 0.1)
    assert hearing.wants_question(20.0 + ASK_EVERY)
    hearing.asked(20.0 + ASK_EVERY)
    assert not hearing.wants_question(20.0 + ASK_EVERY)
    assert not hearing.is_mute(20.0 + MUTE_AFTER - 0.1)
    assert hearing.is_mute(20.0 + MUTE_AFTER), "questions that get lost do not put it off"
    hearing.answered(20.0 + ASK_EVERY)
    assert not hearing.is_mute(99.0)


def test_an_answer_of_before_the_standstill_proves_nothing(hearing: Hearing) -> None:
    hearing.asked(20.0)
    hearing.doubt(30.0)
    assert hearing.wants_question(30.0), "at once"
    hearing.answered(20.0)
    assert hearing.in_doubt(31.0) == DOUBT_LASTS - 1.0
    assert hearing.is_mute(30.0 + MUTE_AFTER)
    hearing.asked(30.0)
    hearing.answered(30.0)
    assert not hearing.in_doubt(31.0)
    assert not hearing.is_mute(99.0)


def test_a_doubt_without_an_end_ends(hearing: Hearing) -> None:
    hearing.doubt(30.0)
    assert not hearing.in_doubt(30.0 + DOUBT_LASTS)
    assert hearing.is_mute(99.0)
