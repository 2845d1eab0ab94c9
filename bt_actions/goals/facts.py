"""The facts of one goal, and the steps of the table, which change them.

Every room may read the facts. The goal's steps (goals/steps) write them, through the tools below,
which hold what several steps do alike. `Goal.on` writes the state that a step has led to. A caller
may add to `reason`. A step sends nothing, and leaves `commands` to the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from bt_actions.goals.asking import Asking, LostResult
from bt_actions.goals.deadlines import Deadlines
from bt_actions.goals.policy import Busy, End, Outcome, Timeouts
from bt_actions.goals.terms import (
    ACCEPTED,
    CANCEL_ACCEPTED,
    CANCEL_REJECTED,
    ENDS,
    MAY_STILL_BE_ACCEPTED,
    Command,
    Event,
    Now,
    State,
)
from bt_actions.utilities.shorten import given_fields, shorten

PATIENCE = 5.0
"""Seconds for an answer about an unwanted goal, where the user gave no deadline."""
FIELDS_SHOWN = 60
"""Characters of a goal's fields in a reason that blames the goal."""


class Facts:
    """The facts of one goal."""

    message: Any = None
    """The goal message, until its leaf has the outcome: reasons quote it, and no step depends on
    it."""
    untold: Collection[str] = ()
    """Fields that say who asks, and not for what: no reason quotes them."""
    is_secret = False
    """Whether every reason and every event keeps silent about its fields."""
    _fields_then = ""

    def __init__(
        self,
        goal_id: bytes,
        server: str,
        timeouts: Timeouts,
        now: Now,
        *,
        resources: frozenset[str] = frozenset(),
        busy: Busy = Busy.WAIT,
        accounts_for_all: Callable[[Any], bool] = lambda result: True,
    ) -> None:
        self.id = goal_id
        self.server = server
        self.timeouts = timeouts
        self.resources = resources or frozenset({server})
        self.busy = busy
        self.accounts_for_all = accounts_for_all
        """Returns whether nothing that the goal began still runs, as its result says (None: a
        lost result)."""
        self.state = self.last_live = State.QUEUED
        """The state; and, for a goal that is LOST or DONE, the state before that."""
        self.planned: Outcome | None = None
        """The outcome that an unwanted goal will have when it has ended."""
        self.outcome: Outcome | None = None
        self.reason = ""
        self.end = End.NEVER_STARTED
        self.result: Any = None
        self.feedback: Any = None
        self.claims_resources = True
        """Whether the goal has its resources, or a place in the queue for them."""
        self.asking = Asking()
        self.lost_result = LostResult()
        self.deadlines = Deadlines(now)
        self.deadlines.arm(Event.QUEUE_DUE, timeouts.queue)
        self.commands: list[Command] = []
        """The commands of the present step."""
        self.detail: Any = None
        """The detail of the present event."""

    @property
    def phase(self) -> State:
        """The state, or for a LOST or DONE goal the last one in which its server could be asked."""
        return self.last_live if self.state in (State.LOST, State.DONE) else self.state

    @property
    def sent(self) -> bool:
        """Whether a request went out, so that answers may come."""
        return self.phase not in (State.QUEUED, State.WAITING_FOR_SERVER)

    @property
    def accepted(self) -> bool:
        """Whether the server is known to have accepted the goal."""
        return self.phase in ACCEPTED

    @property
    def may_still_be_accepted(self) -> bool:
        """Whether an unwanted request may still be accepted.

        True also while the server denies the goal: the tree goes on, but must ask again before it
        ends.
        """
        return self.state in MAY_STILL_BE_ACCEPTED

    @property
    def patience(self) -> float:
        """Seconds for the server to answer about a goal that it did not accept."""
        return self.timeouts.accept or self.timeouts.cancel or PATIENCE

    @property
    def steady(self) -> float:
        """The steady clock at the last moment that was told, in seconds."""
        return self.deadlines.now.steady

    @property
    def cancel_said(self) -> str:
        """The server's answer to the request to cancel the goal, to follow a reason; or ""."""
        gone = self.state is State.LOST and self.end is not End.UNKNOWN  # else only its node is
        if gone or self.asking.asked_at is None or self.state is State.DONE:
            return ""
        words = {
            None: "has not answered the request to cancel it",
            CANCEL_ACCEPTED: "has agreed to cancel it, and it has not ended",
            CANCEL_REJECTED: "refuses to cancel it",
        }
        said = words.get(self.asking.answer)
        return f"; {self.server} {said}" if said else ""

    @property
    def blamed(self) -> str:
        """The fields, to follow a reason that blames the goal; or ""."""
        fields = self.fields
        return f"; goal {fields}" if fields else ""

    def forget_message(self) -> None:
        """Drop the message, which may be large, and keep its fields for later reasons."""
        if self.state is not State.DONE:
            self._fields_then = self.fields
        self.message = None

    @property
    def fields(self) -> str:
        """The fields that the goal message gives, in short: ``{distance: 12.0}``; or "".

        The fields of a secret goal are "".
        """
        if self.is_secret:
            return ""
        if self.message is None:
            return self._fields_then
        given = given_fields(self.message)
        asks = {name: given[name] for name in given if name not in self.untold}
        told = asks or self.message  # a message that gives no field is told whole
        text = shorten(told, FIELDS_SHOWN) if told else ""
        return f"{text}}}" if text.endswith("…") else text

    # For the steps

    def say(self, why: str) -> str:
        """Return a reason with the names and numbers of this goal in it."""
        names = ", ".join(sorted(self.resources))
        return why.format(
            names=names, server=self.server, limits=self.timeouts, detail=self.detail, goal=self
        )

    def plan(self, outcome: Outcome, reason: str) -> None:
        """Plan the outcome that the goal has when it has ended, unless the outcome is decided."""
        if self.outcome is None:
            self.planned, self.reason = outcome, reason

    def settle(self, outcome: Outcome, reason: str) -> None:
        """Decide the outcome, once: the leaf is free."""
        if self.outcome is None:
            self.outcome, self.reason = outcome, reason

    def settle_as_planned(self, otherwise: Outcome = Outcome.CANCELED, reason: str = "") -> None:
        """Decide the outcome: the planned one, if there is one."""
        if self.planned is None:
            self.settle(otherwise, reason)
        else:
            self.settle(self.planned, self.reason)

    def take_result(self) -> int:
        """Keep the result and the end; return the status."""
        status: int
        status, self.result = self.detail
        self.end = ENDS[status] if self.accounts_for_all(self.result) else End.UNKNOWN
        return status

    def end_by_status(self) -> State:
        """Believe the status, if one has shown the end; no further question follows."""
        if self.lost_result.status is not None:
            self.end = ended = ENDS[self.lost_result.status]
            if ended is End.ABORTED and not self.accounts_for_all(None):
                self.end = End.UNKNOWN  # only its result could have told what goes on below it
            if self.outcome is None:
                self.reason += f"; it ended as {ended}, and its result was lost"
        self.settle_as_planned()
        return State.DONE

    def release(self) -> None:
        """Give the resources back, once."""
        if self.claims_resources:
            self.claims_resources = False
            self.commands.append(Command.RELEASE)

    def ask(self) -> None:
        """Ask to cancel and, of an accepted goal, for the result; ask again in a while."""
        self.commands.append(Command.CANCEL)
        if self.accepted:
            self.commands.append(Command.ASK_RESULT)
        self.deadlines.arm(Event.POLL_DUE, self.asking.ask(self.steady))


Does = Callable[[Facts], State | None]
"""Changes the goal; returns the next state, if the state changes."""


@dataclass(frozen=True, slots=True)
class Step:
    """One decision: the work, also in words, and the states that may follow."""

    does: Does
    to: frozenset[State]
    """States that may follow, beside the state in which the step is made."""
    says: str

    def __call__(self, goal: Facts) -> State:
        """Make the step; return the state that follows."""
        return self.does(goal) or goal.state


def leads_to(*to: State) -> Callable[[Does], Step]:
    """Make a function a step, which leads to one of these states or stays in its own.

    docs/goal.md quotes the first line of the function's docstring.
    """

    def step(does: Does) -> Step:
        says = (does.__doc__ or "").partition("\n")[0]  # python -OO leaves no docstring
        return Step(does, frozenset(to), says.rstrip("."))

    return step


@leads_to()
def drop(goal: Facts) -> None:
    """Drop the event, which came too late, or twice, to mean anything."""
