"""How long a drain waits: for ends, and for servers that may only have stood still."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Outcome, Timeouts
from bt_actions.goals.terms import Now, State
from bt_actions.traffic import drain as draining
from bt_actions.traffic.shared import GoalHandle

LIMITS = Timeouts(accept=1.0, cancel=2.0)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The seconds that the drain sees, in place of the steady clock's."""
    clock = SimpleNamespace(now=100.0)
    clock.monotonic = lambda: clock.now
    monkeypatch.setattr(draining, "time", clock)
    still = SimpleNamespace(answers_take=lambda _: 0.0)
    monkeypatch.setattr(draining.alarm, "stalls", still)
    return clock


def handle(end: End, look_out_left: float | None, state: State = State.LOST) -> GoalHandle:
    """One whose server has gone."""
    goal = Goal(b"1" * 16, "/move", LIMITS, Now(0.0, 0.0))
    goal.outcome, goal.end, goal.state = Outcome.SERVER_LOST, end, state
    line: Any = SimpleNamespace(route=SimpleNamespace(in_doubt=lambda _: 0.0))
    made = GoalHandle(goal, line, line, None, "m")
    made.look_out_left = look_out_left
    return made


@pytest.mark.parametrize(
    ("end", "look_out_left", "state", "over"),
    [
        (End.SERVER_GONE, 2.0, State.LOST, False),
        (End.SERVER_GONE, 0.0, State.LOST, True),
        (End.SERVER_GONE, None, State.LOST, True),
        (End.SUCCEEDED, 2.0, State.DONE, True),
        (End.UNKNOWN, 0.0, State.LOST, False),
    ],
    ids=["looked out for", "long enough", "not at all", "has told its end", "unknown"],
)
def test_a_goal_is_over_when_nothing_of_it_is_waited_for(
    end: End, look_out_left: float | None, state: State, over: bool
) -> None:
    assert handle(end, look_out_left, state).is_over is over


def test_who_is_looked_out_for_is_waited_for_but_not_without_end(clock: Any) -> None:
    lost = handle(End.SERVER_GONE, 2.0)
    patience = draining._Patience([lost])
    clock.now += 10.0
    assert not patience.is_over([lost]), "looks count, not time: the process may stand still"
    clock.now += draining.LOOKS_OUT_AT_MOST
    assert patience.is_over([lost])


def test_what_was_left_by_a_node_that_is_gone_has_the_time_of_any_goal(clock: Any) -> None:
    left = handle(End.UNKNOWN, 0.0)
    patience = draining._Patience([left])
    clock.now += left.goal.drains_within
    assert not patience.is_over([left])
    clock.now += 2 * draining.JUST_PAST
    assert patience.is_over([left])


def test_who_is_back_has_the_time_of_a_cancel_but_only_once(clock: Any) -> None:
    goal = handle(End.SERVER_GONE, 2.0)
    patience = draining._Patience([goal])
    for back_again in (False, True):
        goal.goal.state = State.LOST
        patience.is_over([goal])
        clock.now += 50.0
        goal.goal.state = State.CANCELING
        assert patience.is_over([goal]) is back_again
        clock.now += goal.goal.drains_within + 2 * draining.JUST_PAST
        assert patience.is_over([goal])
