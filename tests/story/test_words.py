"""What is said of a run in words: the table, the summary, goals, messages, the last lines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.document.describing import describe
from bt_actions.events import Cut, Event, Moment, RunEnded
from bt_actions.events.snapshot import snapshot
from bt_actions.goals.policy import End, Outcome
from bt_actions.messages.fields import fields_in_words
from bt_actions.story.actions import ActionStory
from bt_actions.story.state import State
from bt_actions.story.table import verdict
from bt_actions.story.values import constants_of, feedback_text, fields_text
from bt_actions.story.words import action_table, goal_text, last_words, result_lines
from bt_actions.utilities.shorten import MESSAGE
from tests.support.told_trees import FakeAction, FakeNode, Story

NOWHERE = Moment(0, 0.0, 0.0, 0.0)


@pytest.fixture
def leaf() -> FakeNode:
    return FakeAction("Move")


@pytest.fixture
def story(leaf: FakeNode) -> Story:
    return Story(leaf, step=1.0)


def action_of(story: Story, *events: Event) -> ActionStory:
    (action,) = story.told(*events).actions
    return action


def words(state: State, exit_code: int = 0, **more: Any) -> list[str]:
    """The last words of a run that ended so."""
    state.fold(RunEnded(state.now or NOWHERE, exit_code, **more))
    return last_words(state)


# The end


def test_a_tree_that_never_started_took_no_time(story: Story) -> None:
    state = State()
    state.fold(story.finish(Status.INVALID))
    assert words(state, 1) == ["", "STOPPED after 0.00 s"]


@pytest.mark.parametrize("end", [End.SERVER_GONE, End.ABORTED])
def test_what_a_server_may_go_on_with_is_said_and_what_to_do(
    leaf: FakeNode, story: Story, end: End
) -> None:
    """But not of a simulation, which ends with the run."""
    events = (
        story.goal(leaf, "CANCELING", outcome=Outcome.SERVER_LOST, end=end),
        story.node(leaf, Status.FAILURE),
        story.finish(Status.FAILURE),
    )

    def hints(exit_code: int, **more: str) -> int:
        said = words(story.told(*events), exit_code, **more)
        return sum("`bt-actions cleanup move_robot`" in line for line in said)

    assert hints(1) == (end is End.SERVER_GONE)
    assert hints(130, cause="interrupted by SIGINT") == (end is End.SERVER_GONE)
    gone = story.told(*events).servers_gone
    assert gone == (["Move on move_robot"] if end is End.SERVER_GONE else [])
    where = {"simulation": "--sim --speed 1"}
    story.began = replace(story.began, where=where)
    assert not hints(1)


def test_a_success_that_warns_is_told_at_the_end(leaf: FakeNode, story: Story) -> None:
    warned = story.node(leaf, Status.SUCCESS, warning="nobody listens on /lamp")
    said = words(story.told(warned, story.finish(Status.SUCCESS)))
    assert said[-1] == "warning: Move: nobody listens on /lamp"


@pytest.mark.parametrize("where", ["tree", "run"])
def test_what_a_behaviour_raised_is_said_last(story: Story, where: str) -> None:
    """In the tree, or as the run was begun or closed."""
    error = "RuntimeError: a bug (own.py:3)"
    tree, run = ({"error": error if here == where else ""} for here in ("tree", "run"))
    assert words(story.told(story.finish(Status.INVALID, **tree)), 1, **run)[-1].endswith(error)


# The table


def test_a_success_after_its_deadline_is_told_as_late(leaf: FakeNode, story: Story) -> None:
    ended = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
    late = story.goal(leaf, "DONE", **ended, reason="late: not finished within 1 s")
    assert verdict(action_of(story, late)) == "SUCCEEDED, late"
    judged = story.verdict(leaf, Outcome.SUCCEEDED)
    assert verdict(action_of(story, late, judged)) == "SUCCEEDED, late"
    assert verdict(action_of(story, story.goal(leaf, "DONE", **ended))) == "SUCCEEDED"


def test_of_many_visits_the_table_tells_how_many_and_which_failed(
    leaf: FakeNode, story: Story
) -> None:
    visits = [story.succeed(leaf, 1), story.succeed(leaf, 2), story.succeed(leaf, 3)]
    state = story.told(*(event for events in visits for event in events))
    assert action_table(state)[1].split("  ")[-3:] == [
        "3 in 3 visits",
        "SUCCEEDED",
        "6.00 s in all",
    ]
    assert goal_text(state.actions[0]) == "SUCCEEDED"
    visits[0] = story.fail(leaf, "a fault", 1)
    state = story.told(*(event for events in visits for event in events))
    assert verdict(state.actions[0]) == "SUCCEEDED, 1 of 3 visits failed"
    assert verdict(action_of(story, *story.fail(leaf, "a fault"))) == "ABORTED"


def test_an_end_that_nobody_waited_for_is_told(leaf: FakeNode, story: Story) -> None:
    canceled = {"outcome": Outcome.CANCELED, "end": End.SUCCEEDED}
    events = story.goal(leaf, "EXECUTING"), story.goal(leaf, "DONE", **canceled)
    assert verdict(action_of(story, *events)) == "CANCELED, end SUCCEEDED"


@pytest.mark.parametrize(
    ("outcome", "told"),
    [(Outcome.CANCELED, "CANCELED, end SERVER_GONE"), (Outcome.SERVER_LOST, "SERVER_LOST")],
)
def test_a_goal_that_may_run_on_where_its_server_went_is_no_canceled_one(
    leaf: FakeNode, story: Story, outcome: Outcome, told: str
) -> None:
    gone = story.goal(leaf, "CANCELING", outcome=outcome, end=End.SERVER_GONE)
    assert verdict(action_of(story, story.goal(leaf, "EXECUTING"), gone)) == told


def test_the_table_has_a_line_for_each_action_and_fits_the_width() -> None:
    leaves = [FakeAction("A name that is long " * 3, server="/r1/" + "x" * 30), FakeAction("b")]
    story = Story(FakeNode("root", leaves), step=1.0)
    state = story.told(*story.succeed(leaves[0]), *story.succeed(leaves[1]))
    assert len(action_table(state)) == 3
    assert action_table(state)[2].split() == ["b", "move_robot", "1", "SUCCEEDED", "2.00", "s"]
    for width in (40, 60, 80):
        assert max(len(line) for line in action_table(state, width)) <= max(width, 55)


def test_actions_that_were_never_tried_are_not_in_the_table(story: Story) -> None:
    assert action_table(story.told(story.finish(Status.FAILURE))) == []


# Messages


def told_leaf(kind: Any) -> FakeNode:
    """A leaf for actions of a type, described as a run describes it."""
    node = describe(ActionBehaviour("Move", kind, "move_robot", kind.Goal()), 1, None)
    return FakeAction("Move", **node.settings)


def ended_with(kind: Any, result: object, feedback: object = None) -> ActionStory:
    leaf = told_leaf(kind)
    story = Story(leaf)
    return action_of(
        story,
        story.goal(leaf, "EXECUTING"),
        story.feedback(leaf, snapshot(feedback)),
        story.goal(leaf, "DONE", outcome=Outcome.ABORTED, result=snapshot(result)),
    )


def test_a_message_in_words_shows_constants_by_name() -> None:
    from robot_control_interfaces.action import Gripper, MoveRobot

    result = MoveRobot.Result(final_pose=2.0, status=MoveRobot.Result.STATUS_FAULT, message="hot")
    feedback = MoveRobot.Feedback(current_pose=1.5, status=MoveRobot.Feedback.STATUS_MOVING)
    action = ended_with(MoveRobot, result, feedback)
    told = fields_text(snapshot(result), constants_of(action, "result"))
    assert told == "final_pose 2.00, status FAULT, message hot"
    assert feedback_text(action) == "current_pose 1.50, status MOVING"
    assert "  status: 3  # FAULT" in result_lines(action)
    stalled = fields_text(snapshot(Gripper.Feedback(stalled=True)), {})
    assert stalled.startswith("position 0.00, stalled true")


LARGE = [7] * 1_000_000


def test_long_values_are_shortened_in_words() -> None:
    from robot_control_interfaces.action import MoveRobot
    from test_msgs.action import Fibonacci

    story = Story(FakeNode("Done", kind="success"))
    outputs = {"many": tuple(LARGE), "text": "x" * 1_000_000}
    state = story.told(story.finish(Status.SUCCESS, outputs=outputs))
    assert last_words(state)[1:3] == [
        "many: [7, 7, 7, … 1000000 items]",
        f"text: {'x' * 131} … {'x' * 66}",
    ]
    result = result_lines(ended_with(Fibonacci, Fibonacci.Result(sequence=LARGE)))
    assert result == ["  sequence:", "  - 7", "  - 7", "  - 7", "  - … 1000000 items"]
    message = snapshot(MoveRobot.Result(message="x" * 1_000_000))
    assert fields_text(message, {}).endswith(f", message {'x' * 51} … {'x' * 25}…")


def test_an_output_of_plain_data_is_told_as_it_is_written() -> None:
    """As the values of variables are: what was cut is counted, not described."""
    story = Story(FakeNode("Done", kind="success"))
    outputs = {"pose": {"x": 1.0, "who": "r1"}, "cut": Cut((7, 8), 48), "none": ()}
    state = story.told(story.finish(Status.SUCCESS, outputs=outputs))
    assert last_words(state)[1:4] == [
        "pose: {x: 1.0, who: 'r1'}",
        "cut: [7, 8, … 50 items]",
        "none: []",
    ]


def test_without_a_result_there_are_no_lines(leaf: FakeNode, story: Story) -> None:
    assert result_lines(action_of(story, story.goal(leaf, "DONE", outcome=Outcome.ABORTED))) == []


def test_reasons_of_any_length_leave_the_end_of_a_run_with_lines_that_can_be_read() -> None:
    leaf, reason = FakeAction("n" * 400, server=f"/{'s' * 200}"), "the motor\nis hot; " * 300
    story = Story(leaf)
    ended = {"unaccounted": (f"Move on /move_robot, goal 01: {reason}",) * 2, "error": reason}
    state = story.told(*story.fail(leaf, reason), story.finish(Status.FAILURE))
    said = words(state, 1, **ended)
    assert all(len(line) <= MESSAGE and "\n" not in line for line in said), said
    assert state.failures[0].action.reason == reason  # type: ignore[union-attr]


def test_a_ros_message_in_words_shows_constants_by_name() -> None:
    """What a leaf's `feedback_message` says; of an event `fields_text` says the same."""
    result = MoveRobot.Result(final_pose=2.0, status=MoveRobot.Result.STATUS_FAULT, message="hot")
    assert fields_in_words(result) == "final_pose 2.00, status FAULT, message hot"
