"""The state that events fold to: what became of each action, and by whose failure a tree failed."""

from __future__ import annotations

from pathlib import Path

import pytest
from py_trees.common import Status

from bt_actions.document import load_tree
from bt_actions.events import (
    EventsLost,
    Moment,
    Paused,
    RunEnded,
    ServerSeen,
    StopWanted,
    TreeFinished,
    VariableWritten,
)
from bt_actions.goals.policy import End, Outcome
from bt_actions.story.actions import ActionStory
from bt_actions.story.state import KEPT, State
from bt_actions.testing import VirtualRunner
from tests.support.stories import state_of
from tests.support.told_trees import FakeAction, FakeNode, Story


@pytest.fixture
def leaf() -> FakeNode:
    return FakeAction("Move")


@pytest.fixture
def story(leaf: FakeNode) -> Story:
    return Story(leaf, step=1.0)


def only(state: State) -> ActionStory:
    (action,) = state.actions
    return action


def test_a_tree_that_never_started_took_no_time() -> None:
    """Its setup raised; the clock counts from when the machine was started."""
    state = state_of([TreeFinished(Moment(1, 5000.0, 1e9, 0.0), Status.INVALID)])
    assert state.elapsed == 0.0


# Actions


def test_attempts_are_counted_over_the_retries_of_a_visit(leaf: FakeNode, story: Story) -> None:
    action = only(
        story.told(
            story.goal(leaf, "EXECUTING"),
            story.goal(leaf, "DONE", outcome=Outcome.ABORTED, end=End.ABORTED, reason="a fault"),
            story.goal(leaf, "EXECUTING", attempt=2),
            story.goal(leaf, "DONE", attempt=2, outcome=Outcome.SUCCEEDED, end=End.SUCCEEDED),
        )
    )
    assert (action.attempts, action.attempt, action.visits) == (2, 2, 1)
    assert (action.outcome, action.end, action.reason) == (Outcome.SUCCEEDED, End.SUCCEEDED, "")
    assert action.duration == pytest.approx(3.0)
    assert [goal.outcome for goal in action.tried] == [Outcome.ABORTED, Outcome.SUCCEEDED]


def test_a_leaf_that_is_visited_again_adds_to_its_action(leaf: FakeNode, story: Story) -> None:
    events = [event for visit in (1, 2, 3) for event in story.succeed(leaf, visit)]
    action = only(story.told(*events))
    assert (action.attempts, action.visits, action.failed) == (3, 3, 0)
    assert action.duration == pytest.approx(6.0)
    assert list(action.goals) == ["Move-3-1"], "what is over is kept of the latest visit alone"


def test_a_goal_keeps_what_was_sent_its_feedback_and_its_result(
    leaf: FakeNode, story: Story
) -> None:
    action = only(
        story.told(
            story.goal(leaf, "SENDING", goal={"distance": 2.0}),
            story.goal(leaf, "EXECUTING"),
            story.feedback(leaf, {"pose": 1.0}),
            story.goal(leaf, "DONE", outcome=Outcome.SUCCEEDED, result={"pose": 2.0}),
        )
    )
    goal = action.latest
    assert goal is not None
    assert (goal.goal, goal.result) == ({"distance": 2.0}, {"pose": 2.0})
    assert goal.feedback is not None
    assert goal.feedback.feedback == {"pose": 1.0}
    assert goal.accepted is not None
    assert (goal.began.steady, goal.accepted.steady, goal.since.steady) == (101.0, 102.0, 104.0)


def test_a_goal_that_was_not_sent_is_not_live(leaf: FakeNode, story: Story) -> None:
    assert not story.told(story.goal(leaf, "WAITING_FOR_SERVER")).live
    assert story.told(story.goal(leaf, "SENDING")).live


def test_what_is_left_without_waiting_keeps_its_duration(leaf: FakeNode, story: Story) -> None:
    state = story.told(story.goal(leaf, "SENDING"), story.goal(leaf, "EXECUTING"))
    story.time += 5.0
    left = StopWanted(story._next(), "again", "left without waiting", abandons=True)
    state.fold(left)
    assert state.abandoned
    state.fold(RunEnded(left.at, 3, unaccounted=tuple(state.unaccounted)))
    action = only(state)
    assert (action.duration, action.outcome) == (pytest.approx(7.0), Outcome.CANCELED)
    assert action.end is End.UNKNOWN
    assert state.unaccounted == ["Move on move_robot, goal Move-1-1: executing when left"]


