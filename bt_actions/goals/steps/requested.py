"""Steps of a goal that was not accepted yet, and waits for resources, a server, or an answer.

An answer to a wanted goal is awaited. An unwanted goal is canceled, which asks the server as well:
the server may have the goal, or get it yet. If the server denies the goal for long enough, the tree
need not wait; whenever the goal turns up, it is canceled.
"""

from __future__ import annotations

import math

from bt_actions.goals.asking import ASK_IN_ANY_CASE
from bt_actions.goals.facts import Facts, Step, leads_to
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.terms import Command, Event, State


def give_up(outcome: Outcome, why: str) -> Step:
    """Return the step that ends an unsent goal."""

    def step(goal: Facts) -> State:
        goal.settle(outcome, goal.say(why))
        return State.DONE

    return Step(step, frozenset({State.DONE}), f"Give up: {outcome}")


@leads_to(State.WAITING_FOR_SERVER)
def granted(goal: Facts) -> State:
    """Hold the resources, and wait for the server."""
    goal.deadlines.disarm(Event.QUEUE_DUE)
    goal.deadlines.arm(Event.SERVER_DUE, goal.timeouts.server)
    return State.WAITING_FOR_SERVER


@leads_to(State.SENDING)
def send(goal: Facts) -> State:
    """Send the request; until the server says how the goal ended, its end is UNKNOWN."""
    goal.deadlines.disarm(Event.SERVER_DUE)
    goal.deadlines.suspend(0.0, goal.deadlines.now)  # a grace was for a server out of sight
    goal.deadlines.arm(Event.ACCEPT_DUE, goal.timeouts.accept)
    goal.end = End.UNKNOWN
    goal.commands.append(Command.SEND)
    return State.SENDING


@leads_to(State.DONE)
def send_failed(goal: Facts) -> State:
    """Give up: SERVER_UNAVAILABLE; nothing was started."""
    goal.end = End.NEVER_STARTED
    why = f"the goal request could not be sent: {goal.detail}"
    goal.settle(goal.planned or Outcome.SERVER_UNAVAILABLE, why)
    return State.DONE


@leads_to(State.EXECUTING)
def begin(goal: Facts) -> State:
    """Ask for the result; timeout.result and timeout.feedback begin."""
    goal.deadlines.disarm(Event.ACCEPT_DUE)
    goal.deadlines.arm(Event.RESULT_DUE, goal.timeouts.result)
    goal.deadlines.arm(Event.FEEDBACK_DUE, goal.timeouts.feedback)
    goal.deadlines.arm(Event.POLL_DUE, ASK_IN_ANY_CASE)
    goal.commands.append(Command.ASK_RESULT)
    return State.EXECUTING


@leads_to(State.DONE)
def rejected(goal: Facts) -> State:
    """Decide REJECTED, or what the goal was canceled for; nothing was started."""
    goal.end = End.NEVER_STARTED
    why = f"{goal.server} refused the goal {goal.fields}".rstrip()
    if goal.planned is Outcome.ACCEPT_TIMEOUT:  # the answer, though late
        goal.settle(Outcome.REJECTED, why)
    goal.settle_as_planned(Outcome.REJECTED, why)
    return State.DONE


def withdraw(outcome: Outcome, why: str) -> Step:
    """Return the step for a goal that is not wanted any more before it was accepted."""

    def step(goal: Facts) -> State:
        goal.plan(outcome, goal.say(why))
        if goal.timeouts.accept is None:
            goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience)
        if outcome is Outcome.SERVER_AMBIGUOUS:  # the server that has the goal
            goal.ask()
        return State.UNWANTED

    says = f"Plan {outcome}: the goal is canceled as soon as it is accepted"
    return Step(step, frozenset({State.UNWANTED}), says)


@leads_to(State.UNCONFIRMED)
def accept_due(goal: Facts) -> State:
    """Ask by canceling, and give the server timeout.accept again to answer that."""
    if goal.planned is None:
        goal.plan(
            Outcome.ACCEPT_TIMEOUT,
            goal.say("no answer to the goal request within {limits.accept:g} s"),
        )
    goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience)
    goal.ask()
    return State.UNCONFIRMED


@leads_to(State.PRESUMED_NOT_RECEIVED, State.NOT_RECEIVED)
def presume(goal: Facts) -> State:
    """Free the leaf; if the server has denied the goal just now: NEVER_STARTED."""
    goal.settle_as_planned()
    if not goal.asking.denied_lately(goal.steady):
        goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience)
        return State.UNCONFIRMED
    goal.end = End.NEVER_STARTED
    goal.deadlines.clear()
    goal.release()
    return _denied_for_long(goal)


def _denied_for_long(goal: Facts) -> State:
    """Believe a denial that has lasted for long enough; else ask once more when it has."""
    left = goal.asking.left_to_deny(goal.steady)
    if left > 0.0:
        goal.deadlines.arm(Event.POLL_DUE, left)
        return State.PRESUMED_NOT_RECEIVED
    goal.end = End.NEVER_STARTED
    goal.deadlines.disarm(Event.POLL_DUE)
    return State.NOT_RECEIVED


@leads_to(State.NOT_RECEIVED)
def denied_again(goal: Facts) -> State:
    """Let nobody wait for a goal that has been denied for 30 s."""
    goal.asking.cancel_answered(goal.detail, goal.steady)
    if not goal.asking.in_vain:  # UNKNOWN since the server was back
        goal.end = End.NEVER_STARTED
    return _denied_for_long(goal)


@leads_to(State.CANCELING)
def turned_up(goal: Facts) -> State:
    """Cancel at once, however late: the goal was accepted when nobody wanted it any more."""
    goal.end = End.UNKNOWN
    goal.asking.denied_since = math.inf
    goal.deadlines.disarm(Event.ACCEPT_DUE)
    if goal.outcome is None:
        goal.deadlines.arm(Event.CANCEL_DUE, goal.timeouts.cancel)
    goal.ask()
    goal.commands.append(Command.ASK_RESULT)
    return State.CANCELING
