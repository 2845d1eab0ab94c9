"""Steps about who is there to ask: the server is lost, or back, or another one; or we go ourselves.

A server that is lost may only be out of reach, and still run the goal. So the leaf is free at once,
and the goal is kept: where its server is seen again, it is canceled first of all.
"""

from __future__ import annotations

from typing import Any

from bt_actions.goals.facts import Facts
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.steps import requested
from bt_actions.goals.steps.step import leads_to
from bt_actions.goals.terms import Command, Event, State


@leads_to(State.LOST, State.DONE)
def server_lost(goal: Facts, detail: Any) -> State:
    """Free the leaf: SERVER_LOST; keep the goal, in case the server is not dead."""
    goal.settle_as_planned(Outcome.SERVER_LOST, str(detail))
    goal.asking.denied_since = None
    if goal.phase is not State.NOT_RECEIVED:  # what was denied for less may have come since
        goal.end = End.SERVER_GONE
    return _keep(goal)


@leads_to(State.LOST, State.DONE)
def parked(goal: Facts, detail: Any) -> State:
    """Keep the goal for the next node that sees its server; what is not known stays UNKNOWN."""
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
def returned(goal: Facts, detail: Any) -> State:
    """Cancel what it may still run."""
    goal.asking.begin_anew(goal.steady)
    if goal.phase is State.NOT_RECEIVED:  # nor will it; to ask does no harm
        goal.commands.append(Command.CANCEL)
        return State.NOT_RECEIVED
    goal.end = End.UNKNOWN
    goal.drain_gave_up = False  # there is somebody again who can tell
    goal.ask()
    if goal.accepted:
        return State.CANCELING
    if goal.phase is State.PRESUMED_NOT_RECEIVED:  # until it is denied once more
        return State.PRESUMED_NOT_RECEIVED
    goal.deadlines.arm(Event.ACCEPT_DUE, goal.patience)
    return State.UNCONFIRMED


@leads_to(State.CANCELING)
def runs(goal: Facts, detail: Any) -> State:
    """It runs, so its server is back: canceled at once."""
    return (returned if goal.accepted else requested.turned_up)(goal)


@leads_to()
def ask_another(goal: Facts, detail: Any) -> State:
    """Ask for the result; what is to be canceled, is asked to cancel again, too."""
    if goal.state not in (State.EXECUTING, State.REPLACED):
        goal.commands.append(Command.CANCEL)
    if goal.accepted:
        goal.commands.append(Command.ASK_RESULT)
    return goal.state


@leads_to()
def drain_gave_up(goal: Facts, detail: Any) -> State:
    """Nobody waits any longer."""
    goal.drain_gave_up = True
    return State.LOST


@leads_to(State.DONE)
def abandoned(goal: Facts, detail: Any) -> State:
    """Forget it; what is not known by now stays so."""
    return State.DONE
