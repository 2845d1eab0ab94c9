"""What the goals of each action came to over several runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from bt_actions.goals.policy import End, Outcome
from bt_actions.recording.reading import Item, RecordingError
from bt_actions.recording.statistics import PHASES, Spread, Statistics
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.virtual_runs import NIGHT, run_of

MOVE = ("/move_robot", "MoveRobot")


@pytest.fixture
def leaf() -> FakeNode:
    return FakeAction("Move", server="/move_robot")


def told(leaf: FakeNode, *seconds: float, outcome: Outcome, end: End) -> list[Item]:
    """A goal that passes its states, each for some seconds, and is judged."""
    story = Story(FakeNode("Root", [leaf]), step=0.0)
    events: list[Item] = [story.began]
    for state, lasts in zip(PHASES, seconds, strict=False):
        events.append(story.goal(leaf, state))
        story.time += lasts
    events.append(story.goal(leaf, "DONE", outcome=outcome, end=end))
    return events


def test_the_seconds_of_each_phase_are_those_between_two_states_of_a_goal(leaf: FakeNode) -> None:
    statistics = Statistics()
    canceled: Any = {"outcome": Outcome.CANCELED, "end": End.CANCELED}
    statistics.add(told(leaf, 1.0, 2.0, 0.5, 10.0, 0.25, **canceled))
    figures = statistics.actions[MOVE]
    assert figures.phases == {
        "QUEUED": Spread(1, 1.0, 1.0, 1.0),
        "WAITING_FOR_SERVER": Spread(1, 2.0, 2.0, 2.0),
        "SENDING": Spread(1, 0.5, 0.5, 0.5),
        "EXECUTING": Spread(1, 10.0, 10.0, 10.0),
        "CANCELING": Spread(1, 0.25, 0.25, 0.25),
    }
    assert figures.outcomes == {"CANCELED": 1}


def test_of_many_goals_half_and_95_in_a_hundred_took_at_most_that_long(leaf: FakeNode) -> None:
    statistics = Statistics()
    well: Any = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
    for seconds in reversed(range(1, 101)):
        statistics.add(told(leaf, 0.0, 0.0, 0.0, float(seconds), **well))
    figures = statistics.actions[MOVE]
    assert figures.phases["EXECUTING"] == Spread(100, 50.0, 95.0, 100.0)
    assert (figures.runs, figures.attempts, figures.sent) == (100, 100, 100)
    assert figures.success == 1.0


def test_the_leaf_has_the_last_word_on_an_outcome(leaf: FakeNode) -> None:
    statistics, story = Statistics(), Story(FakeNode("Root", [leaf]))
    done: Any = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
    statistics.add(
        [
            story.began,
            story.goal(leaf, "SENDING"),
            story.goal(leaf, "DONE", **done),
            story.verdict(leaf, Outcome.UNEXPECTED_RESULT),
            story.goal(leaf, "DONE", **done),
            story.goal(leaf, "WAITING_FOR_SERVER", attempt=2),
        ]
    )
    figures = statistics.actions[MOVE]
    assert figures.outcomes == {"UNEXPECTED_RESULT": 1}
    assert figures.success == 0.0
    assert (figures.attempts, figures.sent) == (2, 1)


def test_actions_are_told_apart_by_server_and_type() -> None:
    statistics = Statistics()
    for server, action in (("/a", "Move"), ("/b", "Move"), ("/a", "Turn")):
        leaf = FakeNode("Leaf", [], "move", server, action)
        story = Story(FakeNode("Root", [leaf]))
        statistics.add([story.began, story.goal(leaf, "SENDING")])
    assert set(statistics.actions) == {("/a", "Move"), ("/b", "Move"), ("/a", "Turn")}
    assert all(each.success is None for each in statistics.actions.values())


def test_shifts_are_counted_as_they_went() -> None:
    statistics = Statistics()
    statistics.add(run_of(NIGHT))
    statistics.add(run_of(NIGHT, "move_robot:12:abort"))
    move, grip = statistics.actions[MOVE], statistics.actions["/gripper_control", "Gripper"]
    assert (move.runs, grip.runs) == (2, 2)
    assert move.outcomes["ABORTED"] == 1
    assert grip.outcomes["UNEXPECTED_RESULT"] == 12
    assert move.sent == move.attempts == move.outcomes.total()


def test_a_run_that_cannot_be_read_to_its_end_is_not_counted(leaf: FakeNode) -> None:
    def cut() -> Iterator[Item]:
        yield from told(leaf, 1.0, outcome=Outcome.SUCCEEDED, end=End.SUCCEEDED)
        raise RecordingError("noise")

    statistics = Statistics()
    with pytest.raises(RecordingError):
        statistics.add(cut())
    assert not statistics.actions


def test_goals_behind_files_that_are_gone_have_their_type(leaf: FakeNode) -> None:
    statistics, story = Statistics(), Story(FakeNode("Root", [leaf]))
    statistics.add([story.told(), story.goal(leaf, "SENDING")])
    assert set(statistics.actions) == {MOVE}
