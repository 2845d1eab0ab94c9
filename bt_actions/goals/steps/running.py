"""Steps of a goal that its server has accepted: feedback, status, result, and lost ones of these.

Most steps are the same for a wanted and an unwanted goal.
"""

from __future__ import annotations

from bt_actions.goals.asking import ASK_AGAIN, ASK_IN_ANY_CASE, DOUBTS, LostResult
from bt_actions.goals.facts import PATIENCE, Facts, leads_to
from bt_actions.goals.policy import Outcome
from bt_actions.goals.steps import canceling
from bt_actions.goals.terms import (
    ENDS,
    OUTCOMES,
    STATUS_ABORTED,
    STATUS_CANCELED,
    Command,
    Event,
    State,
)


@leads_to()
def feedback(goal: Facts) -> None:
    """End the silence: timeout.feedback begins anew."""
    still_runs(goal)
    if goal.lost_result.status is None:
        goal.deadlines.arm(Event.FEEDBACK_DUE, goal.timeouts.feedback)


@leads_to()
def still_runs(goal: Facts) -> None:
    """Believe that the goal runs, even if it was denied, or, long ago, shown as ended."""
    goal.feedback = goal.detail
    goal.lost_result.denials = 0
    if goal.lost_result.questions > 0:
        goal.lost_result = LostResult()


@leads_to()
def status(goal: Facts) -> None:
    """Ask again for the result of a goal that has ended, in case the result was lost."""
    if goal.detail not in ENDS:
        goal.lost_result = LostResult()
    elif goal.lost_result.status is None:
        goal.lost_result.status = goal.detail
        goal.deadlines.disarm(Event.FEEDBACK_DUE)  # the goal is silent because it has ended
        goal.deadlines.arm(Event.POLL_DUE, ASK_AGAIN)


@leads_to(State.DONE)
def ask_for_result(goal: Facts) -> State:
    """Ask again; after several questions believe the status."""
    if goal.lost_result.asked_in_vain():
        goal.settle_as_planned(Outcome.SERVER_LOST, f"{goal.server} finished, but gave no result")
        return goal.end_by_status()
    goal.commands.append(Command.ASK_RESULT)
    again = ASK_IN_ANY_CASE if goal.lost_result.status is None else ASK_AGAIN
    goal.deadlines.arm(Event.POLL_DUE, again)
    return goal.state


@leads_to(State.DONE)
def finished(goal: Facts) -> State:
    """Decide SUCCEEDED, ABORTED or CANCELED_BY_OTHER."""
    ended, why = goal.take_result(), ""
    if ended == STATUS_ABORTED:
        why = f"aborted by {goal.server}{goal.blamed}"
    elif ended == STATUS_CANCELED:
        why = "canceled, and not by this process"
    goal.settle(OUTCOMES[ended], why)
    return State.DONE


@leads_to(State.DONE)
def denied(goal: Facts) -> State:
    """Ask again; believe the third denial: SERVER_LOST, or what the goal was canceled for."""
    goal.lost_result.denials += 1
    if goal.lost_result.denials < DOUBTS:
        goal.deadlines.arm(Event.POLL_DUE, ASK_AGAIN)
        return goal.state
    if goal.lost_result.status is None:
        goal.commands.append(Command.CANCEL)  # should the goal run all the same
    if goal.planned is None:
        goal.plan(Outcome.SERVER_LOST, f"{goal.server} no longer knows the goal it accepted")
    return goal.end_by_status()


@leads_to(State.REPLACED, State.CANCELING)
def replaced(goal: Facts) -> State:
    """Give the goal timeout.cancel to end; where another server has the newer goal, cancel."""
    if goal.detail not in (None, goal.server):
        return canceling.stop(goal, Outcome.CANCELED, f"replaced by a newer goal on {goal.detail}")
    if goal.state is State.EXECUTING:  # a third goal gives it no more time
        goal.plan(Outcome.CANCELED, "replaced by a newer goal")
        goal.deadlines.disarm(Event.RESULT_DUE, Event.FEEDBACK_DUE)
        goal.deadlines.arm(Event.CANCEL_DUE, goal.timeouts.cancel or PATIENCE)
    return State.REPLACED
