"""One goal on one action server, from wish to end.

The rules of this machine:
- No ROS, no thread, no clock of its own: a method gets an event and its moment, and returns the
  commands (`Command`). The caller carries them out, in order, but may have a cancel wait for its
  turn, and reports the results as events.
- Every pair of state and event is decided in one table (table.py, docs/goal.md), by a step
  (steps/) that changes the facts of the goal (facts.py).
- An outcome is decided once. An end that is UNKNOWN may still become known.
- After the commands that come with DONE nothing is sent.

A leaf is free as soon as `outcome` is set. The goal itself may live on until it is DONE: a caller
(traffic/driver.py) keeps telling it events. attempts.py decides whether to try again, resources.py
which goal holds a resource.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.facts import PATIENCE, Facts
from bt_actions.goals.policy import Busy, End, Outcome
from bt_actions.goals.steps.canceling import NEVER_DONE
from bt_actions.goals.table import TABLE
from bt_actions.goals.terms import (
    CANCEL_UNKNOWN_GOAL,
    FROM_SERVER,
    MAY_TURN_UP,
    SHOWS_ACCEPTANCE,
    Command,
    Event,
    Now,
    State,
)


class Goal(Facts):
    """The life of one goal. Events go in through `on`, commands come out; `due` yields deadlines.

    After construction the caller asks for `resources` and reports GRANTED or TAKEN.
    """

    def __repr__(self) -> str:
        told = "" if self.outcome is None else f" {self.outcome}, end {self.end}"
        return f"<Goal {self.server} {self.id.hex()} {self.state.name}{told}>"

    # The caller's reports

    def turns_up_again(self) -> None:
        """Make a new goal stand for an ended one that a second server runs.

        The goal counts as lost, and is canceled at SERVER_RETURNED.
        """
        self.deadlines.clear()
        self.claims_resources, self.end = False, End.SERVER_GONE
        self.state, self.last_live = State.LOST, State.CANCELING
        self.settle(Outcome.SERVER_AMBIGUOUS, "a second server took it, too, when it had ended")

    def on(self, event: Event, now: Now, detail: Any = None) -> tuple[Command, ...]:
        """Take an event and return the commands, in order.

        Some events come to accepted goals only. For a goal without an acceptance such an event
        shows that the acceptance was lost, or overtaken. For a goal that was lost with its server
        it shows that the server is back.
        """
        # An answer shows no more than the acceptance, which of some LOST goals is known already
        denied = event is Event.CANCEL_ANSWERED and (self.accepted or detail == CANCEL_UNKNOWN_GOAL)
        if event in SHOWS_ACCEPTANCE and self.state in MAY_TURN_UP and not denied:
            return self.on(Event.ACCEPTED, now) + self.on(event, now, detail)
        self.deadlines.follow(now)
        is_over = self.state in (State.LOST, State.DONE)
        if event in FROM_SERVER and self.asking.hear() and not is_over:
            self.deadlines.arm(Event.POLL_DUE, ASK_AGAIN)  # the server can be asked again
        step, previous = TABLE[self.state, event], self.state
        self.detail = detail
        state = step(self)
        assert state is previous or state in step.to, f"{event} took {self!r} to {state}"
        if state is not previous:
            if state is State.DONE:
                self.deadlines.clear()
                self.release()
            if previous is not State.LOST:
                self.last_live = previous
            self.state = state
        commands, self.commands = tuple(self.commands), []
        return commands

    def due(self, now: Now) -> Iterator[Event]:
        """Take each deadline that has passed, the earliest first, to be told to `on` at once."""
        self.deadlines.follow(now)
        for _, event in self.deadlines.left(now):
            if self.deadlines.take_passed(event, now):
                yield event

    # The caller's questions

    def due_in(self, now: Now) -> float | None:
        """Return the seconds until the earliest deadline (0 when one has passed), or None."""
        waits = self.deadlines.left(now)
        return max(0.0, waits[0][0]) if waits else None

    def deadline(self, now: Now) -> tuple[Event, float] | None:
        """Return the deadline that falls due first and the seconds left, or None."""
        for left, event in self.deadlines.left(now):
            if event is not Event.POLL_DUE:
                return event, max(0.0, left)
        return None

    @property
    def lost(self) -> bool:
        """Whether the goal's server went away, or its sender has left."""
        return self.state is State.LOST

    @property
    def late(self) -> bool:
        """Whether the goal succeeded, or was refused, when a deadline had passed."""
        deadline_passed = self.planned not in (None, *NEVER_DONE)
        came = self.end is End.SUCCEEDED or self.outcome is Outcome.REJECTED
        return deadline_passed and came

    @property
    def request_pending(self) -> bool:
        """Whether the request has no answer yet, and `timeout.accept` has not passed."""
        return self.state in (State.SENDING, State.UNWANTED)

    @property
    def in_flight(self) -> bool:
        """Whether the request may lie in its server's queue."""
        may_come = self.state is State.SENDING or self.may_still_be_accepted
        return may_come and self.asking.denied_since == math.inf

    @property
    def outstanding(self) -> bool:
        """Whether a server with this goal must be rid of it before the next goal is sent."""
        unknown = not self.claims_resources and self.end is End.UNKNOWN and self.sent
        return unknown and (self.accepted or not self.asking.in_vain)

    @property
    def exclusive(self) -> frozenset[str]:
        """The resources that no other goal may use beside this one, on whichever server."""
        return self.resources if self.busy in (Busy.WAIT, Busy.FAIL) else frozenset()

    @property
    def drains_within(self) -> float:
        """Seconds from the wish to cancel until the end is known, or will stay unknown for long."""
        cancel = PATIENCE if self.timeouts.cancel is None else self.timeouts.cancel
        if self.accepted:
            return cancel
        return max(cancel + (self.timeouts.accept or 0.0), 2 * self.patience)
