"""What stays of events for those who may know no values."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from py_trees.common import Status

from bt_actions.behaviours.reading import Reading
from bt_actions.events import AttemptEnded, GoalChanged, Moment, NodeChanged, to_line
from bt_actions.events.bare import bare, said
from bt_actions.goals.policy import Outcome

AT = Moment(1, 0.0, 0.0, 0.0)
SECRET = "John Doe"


@pytest.mark.parametrize(
    ("text", "stays"),
    [
        (
            f"canceled by another client; part of {SECRET} weighs 3.125 kg",
            "canceled by another client",
        ),
        ("aborted by /move_robot; its result is: {a: 1}", "aborted by /move_robot"),
        ("rejected by /move_robot; goal {distance: 1.0}", "rejected by /move_robot"),
        ("the server died or was restarted", "the server died or was restarted"),
    ],
)
def test_of_a_reason_stays_what_its_server_cannot_have_said(text: str, stays: str) -> None:
    assert said(text) == stays
    told = bare(GoalChanged(AT, 1, "ab", 1, "DONE", Outcome.ABORTED, None, text, "/x"))
    assert isinstance(told, GoalChanged)
    assert told.reason == stays


@pytest.mark.parametrize(
    ("message", "stays"),
    [
        (f"REJECTED {SECRET}, 3.125 kg", "REJECTED"),
        (f"ABORTED (attempt 2 of 3): {SECRET}", "ABORTED"),
        ("SUCCEEDED", "SUCCEEDED"),
        (f"REJECTED,{SECRET}", ""),
        (f"{SECRET} was REJECTED", ""),
    ],
)
def test_of_what_a_node_says_stays_the_name_of_an_outcome(message: str, stays: str) -> None:
    told = bare(NodeChanged(AT, 1, Status.FAILURE, message))
    assert isinstance(told, NodeChanged)
    assert told.message == stays


@pytest.mark.parametrize("expect", ["int(result.name) > 1", "result.name", "result.name.part"])
def test_of_a_condition_that_cannot_be_judged_the_value_is_not_told(expect: str) -> None:
    reason = Reading(expect, {}).read(SimpleNamespace(name=SECRET))
    assert SECRET in reason
    told = bare(AttemptEnded(AT, 1, "ab", 1, Outcome.UNEXPECTED_RESULT, reason, expect))
    assert told is not None
    assert SECRET not in to_line(told)
    assert expect in to_line(told)


def test_of_a_goal_that_cannot_be_built_no_value_is_told() -> None:
    reason = f"'{SECRET}' is no number"
    given = Outcome.INVALID_GOAL, None, reason, "/x"
    for event in (
        GoalChanged(AT, 1, "ab", 1, "DONE", *given),
        AttemptEnded(AT, 1, "ab", 1, Outcome.INVALID_GOAL, reason),
    ):
        told = bare(event)
        assert told is not None
        assert SECRET not in to_line(told)