def test_late_news_of_an_older_goal_leave_the_newer_one_alone(leaf: FakeNode, story: Story) -> None:
    state = story.told(
        story.goal(leaf, "EXECUTING", visit=1),
        story.goal(leaf, "CANCELING", visit=1, outcome=Outcome.CANCELED),
        story.goal(leaf, "EXECUTING", visit=2),
        story.goal(leaf, "CANCELING", visit=1, outcome=Outcome.CANCELED, end=End.UNKNOWN),
    )
    action = only(state)
    told = action.attempts, action.visits, action.state, action.outcome
    assert told == (2, 2, "EXECUTING", None)
    state.fold(story.goal(leaf, "DONE", visit=2, outcome=Outcome.SUCCEEDED))
    assert action.live, "the older goal is still being canceled"
    state.fold(story.goal(leaf, "DONE", visit=1, outcome=Outcome.CANCELED, end=End.CANCELED))
    assert not action.live
    assert (action.attempts, action.outcome) == (2, Outcome.SUCCEEDED)


def test_a_goal_that_is_still_canceling_is_live_though_its_leaf_has_an_outcome(
    leaf: FakeNode, story: Story
) -> None:
    canceled = {"outcome": Outcome.CANCELED, "end": End.UNKNOWN}
    state = story.told(story.goal(leaf, "EXECUTING"), story.goal(leaf, "CANCELING", **canceled))
    assert state.live == state.actions
    state.fold(story.goal(leaf, "DONE", outcome=Outcome.CANCELED, end=End.CANCELED))
    assert state.live == []


def test_a_goal_whose_server_went_away_is_not_live_and_is_remembered(
    leaf: FakeNode, story: Story
) -> None:
    lost = {"outcome": Outcome.SERVER_LOST, "end": End.SERVER_GONE}
    state = story.told(story.goal(leaf, "CANCELING", **lost))
    assert (state.live, state.servers_gone) == ([], ["Move on move_robot"])


def test_an_action_that_runs_has_a_duration_too(leaf: FakeNode, story: Story) -> None:
    state = story.told(story.goal(leaf, "EXECUTING"), story.goal(leaf, "CANCELING"))
    assert only(state).seconds(state.latest) == pytest.approx(1.0)


def test_the_leaf_s_own_judgement_wins_over_the_server_s(leaf: FakeNode, story: Story) -> None:
    done = story.goal(leaf, "DONE", outcome=Outcome.SUCCEEDED, end=End.SUCCEEDED)
    state = story.told(
        done,
        story.verdict(leaf, Outcome.UNEXPECTED_RESULT, "not held"),
        story.node(leaf, Status.FAILURE),
        done,
    )
    action = only(state)
    assert (action.outcome, action.reason) == (Outcome.UNEXPECTED_RESULT, "not held")
    assert action.end is End.SUCCEEDED
    assert action.duration == pytest.approx(0.0)


def test_a_leaf_says_why_it_did_not_try_again(leaf: FakeNode, story: Story) -> None:
    gone = {"outcome": Outcome.STALLED, "end": End.SERVER_GONE, "reason": "silent"}
    why = "silent (not tried again: its server went away)"
    state = story.told(
        story.goal(leaf, "CANCELING", **gone), story.verdict(leaf, Outcome.STALLED, why)
    )
    assert (only(state).outcome, only(state).reason) == (Outcome.STALLED, why)


# Failures


def test_of_a_fallback_each_child_that_failed_is_named_and_of_a_sequence_only_the_one() -> None:
    first, second, never, last = (FakeAction(name) for name in ("a", "b", "c", "d"))
    main = FakeNode("main", [first, second, never])
    wrapped = FakeNode("not", [last], "invert")
    end = FakeNode("not delivered", kind="failure")
    root = FakeNode("root", [main, wrapped, end], "fallback")
    story = Story(root)
    state = story.told(
        *story.succeed(first),
        *story.fail(second),
        story.node(main, Status.FAILURE),
        *story.succeed(last),
        story.node(wrapped, Status.FAILURE),
        story.node(end, Status.FAILURE),
        story.node(root, Status.FAILURE),
        story.finish(Status.FAILURE),
    )
    assert [failure.path[-1] for failure in state.failures] == ["b", "not", "not delivered"]


