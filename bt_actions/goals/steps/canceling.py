"""Steps of a goal that is not wanted any more, or whose server is lost, until the goal has ended.

The server is asked to cancel the goal. `timeout.cancel` runs to the end of the goal, not to an
answer. After `timeout.cancel` the leaf is free; the questions are repeated all the same.

A lost server may only be out of reach, and still run the goal. So the leaf is free at once, and the
goal is kept: where its server is seen again, the goal is canceled first of all.
"""

from __future__ import annotations

import math

from bt_actions.goals.asking import ASK_AGAIN, LOOKED_OUT_FOR
from bt_actions.goals.facts import Facts, Step, leads_to
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.steps import requested
from bt_actions.goals.terms import CANCEL_REJECTED, STATUS_SUCCEEDED, Command, Event, State

NEVER_DONE = (Outcome.CANCELED, Outcome.SERVER_AMBIGUOUS)
"""Outcomes of an unwanted goal that stand, should it succeed all the same."""


def cancel(outcome: Outcome, why: str) -> Step:
    """Return the step that cancels a running goal."""
    return Step(
        lambda goal: stop(goal, outcome, goal.say(why)),
        frozenset({State.CANCELING}),
        f"Cancel: {outcome}",
    )


def stop(goal: Facts, outcome: Outcome, reason: str) -> State:
    """Cancel a running goal."""
    goal.plan(outcome, reason)
    goal.deadlines.disarm(Event.RESULT_DUE, Event.FEEDBACK_DUE, Event.CANCEL_DUE)
    goal.deadlines.arm(Event.CANCEL_DUE, goal.timeouts.cancel)
    goal.ask()
    return State.CANCELING


def _plan_anew(goal: Facts, outcome: Outcome, why: str) -> None:
    if goal.planned not in (Outcome.CANCELED, outcome):
        goal.plan(outcome, f"{why} ({goal.reason})")


@leads_to()
def interrupted(goal: Facts) -> None:
    """Decide CANCELED, whatever the goal was canceled for."""
    asked_at = goal.asking.asked_at
    is_news = goal.outcome is not None or goal.planned is not Outcome.CANCELED
    if is_news and asked_at is not None and goal.steady - asked_at >= ASK_AGAIN:
        goal.ask()  # a caller waits for the end now
    _plan_anew(goal, Outcome.CANCELED, "interrupted by the tree")


@leads_to()
def replaced(goal: Facts) -> None:
    """Decide CANCELED, whatever the goal was canceled for.

    No attempt may be beside the newer goal.
    """
    _plan_anew(goal, Outcome.CANCELED, "replaced by a newer goal")


@leads_to()
def taken_by_two(goal: Facts) -> None:
    """Cancel, at both; the goal must not count as done, or be tried again."""
    _plan_anew(goal, Outcome.SERVER_AMBIGUOUS, "both of two servers may have it")
    goal.ask()


@leads_to(State.DONE)
def finished(goal: Facts) -> State:
    """Decide what the goal was canceled for; SUCCEEDED, late, if only a deadline had passed."""
    if goal.take_result() == STATUS_SUCCEEDED and goal.planned not in NEVER_DONE:
        goal.settle(Outcome.SUCCEEDED, f"late: {goal.reason}")
    if goal.outcome is None and goal.asking.answer == CANCEL_REJECTED:
        goal.reason += goal.cancel_said
    goal.settle_as_planned()
    return State.DONE


@leads_to()
def cancel_answered(goal: Facts) -> None:
    """Take note of the answer; the end of the goal, or the time of denials, decides."""
    goal.asking.cancel_answered(goal.detail, goal.steady)


@leads_to(State.DONE)
def cancel_due(goal: Facts) -> State:
    """Free the leaf; ask the server on and on, unless the status shows the end."""
    if goal.lost_result.status is None:
        goal.settle_as_planned()
        goal.ask()
        return State.CANCELING
    if goal.lost_result.questions > 1:
        return goal.end_by_status()
    if goal.lost_result.questions == 0:
        ask_again(goal)
    goal.deadlines.arm(Event.CANCEL_DUE, ASK_AGAIN)  # the result itself tells more
    return State.CANCELING


@leads_to(State.DONE)
def ask_again(goal: Facts) -> State:
    """Ask again; after several questions for a result believe the status."""
    if goal.lost_result.asked_in_vain():
        return goal.end_by_status()
    goal.ask()
    return goal.state


@leads_to(State.DONE)
def drain_gave_up(goal: Facts) -> State:
    """Wait no longer; an end that is unknown by now is UNKNOWN, and may become known."""
    goal.asking.in_vain = True
    if goal.lost_result.questions > 0:
        return goal.end_by_status()
    goal.settle_as_planned()
    if goal.may_still_be_accepted:
        goal.end = End.UNKNOWN  # the goal is canceled if it turns up all the same
    return goal.state


@leads_to(State.LOST, State.DONE)
def server_lost(goal: Facts) -> State:
    """Free the leaf: SERVER_LOST; keep the goal, in case the server is not dead."""
    goal.settle_as_planned(Outcome.SERVER_LOST, str(goal.detail))
    goal.asking.denied_since = math.inf
    if goal.phase is not State.NOT_RECEIVED:  # a goal that was denied for less may run by now
        goal.end = End.SERVER_GONE
    state = _keep(goal)
    if goal.state is not state is State.LOST and goal.end is End.SERVER_GONE:
        goal.deadlines.arm(Event.LOOK_OUT_DUE, LOOKED_OUT_FOR)
    return state


@leads_to(State.LOST, State.DONE)
def parked(goal: Facts) -> State:
    """Keep the goal for the next node that sees its server; an unknown end stays UNKNOWN."""
    goal.settle_as_planned(Outcome.CANCELED, "its node was closed")
    if goal.may_still_be_accepted:
        goal.end = End.UNKNOWN
    return _keep(goal)


def _keep(goal: Facts) -> State:
    if goal.lost_result.status is not None:
        return goal.end_by_status()
    goal.deadlines.clear()
    goal.release()
    return State.LOST


@leads_to(State.CANCELING, State.UNCONFIRMED, State.PRESUMED_NOT_RECEIVED, State.NOT_RECEIVED)
def returned(goal: Facts) -> State:
    """Cancel the goal, which the server may still run."""
    goal.asking.begin_anew(goal.steady)
    if goal.phase is State.NOT_RECEIVED:  # still so; to ask does no harm
        goal.commands.append(Command.CANCEL)
        return State.NOT_RECEIVED
    goal.end = End.UNKNOWN
    goal.asking.in_vain = False  # a server can tell again
    goal.ask()
    if goal.accepted:
        return State.CANCELING
    if goal.phase is State.PRESUMED_NOT_RECEIVED:  # until the next denial
        return State.PRESUMED_NOT_RECEIVED
    goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience)
    return State.UNCONFIRMED


@leads_to(State.CANCELING)
def runs(goal: Facts) -> State:
    """Cancel at once: the goal runs, so its server is back."""
    return (returned if goal.accepted else requested.turned_up)(goal)


@leads_to()
def ask_another(goal: Facts) -> None:
    """Ask for the result; ask to cancel again, too, where the goal is to be canceled."""
    if goal.state not in (State.EXECUTING, State.REPLACED):
        goal.commands.append(Command.CANCEL)
    if goal.accepted:
        goal.commands.append(Command.ASK_RESULT)


@leads_to(State.DONE)
def abandoned(goal: Facts) -> State:
    """Forget the goal; an end that is unknown by now stays so."""
    return State.DONE
