"""The words in which a goal's life is told: its states, what can happen to it, what it commands.

Values only; what follows from what is decided in table.py.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from bt_actions.goals.policy import End, Outcome

NEVER = float("-inf")
"""A moment that no moment is before: it has not happened yet."""


class Now(NamedTuple):
    """One moment on both clocks, in seconds; only differences mean anything."""

    steady: float
    ros: float
    """The node's clock: stands still and jumps where simulated time does."""


class State(Enum):
    """Where a goal is in its life."""

    __hash__ = object.__hash__  # Enum has one in Python, which is asked often

    QUEUED = "It waits for its resources."
    WAITING_FOR_SERVER = "It holds its resources, and waits for a server to send to."
    SENDING = "The request is out, and not answered."
    EXECUTING = "The server has accepted it."
    REPLACED = "A newer goal of ours was accepted in its place: it is given time to end by itself."
    CANCELING = "The server has accepted it, and it is not wanted any more: its end is awaited."
    UNWANTED = "Not wanted any more before the request was answered: canceled once accepted."
    UNCONFIRMED = "The request was not answered in time: the server may have it, and is asked."
    PRESUMED_NOT_RECEIVED = (
        "The server denies it, so the tree goes on; should it turn up, it is canceled."
    )
    NOT_RECEIVED = "Denied for so long that nobody waits for it; canceled should it turn up."
    LOST = (
        "Its server went away, or who sent it has left. The leaf is free; should its server be "
        "seen again, perhaps by another node of this process, it is canceled first of all."
    )
    DONE = "There is nothing left to do for it."

    shown: str
    """The name in ``--json`` and on the terminal, which tell less finely."""


MAY_STILL_BE_ACCEPTED = frozenset({State.UNWANTED, State.UNCONFIRMED, State.PRESUMED_NOT_RECEIVED})
"""A goal that was sent, is not wanted any more, and may still be accepted."""
ACCEPTED = frozenset({State.EXECUTING, State.REPLACED, State.CANCELING})
_SHOWN = {
    State.REPLACED: "EXECUTING",
    **dict.fromkeys((*MAY_STILL_BE_ACCEPTED, State.NOT_RECEIVED, State.LOST), "CANCELING"),
}
for _state in State:
    _state.shown = _SHOWN.get(_state, _state.name)
MAY_TURN_UP = MAY_STILL_BE_ACCEPTED | {State.SENDING, State.NOT_RECEIVED, State.LOST}
"""Feedback or a status is news: it was accepted, and runs, or has run."""


class Command(Enum):
    """The next work of the caller."""

    __hash__ = object.__hash__  # Enum has one in Python, which is asked often

    RELEASE = "give the resources back, or leave the queue for them"
    SEND = "send the goal request"
    ASK_RESULT = "ask for the result; asking twice does no harm"
    CANCEL = "ask the server to cancel this goal; asking twice does no harm"


class Event(Enum):
    """The events of a goal. A comment names the detail that comes with one."""

    __hash__ = object.__hash__  # Enum has one in Python, which is asked often

    GRANTED = "the resources are ours"
    TAKEN = "the resources are taken, and waiting is not wanted"
    SERVER_READY = "one live server is there, and nothing speaks against sending"
    SERVER_AMBIGUOUS = "two live servers are there; if it was sent, both may have it"
    INVALID = "the message could not be built"  # reason
    SEND_FAILED = "the request did not leave"  # reason
    ACCEPTED = "the server accepted the goal"
    REJECTED = "the server refused the goal"
    FEEDBACK = "feedback came"  # the message
    STATUS = "the status topic shows the goal"  # GoalStatus number
    RESULT = "the result came"  # (GoalStatus number, message)
    RESULT_UNKNOWN = "whoever may have the goal does not know it"
    CANCEL_ANSWERED = "the server answered a cancel request"  # CancelGoal return code
    SERVER_CHANGED = "another server answers under the name; is the goal still known?"
    SERVER_LOST = "the server died or was restarted"  # reason
    SERVER_RETURNED = "the server we had lost is back, with whatever it still runs"
    INTERRUPTED = "the tree no longer wants it"
    REPLACED = "a newer goal of this process was accepted in its place"  # by which server
    DRAIN_GAVE_UP = "the end of its tree has waited for it long enough: what is not known stays so"
    PARKED = "who sent it leaves: it is kept for whoever sees its server next"
    ABANDONED = "nobody sees to it any more: its node was closed, or newer lost goals crowd it out"
    QUEUE_DUE = "timeout.queue has passed"
    SERVER_DUE = "timeout.server has passed"
    ACCEPT_DUE = "timeout.accept has passed"
    RESULT_DUE = "timeout.result has passed"
    FEEDBACK_DUE = "timeout.feedback has passed"
    CANCEL_DUE = "timeout.cancel has passed"
    POLL_DUE = "time to ask the server again"
    LOOK_OUT_DUE = "a server that went away was looked out for, and is not back: nobody waits now"


# GoalStatus and CancelGoal as ROS 2 numbers them (action_msgs).
STATUS_EXECUTING, STATUS_SUCCEEDED, STATUS_CANCELED, STATUS_ABORTED = 2, 4, 5, 6
CANCEL_ACCEPTED, CANCEL_REJECTED, CANCEL_UNKNOWN_GOAL, CANCEL_TERMINATED = 0, 1, 2, 3

ENDS = {STATUS_SUCCEEDED: End.SUCCEEDED, STATUS_CANCELED: End.CANCELED, STATUS_ABORTED: End.ABORTED}
OUTCOMES = {
    STATUS_SUCCEEDED: Outcome.SUCCEEDED,
    STATUS_CANCELED: Outcome.CANCELED_BY_OTHER,
    STATUS_ABORTED: Outcome.ABORTED,
}
FROM_SERVER = frozenset(
    {
        Event.ACCEPTED,
        Event.REJECTED,
        Event.FEEDBACK,
        Event.STATUS,
        Event.RESULT,
        Event.RESULT_UNKNOWN,
        Event.CANCEL_ANSWERED,
    }
)
SHOWS_ACCEPTANCE = (Event.FEEDBACK, Event.STATUS, Event.CANCEL_ANSWERED)
"""Only an accepted goal has it; the last one, unless the answer is a denial."""
ON_ROS_CLOCK = frozenset({Event.RESULT_DUE, Event.FEEDBACK_DUE})