ANOTHER_EACH_TIME = (
    "{retry: R, attempts: 2, child: {sequence: S, children: [{set: {m: = $m + 1}},"
    " {check: $m != 2, name: A}, {check: $m != 1, name: B}]}}"
)

ANOTHER_REASON_EACH_TIME = (
    "{retry: R, attempts: 2, child: {sequence: S, children: [{set: {m: = $m + 1}},"
    " {while: $m != 2, name: W, child: {failure: Z}}]}}"
)


@pytest.mark.parametrize(
    ("written", "failures"),
    [
        ("{timeout: T, after: 10 ms, child: {running: R}}", {"T": "not done within 0.01 s"}),
        ("{while: false, name: W, child: {wait: 1 s}}", {"W": "the condition does not hold"}),
        ("{repeat: R, times: $n, child: {success: S}}", {"R": "times"}),
        ("{invert: I, child: {success: S}}", {"I": "success"}),
        ("{force_failure: G, child: {success: S}}", {"G": "success is failure"}),
        (
            "{invert: I, child: {fallback: F, children: [{failure: A}, {success: B}]}}",
            {"I": "success"},
        ),
        ("{for_each: F, in: $l, as: m, child: {success: A}}", {"F": "item 2 of 2: m: 300 does"}),
        ("{subtree: sub.yaml, save: {m: z}}", {"sub": "m: 500 does not fit an int8"}),
        (ANOTHER_REASON_EACH_TIME, {"W": "the condition does not hold"}),
        (ANOTHER_EACH_TIME, {"A": ""}),
    ],
    ids=[
        "timeout",
        "while",
        "repeat",
        "invert",
        "force",
        "invert a fallback",
        "for_each",
        "subtree",
        "reasons",
        "retry",
    ],
)
def test_who_failed_is_named_and_nobody_who_did_not_run(
    tmp_path: Path, written: str, failures: dict[str, str]
) -> None:
    tree = tmp_path / "t.yaml"
    tree.write_text(
        "tree: t\n"
        "inputs: {n: {type: int32, default: -1}, l: {type: 'int32[]', default: [1, 300]}}\n"
        "outputs: {m: int8}\n"
        f"root: {{sequence: t, children: [{{set: {{m: 0}}}}, {written}]}}\n"
    )
    (tmp_path / "sub.yaml").write_text("tree: sub\noutputs: {z: int32}\nroot: {set: {z: 500}}\n")
    runner = VirtualRunner(load_tree(tree))
    runner.run()
    named = {failure.path[-1]: failure.message for failure in state_of(runner.events).failures}
    assert list(named) == list(failures)
    for name, message in failures.items():
        assert named[name].startswith(message)


def test_a_tree_that_succeeded_has_no_failures_though_a_leaf_failed(leaf: FakeNode) -> None:
    recover = FakeNode("Recover", kind="success")
    root = FakeNode("root", [leaf, recover], "fallback")
    story = Story(root)
    state = story.told(
        *story.fail(leaf),
        story.node(recover, Status.SUCCESS),
        story.node(root, Status.SUCCESS),
        story.finish(Status.SUCCESS),
    )
    assert state.failures == []
    (failure,) = state.dealt_with
    assert failure.node.name == "Move"
    assert failure.by is not None
    assert failure.by.name == "root"


def test_a_failure_that_a_retry_goes_on_after_is_dealt_with_by_it_and_has_its_item(
    leaf: FakeNode,
) -> None:
    retry = FakeNode("Try", [leaf], "retry")
    each = FakeNode("Each", [retry], "for_each")
    story = Story(each)
    state = story.told(
        story.round(each, 4, "r1"),
        story.round(retry, 0),
        *story.fail(leaf, "a fault", 1),
        story.round(retry, 1),
        *story.fail(leaf, "another", 2),
        *(story.node(node, Status.FAILURE) for node in (retry, each)),
        story.finish(Status.FAILURE),
    )
    (dealt,), (failure,) = state.dealt_with, state.failures
    assert (dealt.by and dealt.by.name, failure.by) == ("Try", None)
    for found, reason, number in ((dealt, "a fault", 0), (failure, "another", 1)):
        assert found.message == f"ABORTED: {reason}"
        assert [goal.reason for goal in found.attempts] == [reason]
        rounds = [(loop.name, begun.number, begun.item) for loop, begun in found.items]
        assert rounds == [("Each", 4, "r1"), ("Try", number, None)]
    assert only(state).failed == 2


