"""The terms of a goal's life: its states, its events, its commands.

Values only; table.py decides what follows from an event.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from bt_actions.goals.policy import End, Outcome

NEVER = float("-inf")
"""A moment before every moment, for an event that has not happened yet."""


class Now(NamedTuple):
    """One moment on both clocks, in seconds; only differences mean anything."""

    steady: float
    ros: float
    """The node's clock, which stands still and jumps where simulated time does."""


class State(Enum):
    """The state of a goal in its life."""

    __hash__ = object.__hash__  # Enum has one in Python, which is asked often

    QUEUED = "The goal waits for its resources."
    WAITING_FOR_SERVER = "The goal holds its resources, and waits for its server."
    SENDING = "The request is out, and not answered."
    EXECUTING = "The server has accepted the goal."
    REPLACED = (
        "A newer goal of ours was accepted in its place: the goal gets time to end by itself."
    )
    CANCELING = (
        "The server has accepted the goal, and nobody wants it any more: its end is awaited."
    )
    UNWANTED = (
        "Nobody wants the goal any more, and its request is open: it is canceled once accepted."
    )
    UNCONFIRMED = (
        "The request was not answered in time: the server may have the goal, and is asked."
    )
    PRESUMED_NOT_RECEIVED = (
        "The server denies the goal, so the tree goes on; should the goal turn up, it is canceled."
    )
    NOT_RECEIVED = (
        "The server has denied the goal for so long that nobody waits; should the goal turn up, it "
        "is canceled."
    )
    LOST = (
        "The goal's server went away, or its sender has left. The leaf is free; should the server "
        "be seen again, perhaps by another node of this process, the goal is canceled first of all."
    )
    DONE = "Nothing is left to do for the goal."

    shown: str
    """The name in ``--json`` and on the terminal, which tell states more coarsely."""


MAY_STILL_BE_ACCEPTED = frozenset({State.UNWANTED, State.UNCONFIRMED, State.PRESUMED_NOT_RECEIVED})
"""The states of a goal that was sent, is not wanted any more, and may still be accepted."""
ACCEPTED = frozenset({State.EXECUTING, State.REPLACED, State.CANCELING})
_SHOWN = {
    State.REPLACED: "EXECUTING",
    **dict.fromkeys((*MAY_STILL_BE_ACCEPTED, State.NOT_RECEIVED, State.LOST), "CANCELING"),
}
for _state in State:
    _state.shown = _SHOWN.get(_state, _state.name)
MAY_TURN_UP = MAY_STILL_BE_ACCEPTED | {State.SENDING, State.NOT_RECEIVED, State.LOST}
"""The states in which feedback or a status is news: the goal was accepted, and runs, or has run."""


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
    SERVER_READY = "one live server is there, and nothing bars the request"
    SERVER_AMBIGUOUS = "two live servers are there; if it was sent, both may have it"
    INVALID = "the message could not be built"  # reason
    SEND_FAILED = "the request did not leave"  # reason
    ACCEPTED = "the server accepted the goal"
    REJECTED = "the server refused the goal"
    FEEDBACK = "feedback came"  # the message
    STATUS = "the status topic shows the goal"  # GoalStatus number
    RESULT = "the result came"  # (GoalStatus number, message)
    RESULT_UNKNOWN = "every server that may have the goal denies it"
    CANCEL_ANSWERED = "the server answered a cancel request"  # CancelGoal return code
    SERVER_CHANGED = "another server answers under the name; is the goal still known?"
    SERVER_LOST = "the server died or was restarted"  # reason
    SERVER_RETURNED = "the lost server is back, with the goals that it still runs"
    INTERRUPTED = "the tree no longer wants it"
    REPLACED = "a newer goal of this process was accepted in its place"  # by which server
    DRAIN_GAVE_UP = "the drain has waited for it long enough: an unknown end stays unknown"
    PARKED = "its sender leaves: the goal is kept for the next node that sees its server"
    ABANDONED = "no node sees to it any more: its own was closed, or newer lost goals crowd it out"
    QUEUE_DUE = "timeout.queue has passed"
    SERVER_DUE = "timeout.server has passed"
    ACCEPT_DUE = "timeout.accept has passed"
    RESULT_DUE = "timeout.result has passed"
    FEEDBACK_DUE = "timeout.feedback has passed"
    CANCEL_DUE = "timeout.cancel has passed"
    POLL_DUE = "time to ask the server again"
    LOOK_OUT_DUE = "a server that went away is not back in time: nobody waits now"


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
"""Events of an accepted goal only; the last one, unless the answer is a denial."""
ON_ROS_CLOCK = frozenset({Event.RESULT_DUE, Event.FEEDBACK_DUE})
