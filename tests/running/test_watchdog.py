"""Whose goals are canceled because a tick does not return; in time of its own."""

from __future__ import annotations

from typing import Any
from unittest.mock import MagicMock, Mock

import py_trees
import pytest
from py_trees.common import Status

from bt_actions.running.watchdog import GRACE, LOOK, Watchdog
from tests.running.stepping import Stepped
from tests.support.trees import in_sequence

ENDS_AT = 9.0


class Guarded:
    """A run that is to end at `ENDS_AT`, with one goal, in a tick that has not returned."""

    def __init__(self) -> None:
        self.goal = Mock()
        self.goals, self.traffic = Mock(wanted=[self.goal]), MagicMock()
        self.traffic.host.stalls.answers_take.return_value = 0.0
        self.dog = Watchdog(self.traffic, self.goals)
        self.dog.begin(ENDS_AT)

    def look_until(self, end: float, *, begin: float = ENDS_AT) -> bool:
        """Look now and then; return whether the goal was canceled."""
        now = begin
        while now < end:
            self.dog.run_due(now)
            now += LOOK
        return bool(self.traffic.interrupt.called)

    @property
    def warnings(self) -> list[str]:
        return [str(call.args[0]) for call in self.traffic.host.log.warning.call_args_list]


@pytest.fixture
def run() -> Guarded:
    return Guarded()


def test_goals_are_canceled_when_the_grace_is_over_and_the_behaviour_is_named_once(
    run: Guarded,
) -> None:
    class Stuck(py_trees.behaviours.Running):
        def update(self) -> Status:
            assert not run.look_until(ENDS_AT + GRACE)
            assert run.look_until(ENDS_AT + 2 * GRACE, begin=ENDS_AT + GRACE)
            return Status.RUNNING

    in_sequence(stuck := Stuck("stuck"))
    stuck.tick_once()
    run.traffic.interrupt.assert_called_with(run.goal)
    assert run.warnings == ["sequence/stuck does not return from its tick: canceling all goals"]
    assert run.dog.gave_up


def test_an_interrupt_ends_the_run_earlier_and_no_end_never(run: Guarded) -> None:
    run.dog.begin(float("inf"))
    assert not run.look_until(50.0)
    run.dog.ends_at = 50.0
    assert run.look_until(50.0 + 2 * GRACE, begin=50.0)


def test_a_tick_that_has_returned_is_not_guarded(run: Guarded) -> None:
    run.dog.ticks_on = None
    assert not run.look_until(ENDS_AT + 9.0)


def test_nothing_is_given_up_while_a_stall_is_borne_with(run: Guarded) -> None:
    run.traffic.host.stalls.answers_take = lambda now: max(0.0, ENDS_AT + 5.0 - now)
    assert not run.look_until(ENDS_AT + 5.0)
    assert run.look_until(ENDS_AT + 6.0, begin=ENDS_AT + 5.0)


def test_it_is_attended_to_while_a_goal_is_wanted(run: Guarded) -> None:
    scheduler = run.traffic.host.scheduler
    run.dog.run_due(ENDS_AT)
    scheduler.remove.assert_not_called()
    run.goals.wanted = []
    run.dog.run_due(ENDS_AT)
    scheduler.remove.assert_called_once_with(run.dog)


def test_where_no_goal_is_wanted_the_rest_of_the_tick_is_left_out_all_the_same() -> None:
    class Slow(py_trees.behaviours.Running):
        def update(self) -> Status:
            stepped.loop.interrupt(stepped.now)
            stepped.now += GRACE
            stepped.loop.interrupt(stepped.now)  # which puts nothing off
            return Status.SUCCESS

    then: Any = Mock(wraps=py_trees.behaviours.Success("then").update)
    behind = py_trees.behaviours.Success("behind")
    behind.update = then  # type: ignore[method-assign]
    stepped = Stepped(in_sequence(Slow("slow"), behind))
    assert stepped.run() is Status.INVALID
    then.assert_not_called()