def test_of_failures_that_were_dealt_with_the_latest_are_kept_and_all_are_counted(
    leaf: FakeNode,
) -> None:
    root = FakeNode("root", [leaf], "force_success")
    story, many = Story(root), KEPT + 20
    events = []
    for visit in range(many):
        events += [*story.fail(leaf, str(visit), visit), story.node(root, Status.SUCCESS)]
    state = story.told(*events)
    assert (state.dealt_with_in_all, len(state.dealt_with)) == (many, KEPT)
    assert state.dealt_with[-1].message == f"ABORTED: {many - 1}"


def test_a_node_that_fails_again_is_told_of_its_own_visit_alone() -> None:
    """In its second visit the first child succeeds."""
    first, second = FakeNode("a", kind="check"), FakeNode("b", kind="check")
    root = FakeNode("root", [first, second], "fallback")
    story = Story(retry := FakeNode("retry", [root], "retry"))
    fails, succeeds = Status.FAILURE, Status.SUCCESS
    state = story.told(
        *(story.node(node, fails) for node in (first, second, root)),
        *(story.node(node, succeeds) for node in (first, root)),
        *(story.node(node, fails) for node in (first, second, root, retry)),
        story.finish(fails),
    )
    assert [each.path[-1] for each in state.failures] == ["a", "b"]
    assert [(each.node.name, each.by) for each in state.dealt_with] == [
        (name, state.nodes[retry.id].node) for name in ("a", "b")
    ]
    assert [state.nodes[each.id].visits for each in (root, first, second)] == [3, 3, 2]


def test_a_failure_by_itself_is_not_that_of_what_is_below(leaf: FakeNode) -> None:
    gate = FakeNode("W", [leaf], "while")
    story = Story(gate)
    state = story.told(
        *story.fail(leaf),
        story.node(gate, Status.FAILURE, "the condition does not hold", by_itself=True),
        story.finish(Status.FAILURE),
    )
    assert [failure.path for failure in state.failures] == [("W",)]
    assert [(each.node.name, each.by and each.by.name) for each in state.dealt_with] == [
        ("Move", "W")
    ]


# The run


def test_a_run_that_begins_anew_forgets_the_one_before(leaf: FakeNode, story: Story) -> None:
    state = story.told(*story.fail(leaf), story.finish(Status.FAILURE), Paused(story._next(), True))
    state.fold(story.began)
    assert (state.actions, state.failures, state.finished) == ([], [], None)
    assert not state.paused
    assert state.status_of(1) is Status.INVALID


def test_a_node_that_was_inserted_is_one_of_the_tree(leaf: FakeNode) -> None:
    root = FakeNode("root", [leaf])
    story, added = Story(root), FakeAction("Move")
    state = story.told(story.add(added, root), story.goal(added, "EXECUTING"))
    assert state.path(added.id) == ("root", "Move")
    assert state.in_order() == [root.id, leaf.id, added.id]
    assert only(state).node.id == added.id


def test_the_state_keeps_what_was_told_of_variables_servers_pause_and_loss(story: Story) -> None:
    state = story.told(
        VariableWritten(story._next(), "x", 1, None),
        VariableWritten(story._next(), "x", 2, 1),
        ServerSeen(story._next(), "/move", True),
        ServerSeen(story._next(), "/move", False),
        Paused(story._next(), True),
        EventsLost(story._next(), 3),
        EventsLost(story._next(), 4),
    )
    assert state.variables["x"].value == 2
    assert not state.servers["/move"].in_sight
    assert (state.paused, state.lost) == (True, 7)


def test_the_first_wish_to_stop_counts_and_a_later_one_may_leave(story: Story) -> None:
    state = story.told(StopWanted(story._next(), "SIGINT", "interrupted by SIGINT"))
    assert not state.abandoned
    state.fold(StopWanted(story._next(), "again", "left without waiting", abandons=True))
    assert state.stop is not None
    assert (state.stop.who, state.abandoned) == ("SIGINT", True)


def test_a_root_is_always_there() -> None:
    leaf = FakeNode("Leaf")
    story = Story(FakeNode("Root", [leaf]))
    state = story.told(story.node(leaf, Status.SUCCESS), story.remove(story.root))
    assert state.in_order() == [story.root.id, leaf.id]
    assert State().in_order() == []
