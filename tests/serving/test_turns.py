"""Whose turn it is, for each policy."""

from __future__ import annotations

import pytest

from bt_actions.serving.turns import Policy, Turns


def admitted(turns: Turns[str], goal: str) -> tuple[list[str], list[str]]:
    assert not turns.refusal()
    turns.expected += 1
    return turns.come(goal)


def test_reject_runs_one_and_refuses_the_next_until_it_has_left() -> None:
    turns = Turns[str](Policy.REJECT, 1)
    assert admitted(turns, "a") == (["a"], [])
    assert turns.refusal() == "another tree runs here"
    assert turns.leave("a") == []
    assert not turns.refusal()


@pytest.mark.parametrize("policy", [Policy.REJECT, Policy.PARALLEL])
def test_a_goal_that_was_admitted_and_has_not_come_yet_counts(policy: Policy) -> None:
    turns = Turns[str](policy, 1)
    turns.expected += 1
    assert turns.refusal()


def test_queue_lets_as_many_wait_as_it_was_told_and_begins_them_in_their_order() -> None:
    turns = Turns[str](Policy.QUEUE, 2)
    assert [admitted(turns, goal) for goal in "abc"] == [(["a"], []), ([], []), ([], [])]
    assert turns.refusal() == "2 goals wait already"
    assert turns.leave("a") == ["b"]
    assert turns.leave("b") == ["c"]


def test_a_goal_that_leaves_the_queue_is_not_begun() -> None:
    turns = Turns[str](Policy.QUEUE, 2)
    for goal in "abc":
        admitted(turns, goal)
    assert turns.leave("b") == []
    assert turns.leave("a") == ["c"]


def test_replace_halts_the_older_and_begins_the_newer_when_it_has_left() -> None:
    turns = Turns[str](Policy.REPLACE, 1)
    admitted(turns, "a")
    assert admitted(turns, "b") == ([], ["a"])
    assert admitted(turns, "c") == ([], ["a", "b"])
    assert turns.leave("b") == []
    assert turns.leave("a") == ["c"]


def test_parallel_runs_as_many_as_it_was_told() -> None:
    turns = Turns[str](Policy.PARALLEL, 2)
    assert [admitted(turns, goal) for goal in "ab"] == [(["a"], []), (["b"], [])]
    assert turns.refusal() == "2 trees run already"
    turns.leave("a")
    assert admitted(turns, "c") == (["c"], [])


def test_none_at_all_is_no_limit() -> None:
    with pytest.raises(ValueError, match="most must be 1 at least"):
        Turns[str](Policy.QUEUE, 0)
