"""The facts of one goal, and the steps of the table, which change them.

Everybody may read the facts. Its steps (goals/steps) write them, by the tools below, which
are said once where several steps do the same; `Goal.on` writes the state that a step has led to.
A caller may add to `reason`. A step sends nothing: what is to be done is left in `commands`.
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
"""Seconds for an answer that nobody wants any more, where the user gave no deadline."""
FIELDS_SHOWN = 60
"""Characters of a goal's fields in a reason that blames the goal."""


class Facts:
    """One goal as it stands."""

    message: Any = None
    """The goal message, until its leaf has the outcome: reasons tell of it, and no step depends
    on it."""
    untold: Collection[str] = ()
    """Its fields that say who asks, and not for what: no reason tells of them."""
    is_secret = False
    """Whether no reason, and no event, tells of its fields."""
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
        """Whether a result (None: a lost one) says that nothing it began still runs."""
        self.state = self.last_live = State.QUEUED
        """Where it is, and where it was before it was LOST or DONE."""
        self.planned: Outcome | None = None
        """The outcome when it has ended, of a goal that is not wanted any more."""
        self.outcome: Outcome | None = None
        self.reason = ""
        self.end = End.NEVER_STARTED
        self.result: Any = None
        self.feedback: Any = None
        self.claims_resources = True
        """Whether it has its resources, or a place in the queue for them."""
        self.asking = Asking()
        self.lost_result = LostResult()
        self.deadlines = Deadlines(now)
        self.deadlines.arm(Event.QUEUE_DUE, timeouts.queue)
        self.commands: list[Command] = []
        """Of the step that is being made."""
        self.detail: Any = None
        """The detail of the event that is being told."""

    @property
    def phase(self) -> State:
        """Where it is, or was when its server could last be asked."""
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
        """Whether the request may still be accepted, though nobody wants it any more.

        Also where its server denies it by now: the tree goes on, but must not end without asking
        again.
        """
        return self.state in MAY_STILL_BE_ACCEPTED

    @property
    def patience(self) -> float:
        """Seconds for the server to answer what it is asked of a goal that it did not accept."""
        return self.timeouts.accept or self.timeouts.cancel or PATIENCE

    @property
    def steady(self) -> float:
        """Seconds of the steady clock, as of the last moment that was told."""
        return self.deadlines.now.steady

    @property
    def cancel_said(self) -> str:
        """The server's answer to the request to cancel it, to follow a reason; or ""."""
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
        """Keep of the message, which is as large as the user's data, what may still be told."""
        if self.state is not State.DONE:
            self._fields_then = self.fields
        self.message = None

    @property
    def fields(self) -> str:
        """The fields that the goal message gives, in short: ``{distance: 12.0}``; or "".

        Of a goal that is a secret nothing is said.
        """
        if self.is_secret:
            return ""
        if self.message is None:
            return self._fields_then
        given = given_fields(self.message)
        asks = {name: given[name] for name in given if name not in self.untold}
        told = asks or self.message  # one that gives none is told whole
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
        """Let it have this outcome when it has ended, unless that is decided."""
        if self.outcome is None:
            self.planned, self.reason = outcome, reason

    def settle(self, outcome: Outcome, reason: str) -> None:
        """Decide the outcome, once: the leaf is free."""
        if self.outcome is None:
            self.outcome, self.reason = outcome, reason

    def settle_as_planned(self, otherwise: Outcome = Outcome.CANCELED, reason: str = "") -> None:
        """Decide the outcome: the one that was planned, if there is one."""
        if self.planned is None:
            self.settle(otherwise, reason)
        else:
            self.settle(self.planned, self.reason)

    def take_result(self) -> int:
        """Keep the result, and note how it ended; return the status."""
        status: int
        status, self.result = self.detail
        self.end = ENDS[status] if self.accounts_for_all(self.result) else End.UNKNOWN
        return status

    def end_by_status(self) -> State:
        """Believe the status, if one has shown the end; nothing more is asked."""
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
        """Ask to cancel and, where there will be one, for the result; again in a while."""
        self.commands.append(Command.CANCEL)
        if self.accepted:
            self.commands.append(Command.ASK_RESULT)
        self.deadlines.arm(Event.POLL_DUE, self.asking.ask(self.steady))


Does = Callable[[Facts], State | None]
"""Changes the goal; returns the next state, if it is another one."""


@dataclass(frozen=True, slots=True)
class Step:
    """One decision: what is done, in words too, and which states may follow."""

    does: Does
    to: frozenset[State]
    """Beside the state in which it is made."""
    says: str

    def __call__(self, goal: Facts) -> State:
        """Make it; return the state that follows."""
        return self.does(goal) or goal.state


def leads_to(*to: State) -> Callable[[Does], Step]:
    """Make a function a step, which leads to one of these states or stays where it is.

    docs/goal.md has the first line of the function's docstring.
    """

    def step(does: Does) -> Step:
        says = (does.__doc__ or "").partition("\n")[0]  # python -OO leaves no docstring
        return Step(does, frozenset(to), says.rstrip("."))

    return step


@leads_to()
def drop(goal: Facts) -> None:
    """Drop it: it came too late, or twice, to mean anything."""
