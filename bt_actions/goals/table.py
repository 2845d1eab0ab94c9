"""The table: the step for every state of a goal and every event, and the states that may follow.

docs/goal.md is made from the table. steps/ has the work of a step, terms.py the meaning of a state
or an event.
"""

from __future__ import annotations

from bt_actions.goals.facts import Step, drop
from bt_actions.goals.policy import Outcome
from bt_actions.goals.steps import canceling, requested, running
from bt_actions.goals.terms import ACCEPTED, MAY_STILL_BE_ACCEPTED, Event, State

TABLE: dict[tuple[State, Event], Step] = {
    (state, event): drop for state in State for event in Event
}
"""Every pair is decided; a pair that is not decided below is dropped."""

_TWO = "two action servers answer to {server}, and both may have it"


def _in(*states: State, **steps: Step) -> None:
    """Decide these events in these states."""
    for state in states:
        TABLE.update({(state, Event[name]): step for name, step in steps.items()})


# Not sent yet
_in(
    State.QUEUED,
    State.WAITING_FOR_SERVER,
    INTERRUPTED=requested.give_up(Outcome.CANCELED, "interrupted before the goal was sent"),
    ABANDONED=requested.give_up(Outcome.CANCELED, "its node was closed"),
)
_in(
    State.QUEUED,
    GRANTED=requested.granted,
    TAKEN=requested.give_up(Outcome.SERVER_BUSY, "{names} is in use by another goal"),
    QUEUE_DUE=requested.give_up(
        Outcome.SERVER_BUSY, "{names} was not free within {limits.queue:g} s"
    ),
)
_in(
    State.WAITING_FOR_SERVER,
    SERVER_READY=requested.send,
    INVALID=requested.give_up(Outcome.INVALID_GOAL, "{detail}"),
    SERVER_AMBIGUOUS=requested.give_up(
        Outcome.SERVER_AMBIGUOUS,
        "two action servers answer to {server}: a goal would be executed twice",
    ),
    SERVER_DUE=requested.give_up(
        Outcome.SERVER_UNAVAILABLE, "no action server {server} within {limits.server:g} s"
    ),
    REPLACED=requested.give_up(Outcome.CANCELED, "replaced by a newer goal before it was sent"),
)

# Sent, and wanted
_in(
    State.SENDING,
    ACCEPTED=requested.begin,
    REJECTED=requested.rejected,
    INTERRUPTED=requested.withdraw(
        Outcome.CANCELED, "interrupted by the tree before the goal was accepted"
    ),
    REPLACED=requested.withdraw(
        Outcome.CANCELED, "replaced by a newer goal before it was accepted"
    ),
    SERVER_AMBIGUOUS=requested.withdraw(Outcome.SERVER_AMBIGUOUS, _TWO),
)
_in(
    State.EXECUTING,
    State.REPLACED,
    POLL_DUE=running.ask_for_result,
    INTERRUPTED=canceling.cancel(Outcome.CANCELED, "interrupted by the tree"),
    REPLACED=running.replaced,
)
_in(
    State.EXECUTING,
    FEEDBACK=running.feedback,
    RESULT=running.finished,
    RESULT_DUE=canceling.cancel(
        Outcome.RESULT_TIMEOUT, "not finished within {limits.result:g} s{goal.blamed}"
    ),
    FEEDBACK_DUE=canceling.cancel(
        Outcome.STALLED, "no feedback for {limits.feedback:g} s{goal.blamed}"
    ),
    SERVER_AMBIGUOUS=canceling.cancel(Outcome.SERVER_AMBIGUOUS, _TWO),
)
_in(
    State.REPLACED,
    FEEDBACK=running.still_runs,
    RESULT=canceling.finished,
    CANCEL_DUE=canceling.cancel(Outcome.CANCELED, "replaced by a newer goal, and did not end"),
    SERVER_AMBIGUOUS=canceling.cancel(Outcome.CANCELED, _TWO),
)

# Accepted, wanted or not
_in(*ACCEPTED, STATUS=running.status, RESULT_UNKNOWN=running.denied)

# Not wanted any more
_in(
    State.CANCELING,
    *MAY_STILL_BE_ACCEPTED,
    INTERRUPTED=canceling.interrupted,
    REPLACED=canceling.replaced,
    SERVER_AMBIGUOUS=canceling.taken_by_two,
    POLL_DUE=canceling.ask_again,
    CANCEL_ANSWERED=canceling.cancel_answered,
    DRAIN_GAVE_UP=canceling.drain_gave_up,
)
_in(
    State.CANCELING,
    RESULT=canceling.finished,
    FEEDBACK=running.still_runs,
    CANCEL_DUE=canceling.cancel_due,
)
_in(
    *MAY_STILL_BE_ACCEPTED,
    State.NOT_RECEIVED,
    ACCEPTED=requested.turned_up,
    REJECTED=requested.rejected,
)
_in(
    State.SENDING,
    State.UNWANTED,
    SEND_FAILED=requested.send_failed,
    ACCEPT_DUE=requested.accept_due,
)
_in(State.UNCONFIRMED, ACCEPT_DUE=requested.presume)
_in(  # a denial: by any other answer `Goal.on` has made it accepted first
    State.PRESUMED_NOT_RECEIVED, CANCEL_ANSWERED=requested.denied_again
)

# The server comes, goes, or changes
_in(*ACCEPTED, *MAY_STILL_BE_ACCEPTED, SERVER_CHANGED=canceling.ask_another)
_in(
    State.SENDING,
    *ACCEPTED,
    *MAY_STILL_BE_ACCEPTED,
    State.NOT_RECEIVED,
    SERVER_LOST=canceling.server_lost,
    PARKED=canceling.parked,
)
_in(State.NOT_RECEIVED, State.LOST, ABANDONED=canceling.abandoned)
_in(
    State.LOST,
    SERVER_LOST=canceling.server_lost,
    SERVER_RETURNED=canceling.returned,
    ACCEPTED=canceling.runs,
    RESULT=canceling.finished,
    DRAIN_GAVE_UP=canceling.drain_gave_up,
)
