"""One goal under every fault, without ROS: what each step does, and that it ends once."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from bt_actions.simulation.execution import (
    FLOOD_AT_ONCE,
    NOTHING,
    CancelAnswer,
    Execution,
    Finish,
    Happened,
)
from bt_actions.simulation.fault_plan import FaultPlan, GoalFaults
from bt_actions.simulation.faults import KINDS, FaultKind

PERIOD = 0.1


class Route:
    """A motion of ten steps."""

    def __init__(self, steps: float = 10.0) -> None:
        self.length = steps
        self.gone = 0.0

    @property
    def progress(self) -> float:
        return min(1.0, self.gone / self.length) if self.length else 1.0

    @property
    def done(self) -> bool:
        return self.gone >= self.length - 1e-9

    def step(self, share: float) -> None:
        self.gone += share


def faults(*written: str) -> GoalFaults:
    return FaultPlan.of([f"*:1:{fault}" for fault in written]).strike("/s", 1)


def begin(*written: str, steps: float = 10.0, limit: float | None = None) -> Execution:
    return Execution(Route(steps), faults(*written), now=0.0, time_limit=limit)


def steps_until_end(run: Execution, most: int = 200) -> list[Happened]:
    happened = []
    while run.moving and len(happened) < most:
        happened.append(run.step(PERIOD * (len(happened) + 1), PERIOD))
    return happened


def test_it_gives_feedback_each_step_and_completes_with_the_last() -> None:
    happened = steps_until_end(begin())
    assert [each.feedback for each in happened] == [1] * 10
    assert [each.finish for each in happened] == [None] * 9 + [Finish.COMPLETED]


def test_after_its_end_nothing_happens_any_more() -> None:
    run = begin()
    steps_until_end(run)
    assert run.step(9.0, PERIOD) is NOTHING
    assert run.poll(9.0) is NOTHING
    assert run.replace() is NOTHING
    assert run.give_up("?") is NOTHING
    assert run.cancel(9.0) is CancelAnswer.REJECT
    assert run.due is None


def test_a_goal_that_takes_too_long_ends_by_timeout() -> None:
    happened = steps_until_end(begin(steps=1000, limit=3.0))
    assert happened[-1].finish is Finish.TIMEOUT
    assert "3 s of simulated time" in happened[-1].reason
    assert len(happened) == 30


def test_a_cancel_ends_it_at_the_next_poll() -> None:
    run = begin()
    run.step(0.1, PERIOD)
    assert run.cancel(0.2) is CancelAnswer.ACCEPT
    assert not run.moving
    assert run.poll(0.2).finish is Finish.CANCELED


def test_a_newer_goal_replaces_it() -> None:
    happened = begin().replace()
    assert happened.finish is Finish.REPLACED
    assert "newer goal" in happened.reason


def test_abort_strikes_half_way() -> None:
    happened = steps_until_end(begin("abort"))
    assert happened[-1].finish is Finish.FAULT
    assert len(happened) == 5


def test_abort_after_seconds_strikes_then_or_at_the_end() -> None:
    assert len(steps_until_end(begin("abort=0.3"))) == 3
    late = steps_until_end(begin("abort=9"))
    assert late[-1].finish is Finish.FAULT
    assert len(late) == 10


def test_slow_takes_so_many_times_longer_and_goes_on_giving_feedback() -> None:
    happened = steps_until_end(begin("slow=3"))
    assert len(happened) == 30
    assert all(each.feedback == 1 for each in happened)


def test_stall_stops_motion_and_feedback_until_it_is_canceled() -> None:
    run = begin("stall", limit=3.0)
    happened = steps_until_end(run)
    assert len(happened) == 5
    assert happened[-1] == NOTHING
    assert not run.over
    assert not run.moving
    assert run.cancel(100.0) is CancelAnswer.ACCEPT
    assert run.poll(100.0).finish is Finish.CANCELED


def test_no_feedback_moves_in_silence() -> None:
    happened = steps_until_end(begin("no_feedback"))
    assert sum(each.feedback for each in happened) == 0
    assert happened[-1].finish is Finish.COMPLETED


def test_a_flood_gives_so_much_feedback_a_second_but_never_endlessly_at_once() -> None:
    happened = steps_until_end(begin("flood=500"))
    assert sum(each.feedback for each in happened) == pytest.approx(500, abs=10)
    run = begin("flood=1000000")
    assert run.step(60.0, PERIOD).feedback == FLOOD_AT_ONCE


def test_reject_cancel_goes_on() -> None:
    run = begin("reject_cancel")
    assert run.cancel(0.0) is CancelAnswer.REJECT
    assert steps_until_end(run)[-1].finish is Finish.COMPLETED


def test_ignore_cancel_agrees_and_goes_on() -> None:
    run = begin("ignore_cancel")
    assert run.cancel(0.0) is CancelAnswer.ACCEPT
    assert run.poll(5.0) is NOTHING
    assert steps_until_end(run)[-1].finish is Finish.COMPLETED


def test_drop_cancel_gives_no_answer_and_goes_on() -> None:
    run = begin("drop_cancel")
    assert run.cancel(0.0) is CancelAnswer.DROP
    assert run.moving


def test_delay_cancel_stands_still_and_ends_later() -> None:
    run = begin("delay_cancel=2")
    assert run.cancel(1.0) is CancelAnswer.ACCEPT
    assert not run.moving
    assert run.due == 3.0
    assert run.poll(2.9) is NOTHING
    assert run.cancel(2.9) is CancelAnswer.ACCEPT, "asking again does not begin it again"
    assert run.poll(3.0).finish is Finish.CANCELED


def test_succeed_on_cancel_and_abort_on_cancel_end_so() -> None:
    for fault, finish in (
        ("succeed_on_cancel", Finish.COMPLETED),
        ("abort_on_cancel", Finish.FAULT),
    ):
        run = begin(fault)
        assert run.cancel(0.0) is CancelAnswer.ACCEPT
        assert run.poll(0.0).finish is finish


def test_drop_part_happens_once_and_the_goal_goes_on() -> None:
    happened = steps_until_end(begin("drop_part"))
    assert [each.drop_part for each in happened].count(True) == 1
    assert happened[4].drop_part
    assert happened[-1].finish is Finish.COMPLETED


def test_die_strikes_half_way_and_die_on_cancel_only_then() -> None:
    assert steps_until_end(begin("die"), most=5)[-1].die
    run = begin("die=cancel")
    run.step(0.1, PERIOD)
    assert run.cancel(0.1) is CancelAnswer.DIE
    assert not any(each.die for each in steps_until_end(begin("die=accept")))


def test_restart_dies_and_says_for_how_long() -> None:
    last = steps_until_end(begin("restart=2"), most=5)[-1]
    assert last.die
    assert last.restart_after == 2.0


def test_a_goal_that_is_done_before_its_first_step_still_meets_its_fault() -> None:
    happened = steps_until_end(begin("abort", steps=0))
    assert [each.finish for each in happened] == [Finish.FAULT]


class AnyOrder(RuleBasedStateMachine):
    """Steps, cancels, polls and replacements in any order, under any two faults."""

    @initialize(kinds=st.sets(st.sampled_from(FaultKind), max_size=2), length=st.floats(0, 30))
    def begin(self, kinds: set[FaultKind], length: float) -> None:
        struck = GoalFaults({kind: KINDS[kind].default for kind in kinds})
        self.now = 0.0
        self.run = Execution(Route(length), struck, now=0.0, time_limit=2.0)
        self.ends = 0
        self.canceled = False
        self.dead = False

    def look(self, happened: Happened) -> None:
        assert not self.dead or happened is NOTHING
        self.ends += happened.finish is not None
        assert (happened.finish is not None) <= self.run.over
        if happened.finish is Finish.CANCELED:
            assert self.canceled
        if happened.die:
            self.run.give_up("dead")
            self.dead = True

    @rule(steps=st.integers(1, 20))
    def step(self, steps: int) -> None:
        for _ in range(steps):
            self.now += PERIOD
            if self.run.moving:
                self.look(self.run.step(self.now, PERIOD))

    @rule()
    def cancel(self) -> None:
        was_over = self.run.over
        answer = self.run.cancel(self.now)
        self.canceled = self.canceled or answer is CancelAnswer.ACCEPT
        if was_over:
            assert answer is not CancelAnswer.ACCEPT

    @rule(seconds=st.floats(0, 2))
    def poll(self, seconds: float) -> None:
        self.now += seconds
        self.look(self.run.poll(self.now))

    @rule()
    def replace(self) -> None:
        self.look(self.run.replace())

    @invariant()
    def it_ends_at_most_once_and_then_wants_nothing(self) -> None:
        assert self.ends <= 1
        if self.run.over:
            assert not self.run.moving
            assert self.run.due is None


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=150, stateful_step_count=25, deadline=None)
