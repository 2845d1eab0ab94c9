"""Two runs of a tree, compared: what counts as a difference, and which one is the first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from py_trees.common import Status

from bt_actions.events import Cut, Event, GoalChanged
from bt_actions.events.bare import bare
from bt_actions.events.snapshot import HIDDEN
from bt_actions.goals.policy import End, Outcome
from bt_actions.recording.comparing import Parting, Places, Walk, alike, parting
from bt_actions.recording.reading import RecordingError
from tests.support.every_kind import every_kind
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.virtual_runs import NIGHT, run_of


def compare(a: list[Event], b: list[Event], tolerance: float = 0.0) -> Parting | None:
    places = Places()
    found = parting((Walk(a, places), Walk(b, places)), places, tolerance)
    swapped = parting((Walk(b, places), Walk(a, places)), places, tolerance)
    assert (found is None) == (swapped is None)
    if found is not None and swapped is not None:
        assert swapped.path == found.path
        assert swapped.sides == found.sides[::-1]
    return found


def said(found: Parting | None) -> tuple[str, ...]:
    """Where two runs part, and what either did there."""
    assert found is not None
    texts = ("nothing" if each is None else each.text for each in found.sides)
    return (" / ".join(found.path), *texts)


class Tree:
    """Two actions side by side, or one after the other; the same nodes for each story."""

    def __init__(self, kind: str = "sequence", step: float = 0.5) -> None:
        self.left, self.right = FakeAction("Left"), FakeAction("Right")
        self.check = FakeNode("Check", kind="check")
        self.root = FakeNode("Root", [self.check, self.left, self.right], kind)
        self.story = Story(self.root, step)

    def run(self, *events: Event | list[Event]) -> list[Event]:
        told = [self.story.began]
        for each in events:
            told += each if isinstance(each, list) else [each]
        return told


@pytest.fixture
def tree() -> Tree:
    return Tree()


def test_two_runs_in_which_the_same_happened_at_other_times_do_not_part(tree: Tree) -> None:
    slow, story = Tree(step=7.0), tree.story
    fast = tree.run(
        story.succeed(tree.left), story.feedback(tree.left, 1.0), story.fail(tree.right)
    )
    later = slow.run(slow.story.succeed(slow.left), slow.story.fail(slow.right))
    later = [
        replace(each, goal_id=each.goal_id + "x") if isinstance(each, GoalChanged) else each
        for each in later
    ]
    assert compare(fast, later) is None


def test_a_whole_shift_does_not_part_from_a_slower_one_of_other_ids() -> None:
    assert compare(run_of(NIGHT), run_of(NIGHT, speed=8.0, seed=7), 0.01) is None


def test_a_shift_parts_where_the_twelfth_move_is_aborted() -> None:
    where, a, b = said(compare(run_of(NIGHT), run_of(NIGHT, "move_robot:12:abort"), 0.01))
    assert where == "Shift / Go home / Straight home / Home in time / Home"
    assert a.startswith("attempt 1: SUCCEEDED; goal {distance: 0.0}; result {final_pose: ")
    assert b.startswith("attempt 1: ABORTED: aborted by /move_robot; goal {distance: 0.0}; ")


@pytest.mark.parametrize("step", [0.1, 0.5, 3.0])
def test_the_earliest_difference_counts_whichever_run_was_the_faster(step: float) -> None:
    a, b = Tree(step=0.5), Tree(step=step)
    well = a.run(
        a.story.node(a.check, Status.SUCCESS), a.story.succeed(a.left), a.story.succeed(a.right)
    )
    not_well = b.run(b.story.node(b.check, Status.SUCCESS), b.story.fail(b.left, "a fault"))
    not_well.append(b.story.node(b.root, Status.FAILURE))
    found = compare(well, not_well)
    assert said(found) == ("Root / Left", "attempt 1: sends a goal", "FAILURE: ABORTED: a fault")
    assert found is not None
    assert found.common == 1
    assert found.last is not None
    assert found.last.text == "SUCCESS"


@pytest.mark.parametrize("first", ["left", "right"])
def test_branches_may_interleave_in_one_way_or_another(first: str) -> None:
    a, b = Tree("parallel"), Tree("parallel")
    one = a.run(a.story.succeed(a.left), a.story.succeed(a.right))
    lefts, rights = iter(b.story.succeed(b.left)), iter(b.story.succeed(b.right))
    mixed: list[Event] = []
    for left, right in zip(lefts, rights, strict=True):
        mixed += [left, right] if first == "left" else [right, left]
    assert compare(one, b.run(mixed)) is None


def test_a_condition_that_was_asked_more_often_is_no_difference_but_its_answers_are() -> None:
    a, b, c = Tree(), Tree(), Tree()
    yes, no = Status.SUCCESS, Status.FAILURE
    again = (yes, yes, Status.INVALID, yes, no)
    often = a.run(*(a.story.node(a.check, each) for each in again))
    once = b.run(b.story.node(b.check, yes), b.story.node(b.check, no))
    assert compare(often, once) is None
    back = c.run(*(c.story.node(c.check, each) for each in (yes, no, yes)))
    assert said(compare(once, back)) == ("Root / Check", "nothing", "SUCCESS")


def test_each_visit_of_an_action_counts(tree: Tree) -> None:
    other = Tree()
    once = tree.run(tree.story.succeed(tree.left))
    twice = other.run(other.story.succeed(other.left), other.story.succeed(other.left, visit=2))
    assert said(compare(once, twice)) == (
        "Root / Left",
        "nothing",
        "visit 2, attempt 1: sends a goal",
    )


Change = Callable[[Story, FakeNode, bool], list[Event]]


def _goal(story: Story, leaf: FakeNode, is_other: bool) -> list[Event]:
    return [story.goal(leaf, "SENDING", goal={"to": 2.0 + is_other})]


def _round(story: Story, loop: FakeNode, is_other: bool) -> list[Event]:
    return [story.round(loop, 0, "shelf" if is_other else "table")]


def _result(story: Story, leaf: FakeNode, is_other: bool) -> list[Event]:
    done: dict[str, Any] = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
    return [
        story.goal(leaf, "SENDING", goal={"to": 2.0}),
        story.goal(leaf, "DONE", result={"code": 1 + is_other}, **done),
        story.verdict(leaf, Outcome.SUCCEEDED),
    ]


def _verdict(story: Story, leaf: FakeNode, is_other: bool) -> list[Event]:
    outcome = Outcome.UNEXPECTED_RESULT if is_other else Outcome.SUCCEEDED
    return [story.goal(leaf, "SENDING", goal={"to": 2.0}), story.verdict(leaf, outcome, "why")]


def _stopped(story: Story, leaf: FakeNode, is_other: bool) -> list[Event]:
    ends = Status.INVALID if is_other else Status.SUCCESS
    return [story.node(leaf, Status.RUNNING), story.node(leaf, ends)]


def _outputs(story: Story, leaf: FakeNode, is_other: bool) -> list[Event]:
    return [story.finish(Status.SUCCESS, outputs={"count": 1 + is_other})]


@pytest.mark.parametrize(
    ("change", "node", "a", "b"),
    [
        (_goal, "left", "attempt 1: sends {to: 2.0}", "attempt 1: sends {to: 3.0}"),
        (_round, "root", "begins round 1: 'table'", "begins round 1: 'shelf'"),
        (
            _result,
            "left",
            "attempt 1: SUCCEEDED; goal {to: 2.0}; result {code: 1}",
            "attempt 1: SUCCEEDED; goal {to: 2.0}; result {code: 2}",
        ),
        (
            _verdict,
            "left",
            "attempt 1: SUCCEEDED: why; goal {to: 2.0}",
            "attempt 1: UNEXPECTED_RESULT: why; goal {to: 2.0}",
        ),
        (_stopped, "left", "SUCCESS", "is stopped"),
        (_outputs, "root", "gives {count: 1}", "gives {count: 2}"),
    ],
)
def test_a_difference_is_told_with_its_values(change: Change, node: str, a: str, b: str) -> None:
    runs = []
    for is_other in (False, True):
        tree = Tree()
        runs.append(tree.run(change(tree.story, getattr(tree, node), is_other)))
    where = "Root / Left" if node == "left" else "Root"
    assert said(compare(*runs)) == (where, a, b)


def test_the_result_of_a_canceled_goal_is_of_its_time(tree: Tree) -> None:
    runs = []
    for pose in (1.0, 2.0):
        tree = Tree()
        done: dict[str, Any] = {"outcome": Outcome.CANCELED, "end": End.CANCELED}
        runs.append(
            tree.run(
                tree.story.goal(tree.left, "SENDING", goal={"to": 2.0}),
                tree.story.goal(tree.left, "DONE", result={"pose": pose}, **done),
                tree.story.verdict(tree.left, Outcome.CANCELED),
            )
        )
    assert compare(*runs) is None


def test_a_run_without_values_does_not_part_from_one_with_them() -> None:
    night = run_of(NIGHT)
    assert compare(night, [each for event in night if (each := bare(event)) is not None]) is None


def test_siblings_of_one_name_are_told_apart() -> None:
    runs = []
    for which in (0, 1):
        twins = [FakeAction("Move"), FakeAction("Move")]
        story = Story(FakeNode("Root", twins), step=1.0 - which / 2)
        runs.append([story.began, *story.fail(twins[which])])
    assert said(compare(*runs)) == ("Root / Move (2)", "nothing", "FAILURE: ABORTED: ")


def test_nodes_that_are_inserted_are_compared_too() -> None:
    runs = []
    for ends in (Status.SUCCESS, Status.FAILURE):
        tree, late = Tree(), FakeNode("Late", kind="check")
        runs.append(tree.run(tree.story.add(late, tree.root), tree.story.node(late, ends)))
    assert said(compare(*runs)) == ("Root / Late", "SUCCESS", "FAILURE")


def test_events_that_are_missing_are_counted() -> None:
    assert Walk(every_kind(), Places()).lost == 7


def test_a_run_of_too_many_outcomes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bt_actions.recording.comparing.MOST", 10)
    with pytest.raises(RecordingError, match="too long to compare"):
        Walk(run_of(NIGHT), Places())


NAN = float("nan")


@pytest.mark.parametrize(
    ("a", "b", "are_alike"),
    [
        (1.0, 1.009, True),
        (1.0, 1.02, False),
        (1000.0, 1009.0, True),
        (0.0, 0.009, True),
        (3, 4, False),
        (True, False, False),
        ("a", "b", False),
        (NAN, NAN, True),
        (NAN, 1.0, False),
        ({"x": 1.0}, {"x": 1.001}, True),
        ({"x": 1.0}, {"y": 1.0}, False),
        ((1, (2.0, "a")), (1, (2.001, "a")), True),
        ((1, 2), (1, 2, 3), False),
        ((1, 2), {"a": 1}, False),
        (Cut((1.0,), 5), Cut((1.001,), 5), True),
        (Cut((1.0,), 5), Cut((1.0,), 6), False),
        (None, {"x": 1.0}, True),
        ({"x": HIDDEN}, {"x": 1.0}, True),
        (b"\x00", b"\x01", False),
    ],
)
def test_numbers_may_differ_by_a_hundredth_and_what_is_not_known_by_anything(
    a: Any, b: Any, are_alike: bool
) -> None:
    assert alike(a, b, 0.01) is are_alike
    assert alike(b, a, 0.01) is are_alike
