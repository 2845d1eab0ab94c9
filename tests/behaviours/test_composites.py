"""Composites of ours in a tree of py_trees, tick by tick: the tables of docs/yaml.md."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from bt_actions.behaviours.composites import If, InTurn, Pipeline, Recover, Resume
from bt_actions.behaviours.decorators import Every, Repeat, RetryChild
from bt_actions.goals.policy import Retry
from tests.support.scripted import Scripted

Leaf = Callable[[str, str], Scripted]


@pytest.fixture
def log() -> list[str]:
    return []


@pytest.fixture
def leaf(log: list[str]) -> Leaf:
    return lambda name, visits: Scripted(name, visits, log)


def ticked(root: Behaviour, log: list[str], ticks: int) -> list[str]:
    """What happened in each tick, and the status behind it."""
    told = []
    for _ in range(ticks):
        log.clear()
        root.tick_once()
        told.append(f"{' '.join(log)} {root.status.name[0]}".strip())
    return told


# Recover


@pytest.mark.parametrize(
    ("child", "recover", "told"),
    [
        ("S", "S", ["c+ cS S"]),
        ("F S", "S", ["c+ cF r+ rS c+ cS S"]),
        ("F", "S", ["c+ cF r+ rS c+ cF r+ rS c+ cF F"]),
        ("F", "F", ["c+ cF r+ rF F"]),
        ("RF S", "RS", ["c+ R", "cF r+ R", "rS c+ cS S"]),
    ],
)
def test_another_attempt_follows_what_recovers_and_nothing_recovers_from_the_last(
    leaf: Leaf, log: list[str], child: str, recover: str, told: list[str]
) -> None:
    root = Recover("retry", leaf("c", child), leaf("r", recover), attempts=3)
    assert ticked(root, log, len(told)) == told


def test_what_is_stopped_while_it_recovers_has_all_attempts_again(
    leaf: Leaf, log: list[str]
) -> None:
    root = Recover("retry", leaf("c", "F"), leaf("r", "R S"), attempts=2)
    assert ticked(root, log, 1) == ["c+ cF r+ R"]
    log.clear()
    root.stop(Status.INVALID)
    assert log == ["rx"]
    assert ticked(root, log, 1) == ["c+ cF r+ rS c+ cF F"]


def test_without_a_limit_the_next_attempt_is_a_tick_later(leaf: Leaf, log: list[str]) -> None:
    root = Recover("retry", leaf("c", "F"), leaf("r", "S"))
    assert ticked(root, log, 2) == ["c+ cF r+ rS R"] * 2
    assert root.due_in() == 0.0


def test_the_pause_is_behind_what_recovers(
    leaf: Leaf, log: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr(Recover, "_now", lambda _self: now[0])
    root = Recover("retry", leaf("c", "F S"), leaf("r", "RS"), 2, Retry(backoff=5.0))
    assert ticked(root, log, 1) == ["c+ cF r+ R"]
    now[0] = 8.0
    assert ticked(root, log, 1) == ["rS R"]
    now[0] = 12.0
    assert (ticked(root, log, 1), root.due_in()) == (["R"], 1.0)
    now[0] = 13.0
    assert ticked(root, log, 1) == ["c+ cS S"]


@pytest.mark.parametrize("attempts", [0, True, 1.5, "many"])
def test_a_number_of_attempts_that_is_none_fails_and_says_so(
    leaf: Leaf, log: list[str], attempts: object
) -> None:
    root = Recover("retry", leaf("c", "S"), leaf("r", "S"), lambda: attempts)
    assert ticked(root, log, 1) == ["F"]
    assert root.feedback_message.startswith("attempts: a whole number of at least 1 is needed")
    assert root.refused


def test_an_error_of_a_child_is_not_taken_for_an_answer(leaf: Leaf) -> None:
    class Raises(Behaviour):
        def update(self) -> Status:
            raise ValueError("a bug")

    runs = leaf("a", "R")
    root = Sequence("s", memory=True, children=[Recover("r", Raises("c"), runs, attempts=2)])
    with pytest.raises(ValueError, match="a bug"):
        root.tick_once()


def test_both_retries_say_the_same(leaf: Leaf, log: list[str]) -> None:
    one = Recover("r", leaf("c", "F S"), leaf("r", "S"), attempts=3)
    other = RetryChild("r", leaf("c", "F S"), 3, Retry())
    one.tick_once()
    other.tick_once()
    assert other.feedback_message == "attempt 1 of 3 failed"
    other.tick_once()
    assert one.feedback_message == other.feedback_message == "attempt 2 of 3 succeeded"


# If


def test_a_choice_is_kept_to_the_end_of_the_visit_and_then_made_anew(
    leaf: Leaf, log: list[str]
) -> None:
    holds = [True]
    root = If("if", lambda: holds[0], leaf("t", "RRS"), leaf("e", "F"))
    assert ticked(root, log, 1) == ["t+ R"]
    holds[0] = False
    assert ticked(root, log, 3) == ["R", "tS S", "e+ eF F"]


def test_without_memory_what_is_not_chosen_any_more_is_stopped(leaf: Leaf, log: list[str]) -> None:
    holds = [True]
    root = If("if", lambda: holds[0], leaf("t", "R"), leaf("e", "R"), memory=False)
    assert ticked(root, log, 2) == ["t+ R", "R"]
    holds[0] = False
    assert ticked(root, log, 2) == ["tx e+ R", "R"]
    holds[0] = True
    assert ticked(root, log, 1) == ["ex t+ R"]


def test_a_condition_that_is_a_node_may_run_and_halts_nothing(leaf: Leaf, log: list[str]) -> None:
    asked = leaf("c", "RS RF")
    root = If("if", asked, leaf("t", "R"), leaf("e", "S"), memory=False)
    assert ticked(root, log, 4) == ["c+ R", "cS t+ R", "c+ R", "cF tx e+ eS S"]


def test_a_condition_that_has_failed_is_asked_again_in_the_next_visit(
    leaf: Leaf, log: list[str]
) -> None:
    root = If("if", leaf("c", "F S"), leaf("t", "S"))
    assert ticked(root, log, 2) == ["c+ cF F", "c+ cS t+ tS S"]
    assert root.feedback_message == ""


def test_without_an_else_what_does_not_hold_fails_by_itself(leaf: Leaf, log: list[str]) -> None:
    root = If("if", lambda: False, leaf("t", "S"))
    assert ticked(root, log, 1) == ["F"]
    assert (root.refused, root.feedback_message) == (True, "the condition does not hold")


def test_what_cannot_be_asked_fails_and_chooses_nothing(leaf: Leaf, log: list[str]) -> None:
    def asked() -> bool:
        raise ValueError("$x has no value")

    root = If("if", asked, leaf("t", "S"), leaf("e", "S"))
    assert ticked(root, log, 1) == ["F"]
    assert (root.refused, root.feedback_message) == (True, "$x has no value")


def test_a_stopped_choice_is_forgotten(leaf: Leaf, log: list[str]) -> None:
    holds = [True]
    root = If("if", lambda: holds[0], leaf("t", "R"), leaf("e", "R"))
    root.tick_once()
    root.stop(Status.INVALID)
    holds[0] = False
    assert ticked(root, log, 1) == ["e+ R"]


# Pipeline, and what holds its children back


def test_what_has_succeeded_begins_again_while_a_later_child_runs(
    leaf: Leaf, log: list[str]
) -> None:
    root = Pipeline("p", [leaf("a", "S"), leaf("b", "RRS")])
    assert ticked(root, log, 3) == ["a+ aS b+ R", "a+ aS R", "a+ aS bS S"]


def test_a_child_before_the_farthest_place_may_run_beside_a_later_one(
    leaf: Leaf, log: list[str]
) -> None:
    root = Pipeline("p", [leaf("a", "RS"), leaf("b", "RRRS"), leaf("c", "RS")])
    assert ticked(root, log, 4) == ["a+ R", "aS b+ R", "a+ R", "aS R"]
    assert ticked(root, log, 2) == ["a+ bS c+ R", "aS b+ cS bx S"]


def test_the_failure_of_any_child_ends_a_pipeline_and_stops_what_runs(
    leaf: Leaf, log: list[str]
) -> None:
    root = Pipeline("p", [leaf("a", "S F"), leaf("b", "R")])
    assert ticked(root, log, 2) == ["a+ aS b+ R", "a+ aF bx F"]


def test_a_pipeline_that_was_stopped_forgets_its_place(leaf: Leaf, log: list[str]) -> None:
    root = Pipeline("p", [leaf("a", "S R"), leaf("b", "R")])
    root.tick_once()
    root.stop(Status.INVALID)
    assert ticked(root, log, 1) == ["a+ R"]


def test_who_runs_in_a_pipeline_is_stopped_from_the_root_though_the_first_tick_raised(
    leaf: Leaf, log: list[str]
) -> None:
    class Raises(Behaviour):
        def update(self) -> Status:
            raise ZeroDivisionError

    places = [leaf("a", "R"), Raises("b")]
    pipeline = Pipeline("p", places)
    pipeline.initialise = lambda: setattr(pipeline, "_reached", 1)  # type: ignore[method-assign]
    root = Sequence("s", memory=True, children=[pipeline])
    with pytest.raises(ZeroDivisionError):
        root.tick_once()
    root.stop(Status.INVALID)
    assert log == ["a+", "ax"]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr(Every, "_now", lambda _self: now[0])
    return now


def test_a_child_is_held_back_so_long_after_its_last_success(
    leaf: Leaf, log: list[str], clock: list[float]
) -> None:
    every = Every("e", leaf("a", "RS"), 10.0)
    root = Pipeline("p", [every, leaf("b", "R")])
    assert ticked(root, log, 1) == ["a+ R"]
    clock[0] = 7.0  # the period begins with the success
    assert ticked(root, log, 1) == ["aS b+ R"]
    clock[0] = 16.0
    assert (ticked(root, log, 1), every.due_in()) == (["R"], 1.0)
    clock[0] = 17.0
    assert (ticked(root, log, 1), every.due_in()) == (["a+ R"], None)


def test_the_period_ends_with_a_failure_and_with_a_stop(
    leaf: Leaf, log: list[str], clock: list[float]
) -> None:
    root = Every("e", leaf("a", "S"), 10.0)
    assert ticked(root, log, 2) == ["a+ aS S", "R"]
    root.stop(Status.INVALID)
    assert ticked(root, log, 1) == ["a+ aS S"]
    root = Every("e", leaf("a", "S F S"), 10.0)
    root.tick_once()
    clock[0] = 11.0
    assert ticked(root, log, 2) == ["a+ aF F", "a+ aS S"]


def test_without_a_period_a_child_succeeds_once_in_a_visit(leaf: Leaf, log: list[str]) -> None:
    every = Every("e", leaf("a", "S"), None)
    root = Pipeline("p", [every, leaf("b", "RRS")])
    assert ticked(root, log, 2) == ["a+ aS b+ R", "R"]
    assert every.due_in() is None
    assert ticked(root, log, 1) == ["bS S"]
    assert ticked(root, log, 1) == ["a+ aS b+ R"]


def test_a_period_in_a_repeat_lies_between_two_rounds(
    leaf: Leaf, log: list[str], clock: list[float]
) -> None:
    root = Repeat("r", Every("e", leaf("a", "S"), 10.0), None)
    assert ticked(root, log, 2) == ["a+ aS R", "R"]
    assert root.due_in() is None
    clock[0] = 10.0
    assert ticked(root, log, 1) == ["a+ aS R"]


# In turn


def test_a_visit_begins_behind_the_child_that_has_succeeded_last(
    leaf: Leaf, log: list[str]
) -> None:
    root = InTurn("t", [leaf("a", "S"), leaf("b", "F"), leaf("c", "S")])
    assert ticked(root, log, 3) == ["a+ aS S", "b+ bF c+ cS S", "a+ aS S"]


def test_each_child_is_tried_once_and_after_all_have_failed_the_first_is_next(
    leaf: Leaf, log: list[str]
) -> None:
    root = InTurn("t", [leaf("a", "S F"), leaf("b", "RF")])
    assert ticked(root, log, 4) == ["a+ aS S", "b+ R", "bF a+ aF F", "a+ aF b+ R"]


def test_after_a_stop_while_it_ran_the_first_is_next(leaf: Leaf, log: list[str]) -> None:
    root = InTurn("t", [leaf("a", "S"), leaf("b", "R")])
    assert ticked(root, log, 2) == ["a+ aS S", "b+ R"]
    root.stop(Status.INVALID)
    assert ticked(root, log, 1) == ["a+ aS S"]
    root.stop(Status.INVALID)  # of a visit that is over
    assert ticked(root, log, 1) == ["b+ R"]


# Resumed


def test_a_sequence_goes_on_with_the_child_that_failed(leaf: Leaf, log: list[str]) -> None:
    root = Resume("s", [leaf("a", "S"), leaf("b", "F S"), leaf("c", "S")])
    assert ticked(root, log, 3) == ["a+ aS b+ bF F", "b+ bS c+ cS S", "a+ aS b+ bS c+ cS S"]


def test_a_sequence_goes_on_with_the_child_that_was_stopped(leaf: Leaf, log: list[str]) -> None:
    root = Resume("s", [leaf("a", "S"), leaf("b", "RS")])
    root.tick_once()
    root.stop(Status.INVALID)
    assert ticked(root, log, 2) == ["b+ R", "bS S"]


# Until


@pytest.mark.parametrize(
    ("times", "answers", "told"),
    [
        (None, "FFS", ["R", "R", "S"]),
        (2, "FFS", ["R", "F"]),
        (2, "S", ["S"]),
        (0, "", ["S"]),
    ],
)
def test_rounds_end_when_the_condition_holds_and_fail_where_it_never_did(
    leaf: Leaf, times: int | None, answers: str, told: list[str]
) -> None:
    asked = iter(answers)
    root = Repeat("r", leaf("a", "S"), times, lambda: next(asked) == "S")
    assert [each[-1] for each in ticked(root, [], len(told))] == told
    if told[-1] == "F":
        assert (root.refused, root.feedback_message) == (
            True,
            "the condition does not hold after 2 rounds",
        )
