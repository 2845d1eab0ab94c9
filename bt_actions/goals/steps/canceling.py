"""Steps of a goal that is not wanted any more: the server is asked to cancel it until it has ended.

`timeout.cancel` runs to the end of the goal, not to an answer. When it has passed the leaf is free;
the questions are repeated all the same.
"""

from __future__ import annotations

from typing import Any

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.facts import Facts
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.steps.step import Step, leads_to
from bt_actions.goals.terms import (
    CANCEL_ACCEPTED,
    CANCEL_REJECTED,
    STATUS_SUCCEEDED,
    Event,
    State,
)

NEVER_DONE = (Outcome.CANCELED, Outcome.SERVER_AMBIGUOUS)
"""Outcomes that a goal was canceled for and that stand, should it succeed all the same."""


def cancel(outcome: Outcome, why: str) -> Step:
    """Return the step that cancels what runs."""

    def step(goal: Facts, detail: Any) -> State:
        return stop(goal, outcome, goal.say(why, detail))

    return Step(step, frozenset({State.CANCELING}), f"Cancel: {outcome}")


def stop(goal: Facts, outcome: Outcome, reason: str) -> State:
    """Cancel what runs."""
    goal.plan(outcome, reason)
    goal.deadlines.disarm(Event.RESULT_DUE, Event.FEEDBACK_DUE, Event.CANCEL_DUE)
    goal.deadlines.arm(Event.CANCEL_DUE, goal.timeouts.cancel)
    goal.ask()
    return State.CANCELING


def _plan_anew(goal: Facts, outcome: Outcome, why: str) -> None:
    if goal.planned not in (Outcome.CANCELED, outcome):
        goal.plan(outcome, f"{why} ({goal.reason})")


@leads_to()
def interrupted(goal: Facts, detail: Any) -> State:
    """Whatever it was canceled for, its outcome will be CANCELED."""
    asked_at = goal.asking.asked_at
    is_news = goal.outcome is not None or goal.planned is not Outcome.CANCELED
    if is_news and asked_at is not None and goal.steady - asked_at >= ASK_AGAIN:
        goal.ask()  # now somebody waits for it
    _plan_anew(goal, Outcome.CANCELED, "interrupted by the tree")
    return goal.state


@leads_to()
def replaced(goal: Facts, detail: Any) -> State:
    """Whatever it was canceled for, it must not be tried again beside the newer one."""
    _plan_anew(goal, Outcome.CANCELED, "replaced by a newer goal")
    return goal.state


@leads_to()
def taken_by_two(goal: Facts, detail: Any) -> State:
    """Cancel, at both; it must not count as done, or be tried again."""
    _plan_anew(goal, Outcome.SERVER_AMBIGUOUS, "both of two servers may have it")
    goal.ask()
    return goal.state


@leads_to(State.DONE)
def finished(goal: Facts, detail: Any) -> State:
    """What it was canceled for; SUCCEEDED, late, if only a deadline had passed."""
    if goal.take_result(detail) == STATUS_SUCCEEDED and goal.planned not in NEVER_DONE:
        goal.settle(Outcome.SUCCEEDED, f"late: {goal.reason}")
    if goal.outcome is None and goal.asking.answer == CANCEL_REJECTED:
        goal.reason += cancel_said(goal)
    goal.settle_as_planned()
    return State.DONE


@leads_to()
def cancel_answered(goal: Facts, detail: Any) -> State:
    """Take note of it: what counts is how the goal ends, or how long it is denied."""
    goal.asking.answered(detail, goal.steady)
    return goal.state


@leads_to(State.DONE)
def cancel_due(goal: Facts, detail: Any) -> State:
    """The leaf is free; the server is asked on and on, unless the status shows the end."""
    if goal.lost_result.status is None:
        goal.settle_as_planned()
        goal.ask()
        return State.CANCELING
    if goal.lost_result.questions > 1:
        return goal.end_by_status()
    if goal.lost_result.questions == 0:
        ask_again(goal, None)
    goal.deadlines.arm(Event.CANCEL_DUE, ASK_AGAIN)  # the result itself tells more
    return State.CANCELING


@leads_to(State.DONE)
def ask_again(goal: Facts, detail: Any) -> State:
    """Ask again; after several questions for a result believe the status."""
    if goal.lost_result.asked_in_vain():
        return goal.end_by_status()
    goal.ask()
    return goal.state


@leads_to(State.DONE)
def drain_gave_up(goal: Facts, detail: Any) -> State:
    """Nobody waits any longer; what is not known by now is UNKNOWN, and may become known."""
    goal.drain_gave_up = True
    if goal.lost_result.questions > 0:
        return goal.end_by_status()
    goal.settle_as_planned()
    if goal.may_still_be_accepted:
        goal.end = End.UNKNOWN  # canceled if it turns up all the same
    return goal.state


def cancel_said(goal: Facts) -> str:
    """What its server has said of the request to cancel it, to follow a reason; or ""."""
    gone = goal.state is State.LOST and goal.end is not End.UNKNOWN  # else only its node is gone
    if gone or goal.asking.asked_at is None or goal.state is State.DONE:
        return ""
    words = {
        None: "has not answered the request to cancel it",
        CANCEL_ACCEPTED: "has agreed to cancel it, and it has not ended",
        CANCEL_REJECTED: "refuses to cancel it",
    }
    said = words.get(goal.asking.answer)
    return f"; {goal.server} {said}" if said else ""
