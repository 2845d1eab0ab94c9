"""Why a run waits, or has failed, in lines."""

from __future__ import annotations

import pytest
from py_trees.common import Status

from bt_actions.goals.policy import End, Outcome
from bt_actions.story.state import State
from bt_actions.story.why import why
from tests.support.told_trees import FakeAction, FakeNode, Story


@pytest.fixture
def leaf() -> FakeNode:
    return FakeAction("Move", place="trees/x.yaml:14:9")


@pytest.fixture
def story(leaf: FakeNode) -> Story:
    return Story(FakeNode("Deliver", [leaf]))


def lines(state: State) -> list[str]:
    """Why it failed, without times of the day."""
    return [line.partition("  ")[2] if line[2:3] == ":" else line for line in why(state)]


def test_a_failure_names_path_attempts_outcome_reason_and_place(
    leaf: FakeNode, story: Story
) -> None:
    first, second, failed = story.fail(leaf, "a fault")
    again = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": "another"}
    state = story.told(
        first,
        second,
        story.goal(leaf, "DONE", attempt=2, **again),
        failed,
        story.node(story.root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    said = lines(state)
    assert said[0] == "Deliver / Move"
    assert any("attempt 1" in line and "ABORTED: a fault" in line for line in said), said
    assert any("attempt 2" in line and "ABORTED: another" in line for line in said), said
    assert any("trees/x.yaml:14:9" in line for line in said), said


def test_a_failure_tells_the_attempts_of_its_last_visit(leaf: FakeNode, story: Story) -> None:
    state = story.told(
        *story.succeed(leaf, 1),
        *story.fail(leaf, "an older fault", 2),
        *story.fail(leaf, "a fault", 3),
        story.node(story.root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    said = "\n".join(lines(state)[:3])
    assert "ABORTED: a fault" in said
    assert "older" not in said
    assert "attempt" not in said


def test_a_tree_that_succeeded_has_nothing_to_say(leaf: FakeNode, story: Story) -> None:
    assert why(story.told(*story.succeed(leaf), story.finish(Status.SUCCESS))) == []
