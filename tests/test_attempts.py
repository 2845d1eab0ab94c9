"""When an action is tried again, and when not."""

from __future__ import annotations

import random
from typing import Any

import pytest

from bt_actions.goals.attempts import AttemptRecord, Attempts
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import RETRYABLE, End, Outcome, Retry, Timeouts
from bt_actions.goals.terms import Now

START = Now(100.0, 1000.0)
CHANCE = random.Random(0)


def record(outcome: Outcome, end: End = End.ABORTED, result: Any = None) -> AttemptRecord:
    goal = Goal(b"\x01" * 16, "/move", Timeouts(), START)
    goal.end = end
    return AttemptRecord(1, outcome, "", 997.5, START.ros, result, goal)


def attempts(retry: Retry, when: Any = None) -> Attempts:
    return Attempts(retry, when)


def later(seconds: float) -> Now:
    return Now(START.steady + seconds, START.ros + seconds)


def test_attempts_counts_all_tries() -> None:
    three = attempts(Retry(3))
    answers = [three.again(record(Outcome.ABORTED), CHANCE) for _ in range(3)]
    assert answers == [True, True, False]
    assert len(three.history) == 3


def test_one_attempt_is_never_tried_again() -> None:
    assert not attempts(Retry()).again(record(Outcome.ABORTED), CHANCE)


@pytest.mark.parametrize("outcome", list(Outcome))
def test_only_what_is_named_is_tried_again(outcome: Outcome) -> None:
    assert attempts(Retry(2)).again(record(outcome), CHANCE) == (outcome in Retry().outcomes)
    everything = Retry(2, outcomes=RETRYABLE)
    assert attempts(everything).again(record(outcome), CHANCE) == (outcome in RETRYABLE)


def test_who_could_have_been_tried_again_says_why_not() -> None:
    lost = record(Outcome.ACCEPT_TIMEOUT)
    assert not attempts(Retry(3)).again(lost, CHANCE)
    why = "(not tried again: ACCEPT_TIMEOUT is not among the outcomes of retry)"
    assert lost.reason.endswith(why)
    for retry, outcome in ((Retry(1), Outcome.ACCEPT_TIMEOUT), (Retry(3), Outcome.CANCELED)):
        silent = record(outcome)
        assert not attempts(retry).again(silent, CHANCE)
        assert silent.reason == ""


@pytest.mark.parametrize("outcome", sorted(RETRYABLE))
def test_a_retry_waits_until_the_end_of_the_earlier_goal_is_known(outcome: Outcome) -> None:
    retry = Retry(2, outcomes=RETRYABLE)
    assert not attempts(retry).again(record(outcome, End.UNKNOWN), CHANCE)
    assert attempts(retry).again(record(outcome, End.SERVER_GONE), CHANCE)


def test_when_decides_by_the_result() -> None:
    def when(result: int) -> bool:
        return result == 2

    assert attempts(Retry(2), when).again(record(Outcome.ABORTED, result=2), CHANCE)
    assert not attempts(Retry(2), when).again(record(Outcome.ABORTED, result=3), CHANCE)
    assert attempts(Retry(2), when).again(record(Outcome.ABORTED), CHANCE), "no result to ask about"


def test_when_that_raises_counts_as_no() -> None:
    def when(result: Any) -> bool:
        return bool(result.error_code)

    filed = record(Outcome.ABORTED, result=2)
    assert not attempts(Retry(2), when).again(filed, CHANCE)
    assert "retry.when: AttributeError: " in filed.reason


def test_the_next_attempt_waits_for_its_pause_on_the_nodes_clock() -> None:
    paused = attempts(Retry(3, backoff=2.0))
    assert paused.pause_left(START) == 0.0
    paused.again(record(Outcome.ABORTED), CHANCE)
    assert paused.pause_left(START) == 2.0
    assert paused.pause_left(Now(9999.0, START.ros)) == 2.0, "simulated time stands still"
    assert paused.pause_left(later(1.5)) == pytest.approx(0.5)
    assert paused.pause_left(later(2.0)) == 0.0


def test_a_clock_that_jumps_back_leaves_what_remained_of_the_pause() -> None:
    paused = attempts(Retry(3, backoff=2.0))
    paused.again(record(Outcome.ABORTED), CHANCE)
    paused.pause_left(later(1.5))
    jumped = Now(START.steady + 1.5, 3.0)
    assert paused.pause_left(jumped) == pytest.approx(0.5)
    assert paused.pause_left(Now(jumped.steady, jumped.ros + 0.5)) == pytest.approx(0.0)


def test_attempt_is_the_one_under_way_or_next() -> None:
    two = attempts(Retry(2))
    assert two.attempt == 1
    two.again(record(Outcome.ABORTED), CHANCE)
    assert two.attempt == 2


def test_a_record_shows_an_end_that_became_known_later() -> None:
    filed = record(Outcome.RESULT_TIMEOUT, End.UNKNOWN)
    assert filed.end is End.UNKNOWN
    filed.goal.end = End.CANCELED
    assert filed.end is End.CANCELED
    assert filed.goal_id == "01" * 16
    assert filed.duration == 2.5
    assert not filed.late


@pytest.mark.parametrize("outcome", sorted(RETRYABLE))
def test_beside_a_server_that_is_gone_only_who_asked_for_it_tries_again(outcome: Outcome) -> None:
    """Whatever it was canceled for: a goal that was cut off may still run where nobody sees it."""
    named = Retry(2, outcomes=RETRYABLE - {Outcome.SERVER_LOST})
    assert not attempts(named).again(record(outcome, End.SERVER_GONE), CHANCE)
    assert attempts(Retry(2, outcomes=RETRYABLE)).again(record(outcome, End.SERVER_GONE), CHANCE)


@pytest.mark.parametrize("outcome", sorted(RETRYABLE))
def test_what_has_succeeded_is_not_done_twice(outcome: Outcome) -> None:
    again = attempts(Retry(2, outcomes=RETRYABLE)).again(record(outcome, End.SUCCEEDED), CHANCE)
    assert again == (outcome is Outcome.UNEXPECTED_RESULT)
