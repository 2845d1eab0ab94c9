"""Timeouts, Retry and Busy: checked when made, and readable where they are wrong."""

from __future__ import annotations

import math
import random

import pytest

from bt_actions.goals.policy import (
    RETRIED_BY_DEFAULT,
    RETRIED_IF_NAMED,
    RETRYABLE,
    Busy,
    Outcome,
    Retry,
    Timeouts,
)

CHANCE = random.Random(0)


def test_the_defaults_are_those_of_the_design() -> None:
    assert Timeouts() == Timeouts(
        queue=10.0, server=5.0, accept=5.0, result=None, feedback=None, cancel=5.0
    )


def test_no_timeouts_means_the_defaults_and_a_bare_number_the_result() -> None:
    given_ones = Timeouts(accept=1.0)
    assert Timeouts.of(None) == Timeouts()
    assert Timeouts.of(3) == Timeouts(result=3.0)
    assert Timeouts.of(given_ones) is given_ones


@pytest.mark.parametrize("field", ["queue", "server", "accept", "result", "feedback", "cancel"])
def test_a_deadline_is_a_positive_finite_number_or_none(field: str) -> None:
    assert getattr(Timeouts(**{field: None}), field) is None
    assert getattr(Timeouts(**{field: 2}), field) == 2.0
    for wrong in (0, -1, math.inf, math.nan, True, "5 s"):
        with pytest.raises(ValueError, match=rf"timeout\.{field} must be"):
            Timeouts(**{field: wrong})


def test_a_number_too_large_for_a_clock_is_refused_like_any_other() -> None:
    with pytest.raises(ValueError, match=r"timeout\.result must be more than zero and finite"):
        Timeouts(result=10**400)


def test_attempts_counts_all_tries() -> None:
    assert Retry.of(3) == Retry(attempts=3)
    assert Retry().attempts == 1
    for wrong in (0, -1, 1.5, True, "3"):
        with pytest.raises(ValueError, match=r"retry\.attempts must be"):
            Retry(attempts=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("backoff", -1),
        ("backoff", math.inf),
        ("max_backoff", "1"),
        ("factor", 0.5),
        ("factor", math.nan),
        ("jitter", 1.5),
        ("jitter", -0.1),
        ("when", 3),
    ],
)
def test_a_retry_out_of_range_is_refused_by_name(field: str, wrong: object) -> None:
    with pytest.raises(ValueError, match=rf"retry\.{field} must"):
        Retry(**{field: wrong})  # type: ignore[arg-type]


def test_what_may_have_been_executed_is_retried_only_if_named() -> None:
    assert {Outcome.ACCEPT_TIMEOUT, Outcome.SERVER_LOST} == RETRIED_IF_NAMED
    assert not RETRIED_IF_NAMED & Retry().outcomes
    assert Retry().outcomes == RETRIED_BY_DEFAULT


@pytest.mark.parametrize("never", sorted(set(Outcome) - RETRYABLE))
def test_what_is_never_retried_cannot_be_named(never: Outcome) -> None:
    with pytest.raises(ValueError, match=f"{never} is never retried"):
        Retry(outcomes=frozenset({never}))


def test_outcomes_may_be_named_as_text_and_a_wrong_one_lists_those_there_are() -> None:
    named = Retry(outcomes=["ABORTED"])  # type: ignore[arg-type]
    assert named.outcomes == {Outcome.ABORTED}
    with pytest.raises(ValueError, match="no outcome 'ABORT'; there are ABORTED"):
        Retry(outcomes=["ABORT"])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="a collection"):
        Retry(outcomes="ABORTED")  # type: ignore[arg-type]


def test_the_pause_grows_by_the_factor_up_to_its_maximum() -> None:
    retry = Retry(9, backoff=0.5, factor=2.0, max_backoff=3.0)
    assert [retry.pause(n, CHANCE) for n in (1, 2, 3, 4, 5)] == [0.5, 1.0, 2.0, 3.0, 3.0]


def test_without_backoff_there_is_no_pause_however_often_it_is_tried() -> None:
    assert Retry(10_000).pause(5_000, CHANCE) == 0.0
    assert Retry(10_000, backoff=0.1).pause(5_000, CHANCE) == 60.0


def test_jitter_varies_the_pause_in_both_directions_by_at_most_itself() -> None:
    retry = Retry(2, backoff=10.0, jitter=0.2)
    pauses = [retry.pause(1, CHANCE) for _ in range(500)]
    assert 8.0 <= min(pauses) < 9.0
    assert 11.0 < max(pauses) <= 12.0


def test_busy_is_written_as_in_yaml() -> None:
    assert [Busy(text) for text in ("wait", "replace", "fail", "share")] == list(Busy)
