"""The table: what is done for every state of a goal and every event, and which states may follow.

docs/goal.md is made from it. What a step does is in steps/, what a state or an event means in
terms.py.
"""

from __future__ import annotations

from bt_actions.goals.policy import Outcome
from bt_actions.goals.steps import canceling, lost, running, unanswered, unsent
from bt_actions.goals.steps.step import Step, drop
from bt_actions.goals.terms import ACCEPTED, UNANSWERED, Event, State

TABLE: dict[tuple[State, Event], Step] = {
    (state, event): drop for state in State for event in Event
}
"""Every pair is decided; what is not decided below is dropped."""

_TWO = "two action servers answer to {server}, and both may have it"


def _in(*states: State, **steps: Step) -> None:
    """Decide these events in these states."""
    for state in states:
        TABLE.update({(state, Event[name]): step for name, step in steps.items()})


# Not sent yet
_in(
    State.QUEUED,
    State.WAITING_FOR_SERVER,
    INVALID=unsent.give_up(Outcome.INVALID_GOAL, "{detail}"),
    INTERRUPTED=unsent.give_up(Outcome.CANCELED, "interrupted before the goal was sent"),
    PROCESS_EXITING=unsent.give_up(Outcome.CANCELED, "the process ended"),
)
_in(
    State.QUEUED,
    GRANTED=unsent.granted,
    TAKEN=unsent.give_up(Outcome.SERVER_BUSY, "{names} is in use by another goal"),
    QUEUE_DUE=unsent.give_up(Outcome.SERVER_BUSY, "{names} was not free within {limits.queue:g} s"),
)
_in(
    State.WAITING_FOR_SERVER,
    SERVER_READY=unsent.send,
    SERVER_AMBIGUOUS=unsent.give_up(
        Outcome.SERVER_AMBIGUOUS,
        "two action servers answer to {server}: a goal would be executed twice",
    ),
    SERVER_DUE=unsent.give_up(
        Outcome.SERVER_UNAVAILABLE, "no action server {server} within {limits.server:g} s"
    ),
    REPLACED=unsent.give_up(Outcome.CANCELED, "replaced by a newer goal before it was sent"),
)

# Sent, and wanted
_in(
    State.SENDING,
    SEND_FAILED=unsent.send_failed,
    ACCEPTED=unanswered.begin,
    REJECTED=unanswered.rejected,
    ACCEPT_DUE=unanswered.accept_due,
    INTERRUPTED=unanswered.withdraw(
        Outcome.CANCELED, "interrupted by the tree before the goal was accepted"
    ),
    REPLACED=unanswered.withdraw(
        Outcome.CANCELED, "replaced by a newer goal before it was accepted"
    ),
    SERVER_AMBIGUOUS=unanswered.withdraw(Outcome.SERVER_AMBIGUOUS, _TWO),
)
_in(
    State.EXECUTING,
    State.REPLACED,
    STATUS=running.status,
    RESULT_UNKNOWN=running.denied,
    POLL_DUE=running.ask_for_result,
    INTERRUPTED=canceling.cancel(Outcome.CANCELED, "interrupted by the tree"),
    REPLACED=running.replaced,
)
_in(
    State.EXECUTING,
    FEEDBACK=running.feedback,
    RESULT=running.finished,
    RESULT_DUE=canceling.cancel(Outcome.RESULT_TIMEOUT, "not finished within {limits.result:g} s"),
    FEEDBACK_DUE=canceling.cancel(Outcome.STALLED, "no feedback for {limits.feedback:g} s"),
    SERVER_AMBIGUOUS=canceling.cancel(Outcome.SERVER_AMBIGUOUS, _TWO),
)
_in(
    State.REPLACED,
    FEEDBACK=running.goes_on,
    RESULT=canceling.finished,
    CANCEL_DUE=canceling.cancel(Outcome.CANCELED, "replaced by a newer goal, and did not end"),
    SERVER_AMBIGUOUS=canceling.cancel(Outcome.CANCELED, _TWO),
)

# Not wanted any more
_in(
    State.CANCELING,
    *UNANSWERED,
    INTERRUPTED=canceling.interrupted,
    REPLACED=canceling.replaced,
    SERVER_AMBIGUOUS=canceling.taken_by_two,
    POLL_DUE=canceling.ask_again,
    CANCEL_ANSWERED=canceling.cancel_answered,
    DRAINED=canceling.drained,
)
_in(
    State.CANCELING,
    RESULT=canceling.finished,
    FEEDBACK=running.goes_on,
    STATUS=running.status,
    RESULT_UNKNOWN=running.denied,
    CANCEL_DUE=canceling.cancel_due,
)
_in(
    *UNANSWERED,
    State.NOT_RECEIVED,
    ACCEPTED=unanswered.turned_up,
    REJECTED=unanswered.rejected,
)
_in(State.UNWANTED, SEND_FAILED=unsent.send_failed, ACCEPT_DUE=unanswered.accept_due)
_in(State.UNCONFIRMED, ACCEPT_DUE=unanswered.presume)
_in(State.PRESUMED_NOT_RECEIVED, CANCEL_ANSWERED=unanswered.denied_again)

# Who is there to ask
_in(
    *ACCEPTED,
    *UNANSWERED,
    SERVER_CHANGED=lost.ask_another,
)
_in(
    State.SENDING,
    *ACCEPTED,
    *UNANSWERED,
    State.NOT_RECEIVED,
    SERVER_LOST=lost.server_lost,
    NODE_CLOSED=lost.node_closed,
    PROCESS_EXITING=lost.exiting,
)
_in(
    State.LOST,
    SERVER_LOST=lost.server_lost,
    SERVER_RETURNED=lost.returned,
    ACCEPTED=lost.runs,
    RESULT=canceling.finished,
    DRAINED=canceling.drained,
    PROCESS_EXITING=lost.exiting,
)
