"""Which goals are a tree's, and what is told of them; the goals are made up."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import pytest
from py_trees.behaviour import Behaviour
from py_trees.trees import BehaviourTree

from bt_actions import End, Outcome
from bt_actions.goals.terms import State
from bt_actions.running.goals import RunGoals
from bt_actions.traffic.begun import begun_in
from tests.support.trees import Gate, in_sequence


def begun(owner: Behaviour | None) -> Any:
    """Return a goal that is begun now, as far as it is looked at here."""
    goal = Mock(outcome=None, end=End.NEVER_STARTED, reason="", cancel_said="", id=b"\1" * 16)
    return Mock(owner=owner, begun_in=begun_in.get(), is_over=False, goal=goal)


def changed(handle: Any, *, over: bool = False) -> Any:
    handle.is_over = over
    return Mock(handle=handle, state=State.EXECUTING)


class Run:
    """Of a tree of one leaf."""

    def __init__(self) -> None:
        self.leaf = Gate("m")
        self.told: list[Any] = []
        self.wake, self.minded = Mock(), Mock()
        tree = BehaviourTree(in_sequence(self.leaf))
        self.goals = RunGoals(tree, self.told.append, self.wake, self.minded)
        self.goals.run_goes_on = True

    def begun(self, owner: Behaviour | None) -> Any:
        with self.goals.begun_here():
            return begun(owner)


@pytest.fixture
def run() -> Run:
    return Run()


def test_a_goal_is_the_trees_by_its_tick_or_by_its_leaf(run: Run) -> None:
    elsewhere = Gate("elsewhere")
    ours = [run.begun(elsewhere), begun(run.leaf)]
    run.goals.note(changed(run.begun(elsewhere), over=True))  # a server was busy, say
    for handle in *ours, begun(elsewhere), Run().begun(elsewhere):
        run.goals.note(changed(handle))
    run.goals.tell(7.0)
    assert [each.behaviour for each in run.told] == [elsewhere, elsewhere, run.leaf]
    assert {each.time for each in run.told} == {7.0}
    assert set(run.goals.not_over) == set(ours)
    assert run.minded.call_count == 3
    assert run.wake.call_count == 5, "what others do may be what a leaf waits for"


def test_a_goal_is_kept_until_it_is_over_and_nothing_is_told_of_a_leaf_that_is_gone(
    run: Run,
) -> None:
    handle = run.begun(None)
    run.goals.note(changed(handle))
    run.goals.tell(0.0)
    assert run.goals.wanted == [handle]
    run.goals.note(changed(handle, over=True))
    run.goals.tell(0.0)
    handle.is_over = False
    assert run.goals.not_over == run.told == []


@pytest.mark.parametrize("outcome", [None, Outcome.CANCELED])
def test_who_has_left_a_goal_whose_end_is_not_known_reports_it(run: Run, outcome: Any) -> None:
    handle = run.begun(run.leaf)
    handle.goal.end, handle.goal.outcome = End.UNKNOWN, outcome
    run.goals.note(changed(handle))
    assert len(run.goals.unaccounted) == (outcome is not None), "its leaf waits for it"
    run.goals.run_goes_on = False
    (report,) = run.goals.unaccounted
    assert report.goal_id == "01" * 16


def test_between_two_runs_what_they_have_left_is_of_interest_and_nothing_else(run: Run) -> None:
    left, moved = run.begun(run.leaf), begun(run.leaf)
    run.goals.note(changed(moved))
    moved.owner = Gate("moved")
    run.goals.note(changed(moved))
    run.goals.tell(0.0)
    run.wake.reset_mock()
    run.goals.run_goes_on = False
    for handle in begun(run.leaf), begun(Gate()):
        run.goals.note(changed(handle))
    run.goals.note(None)
    run.goals.note(changed(run.begun(run.leaf), over=True))
    run.wake.assert_not_called()
    run.goals.note(changed(left))
    run.goals.note(changed(moved, over=True))
    run.goals.tell(0.0)
    assert len(run.told) == 4
    assert run.goals.not_over == [left]
