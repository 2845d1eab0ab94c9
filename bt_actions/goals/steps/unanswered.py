"""Steps of a goal whose request is out and has no answer yet.

While it is wanted, an answer is waited for. After that the server is asked by canceling, which
stops the goal as well: it may have it, or get it yet. If the server denies it for long enough, the
tree goes on; whenever it turns up, it is canceled.
"""

from __future__ import annotations

from typing import Any

from bt_actions.goals.asking import ASK_IN_ANY_CASE
from bt_actions.goals.facts import Facts
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.steps import running
from bt_actions.goals.steps.step import Step, leads_to
from bt_actions.goals.terms import CANCEL_UNKNOWN_GOAL, Command, Event, Now, State


@leads_to(State.EXECUTING)
def begin(goal: Facts, now: Now, detail: Any) -> State:
    """Ask for the result; timeout.result and timeout.feedback begin."""
    goal.deadlines.disarm(Event.ACCEPT_DUE)
    goal.deadlines.arm(Event.RESULT_DUE, goal.timeouts.result, now)
    goal.deadlines.arm(Event.FEEDBACK_DUE, goal.timeouts.feedback, now)
    goal.deadlines.arm(Event.POLL_DUE, ASK_IN_ANY_CASE, now)
    goal.commands.append(Command.ASK_RESULT)
    return State.EXECUTING


@leads_to(State.EXECUTING)
def begin_by_status(goal: Facts, now: Now, detail: Any) -> State:
    """The acceptance was overtaken, or lost: only an accepted goal has a status."""
    begin(goal, now, None)
    running.status(goal, now, detail)
    return State.EXECUTING


@leads_to(State.EXECUTING)
def begin_by_feedback(goal: Facts, now: Now, detail: Any) -> State:
    """The acceptance was overtaken by feedback, or lost: only an accepted goal has any."""
    goal.feedback = detail
    return begin(goal, now, None)


@leads_to(State.DONE)
def rejected(goal: Facts, now: Now, detail: Any) -> State:
    """Nothing was started: REJECTED, or what it was canceled for."""
    goal.end = End.NEVER_STARTED
    why = f"{goal.server} refused the goal"
    if goal.planned is Outcome.ACCEPT_TIMEOUT:  # this is the answer, though late
        goal.settle(Outcome.REJECTED, why)
    goal.settle_as_planned(Outcome.REJECTED, why)
    return State.DONE


def withdraw(outcome: Outcome, why: str) -> Step:
    """Return the step for a goal that is not wanted any more before it was accepted."""

    def step(goal: Facts, now: Now, detail: Any) -> State:
        goal.plan(outcome, goal.say(why, detail))
        if goal.timeouts.accept is None:
            goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience, now)
        if outcome is Outcome.SERVER_AMBIGUOUS:  # whoever has it
            goal.ask(now)
        return State.UNWANTED

    says = f"It will be {outcome}: canceled as soon as it is accepted"
    return Step(step, frozenset({State.UNWANTED}), says)


@leads_to(State.UNCONFIRMED)
def accept_due(goal: Facts, now: Now, detail: Any) -> State:
    """Ask by canceling, and give the server timeout.accept again to answer that."""
    if goal.planned is None:
        goal.plan(
            Outcome.ACCEPT_TIMEOUT,
            goal.say("no answer to the goal request within {limits.accept:g} s"),
        )
    goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience, now)
    goal.ask(now)
    return State.UNCONFIRMED


@leads_to(State.PRESUMED_NOT_RECEIVED, State.NOT_RECEIVED)
def presume(goal: Facts, now: Now, detail: Any) -> State:
    """The leaf may go on; if the server has denied the goal just now: NEVER_STARTED."""
    goal.settle_as_planned()
    if not goal.asking.denied_lately(now.steady):
        goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience, now)
        return State.UNCONFIRMED
    goal.end = End.NEVER_STARTED
    goal.deadlines.clear()
    goal.release()
    return _denied_for_long(goal, now)


def _denied_for_long(goal: Facts, now: Now) -> State:
    """Ask once more when it has been denied for long enough, or believe it if it has."""
    left = goal.asking.left_to_deny(now.steady)
    if left > 0.0:
        goal.deadlines.arm(Event.POLL_DUE, left, now)
        return State.PRESUMED_NOT_RECEIVED
    goal.end = End.NEVER_STARTED
    goal.deadlines.disarm(Event.POLL_DUE)
    return State.NOT_RECEIVED


@leads_to(State.CANCELING)
def cancel_answered(goal: Facts, now: Now, detail: Any) -> State:
    """Take note of a denial; if the server knows it after all, it is canceled at once."""
    goal.asking.answered(detail, now.steady)
    return goal.state if detail == CANCEL_UNKNOWN_GOAL else turned_up(goal, now, detail)


@leads_to(State.CANCELING, State.NOT_RECEIVED)
def denied_again(goal: Facts, now: Now, detail: Any) -> State:
    """The same; denied for 30 s, nobody need wait for it any more."""
    if cancel_answered(goal, now, detail) is State.CANCELING:
        return State.CANCELING
    if not goal.waited_for:  # after its server was back, it was UNKNOWN until now
        goal.end = End.NEVER_STARTED
    return _denied_for_long(goal, now)


@leads_to(State.CANCELING)
def turned_up(goal: Facts, now: Now, detail: Any) -> State:
    """It was accepted after nobody wanted it any more: canceled at once, however late."""
    goal.end = End.UNKNOWN
    goal.asking.denied_since = None
    goal.deadlines.disarm(Event.ACCEPT_DUE)
    if goal.outcome is None:
        goal.deadlines.arm(Event.CANCEL_DUE, goal.timeouts.cancel, now)
    goal.ask(now)
    goal.commands.append(Command.ASK_RESULT)
    return State.CANCELING


@leads_to(State.CANCELING)
def turned_up_by_status(goal: Facts, now: Now, detail: Any) -> State:
    """Only an accepted goal has a status: canceled at once."""
    turned_up(goal, now, None)
    running.status(goal, now, detail)
    return State.CANCELING


@leads_to()
def ask_again(goal: Facts, now: Now, detail: Any) -> State:
    """Ask again."""
    goal.ask(now)
    return goal.state
