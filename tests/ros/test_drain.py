"""How long a drain waits: for ends, and for servers that may only have stood still."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Outcome, Timeouts
from bt_actions.goals.terms import Event, Now, State
from bt_actions.traffic import drain
from bt_actions.traffic.drain import JUST_PAST, Drain
from bt_actions.traffic.state import CancelQueue, GoalHandle
from bt_actions.utilities.stepping import Done, Sleep

LIMITS = Timeouts(accept=1.0, cancel=2.0)


class Host(SimpleNamespace):
    """A process that never stands still, at a time of the test's."""

    def __init__(self) -> None:
        super().__init__(now=100.0, lock=nullcontext())
        self.stalls = SimpleNamespace(answers_take=lambda _: 0.0)

    def steady(self) -> float:
        return float(self.now)


def handle(end: End, look_out_left: float | None, state: State = State.LOST) -> GoalHandle:
    """One whose server has gone."""
    goal = Goal(b"1" * 16, "/move", LIMITS, Now(0.0, 0.0))
    goal.outcome, goal.end, goal.state = Outcome.SERVER_LOST, end, state
    goal.deadlines.clear()
    goal.deadlines.arm(Event.LOOK_OUT_DUE, look_out_left)
    endpoint: Any = Endpoint(is_parents=False, cancels=CancelQueue())
    return GoalHandle(goal, endpoint, None, "m")


@pytest.fixture(autouse=True)
def nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drain, "tell", tell)
    monkeypatch.setattr(drain, "in_doubt", lambda endpoint, now: False)
    for what in ("deliver_arrived", "apply_deadlines"):
        monkeypatch.setattr(drain, what, lambda _: None)


def tell(handle: GoalHandle, event: Event) -> None:
    """Only what is the end of a drain."""
    if event is Event.DRAIN_GAVE_UP:
        handle.goal.on(event, Now(0.0, 0.0))


class Endpoint(SimpleNamespace):
    """One on which nothing happens."""

    __hash__ = object.__hash__


@pytest.mark.parametrize(
    ("end", "look_out_left", "state", "over"),
    [
        (End.SERVER_GONE, 2.0, State.LOST, False),
        (End.SERVER_GONE, None, State.LOST, True),
        (End.SUCCEEDED, 2.0, State.DONE, True),
        (End.UNKNOWN, None, State.LOST, False),
    ],
    ids=["looked out for", "not, or long enough", "has told its end", "unknown"],
)
def test_a_goal_is_over_when_nothing_of_it_is_waited_for(
    end: End, look_out_left: float | None, state: State, over: bool
) -> None:
    assert handle(end, look_out_left, state).is_over is over


def test_who_is_looked_out_for_is_waited_for_but_not_without_end() -> None:
    host: Any = Host()
    lost = handle(End.SERVER_GONE, 2.0)
    drains = Drain(host, [lost])
    host.now += 10.0
    assert isinstance(drains.step(host.now), Sleep), "the process may have stood still"
    assert list(lost.goal.due(Now(host.now, 0.0))) == [Event.LOOK_OUT_DUE]
    assert drains.step(host.now) == Done([])


def test_what_was_left_by_a_node_that_is_gone_has_the_time_of_any_goal() -> None:
    host: Any = Host()
    left = handle(End.UNKNOWN, None)
    drains = Drain(host, [left])
    host.now += left.goal.drains_within
    assert isinstance(drains.step(host.now), Sleep)
    host.now += 2 * JUST_PAST
    assert drains.step(host.now) == Done([left])


def test_who_is_back_has_the_time_of_a_cancel_but_only_once() -> None:
    host: Any = Host()
    handles = [handle(End.SERVER_GONE, 2.0), handle(End.UNKNOWN, None)]
    drains, goal = Drain(host, handles), handles[0].goal
    for back_again in (False, True):
        goal.state, goal.end = State.LOST, End.SERVER_GONE
        drains.step(host.now)
        host.now += goal.drains_within + 2 * JUST_PAST
        assert isinstance(drains.step(host.now), Sleep), "it is looked out for"
        goal.state, goal.end = State.CANCELING, End.UNKNOWN
        assert isinstance(drains.step(host.now), Done) is back_again


def test_who_is_in_a_hurry_waits_for_no_end() -> None:
    host: Any = Host()
    left = handle(End.UNKNOWN, None)
    drains = Drain(host, [left])
    assert isinstance(drains.step(host.now), Sleep)
    assert drains.step(host.now, hurry=True) == Done([left])
