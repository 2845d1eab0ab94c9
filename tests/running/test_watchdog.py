"""Whose goals are canceled because a tick does not return; in time of its own."""

from __future__ import annotations

from typing import Any
from unittest.mock import MagicMock, Mock

import py_trees
import pytest
from py_trees.common import Status

from bt_actions import TreeError
from bt_actions.events import TickLasts
from bt_actions.running.watchdog import GRACE, LASTS, LOOK, Watchdog
from tests.running.stepping import Stepped
from tests.support.trees import in_sequence, together

ENDS_AT = 9.0


class Guarded:
    """A run that is to end at `ENDS_AT`, with one goal, in a tick that has not returned."""

    def __init__(self) -> None:
        self.goal = Mock()
        self.goals, self.traffic = Mock(wanted=[self.goal]), MagicMock()
        self.traffic.host.stalls.answers_take.return_value = 0.0
        self.dog = Watchdog(self.traffic, self.goals, MagicMock())
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


def test_it_is_attended_to_while_ticks_are_to_be_seen_until_the_run_ends(run: Guarded) -> None:
    scheduler, run.goals.wanted = run.traffic.host.scheduler, []
    run.dog.see_ticks()
    scheduler.add.assert_called_once_with(run.dog)
    run.dog.run_due(1.0)
    scheduler.remove.assert_not_called()
    run.dog.ticks_on = None
    run.dog.run_due(2.0)
    scheduler.remove.assert_called_once_with(run.dog)


class Blocks(py_trees.behaviours.Running):
    """Lets some time pass in each of its ticks, in which the watchdog looks."""

    stepped: Stepped

    def __init__(self, name: str, seconds: float) -> None:
        super().__init__(name)
        self.seconds = seconds

    def update(self) -> Status:
        end = self.stepped.now + self.seconds
        while self.stepped.now < end:
            self.stepped.now += LOOK
            self.stepped.loop.watchdog.run_due(self.stepped.now)
        return Status.RUNNING


def ticks_that_last(*leaves: Blocks) -> list[tuple[str, float, bool]]:
    """What is told of ticks in one tick of the leaves together."""
    stepped = Stepped(together(*leaves))
    for leaf in leaves:
        leaf.stepped = stepped
    stepped.begin()
    stepped.step()
    names = {number: leaf.name for leaf, number in stepped.loop.teller.numbers.items()}
    told = [each for each in stepped.told if isinstance(each, TickLasts)]
    return [
        (
            names[each.node],
            round(each.seconds, 1) if each.is_over else int(each.seconds),
            each.is_over,
        )
        for each in told
    ]


def test_the_tick_of_a_node_that_lasts_is_told_once_and_its_whole_length_when_it_is_over() -> None:
    told = ticks_that_last(Blocks("quick", 0.4), Blocks("slow", 3.0), Blocks("slower", 4.0))
    assert told == [
        ("slow", LASTS, False),
        ("slow", 3.0, True),
        ("slower", LASTS, False),
        ("slower", 4.0, True),
    ]


def test_many_quick_ticks_are_no_tick_that_lasts() -> None:
    assert ticks_that_last(*(Blocks(str(number), 0.8) for number in range(5))) == []


def test_a_tick_that_raises_is_over_too() -> None:
    class Breaks(Blocks):
        def update(self) -> Status:
            super().update()
            raise ValueError("broken")

    breaks = Breaks("breaks", 2.0)
    breaks.stepped = Stepped(breaks)
    with pytest.raises(TreeError):
        breaks.stepped.run()
    told = [each.is_over for each in breaks.stepped.told if isinstance(each, TickLasts)]
    assert told == [False, True]
    assert breaks.stepped.loop.watchdog.ticks_since is None


def test_when_the_present_tick_began_is_known_while_it_lasts() -> None:
    class Looks(py_trees.behaviours.Success):
        def update(self) -> Status:
            seen.append(stepped.loop.watchdog.ticks_since)
            return Status.SUCCESS

    seen = list[object]()
    stepped = Stepped(Looks("looks"))
    stepped.now = 7.0
    stepped.run()
    assert (seen, stepped.loop.watchdog.ticks_since) == ([7.0], None)


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
