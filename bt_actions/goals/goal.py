"""One goal on one action server, from wish to end.

The rules this file lives by:
- No ROS, no thread, no clock of its own: a method is told what happened and when, and returns
  what to do (`Command`). The caller carries it out, in order, but may have a cancel wait for its
  turn, and tells what came of it.
- Every (state, event) pair is decided in one table, `TABLE`; docs/goal.md is made from it.
- An outcome is decided once. An end that is UNKNOWN may still become known.
- After what comes with DONE nothing is sent.

A leaf is free to go on as soon as `outcome` is set. The goal itself may live on in CANCELING:
somebody (traffic/traffic.py) keeps feeding it events until it is DONE. Whether to try again is not
decided here (attempts.py), nor who may have a resource (resources.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bt_actions.goals.deadlines import Deadlines
from bt_actions.goals.policy import Busy, End, Outcome, Timeouts
from bt_actions.goals.terms import (
    CANCEL_ACCEPTED,
    CANCEL_REJECTED,
    CANCEL_UNKNOWN_GOAL,
    ENDS,
    OUTCOMES,
    STATUS_ABORTED,
    STATUS_CANCELED,
    STATUS_SUCCEEDED,
    Command,
    Event,
    Now,
    State,
)

ASK_AGAIN = 1.0
"""Seconds between two questions to a server that owes an answer."""
ASK_LESS = 10.0
"""The same, after it was asked `OFTEN` times: a server that refuses to cancel keeps each question
for the result until the goal ends, and answers them all."""
UNHEARD = 3
"""The same, after it was asked so often and nothing at all has come of the goal: the requests wait
in the queue of a server that is busy, which holds ten, those of other clients among them."""
OFTEN = 20
ASK_IN_ANY_CASE = 30.0
"""Seconds between two questions to a server that need not have an answer yet: should the result
and the status both be lost, a goal without deadlines would wait for ever."""
RESULT_QUESTIONS = 20
"""So many questions for the result of a goal that has ended, until it counts as lost; on a link
that loses a fifth, the middleware took up to 16 s to repair it."""
DOUBTS = 3
"""So many times a lone server may deny a goal that it had accepted before it is believed."""
DENIED_FOR_GOOD = 30.0
"""Seconds for which a server must have denied a request that it never answered, until the end of
the tree need not wait for it: it has not got it. Should it turn up all the same, it is canceled."""
PATIENCE = 5.0
"""Seconds for an answer that nobody wants any more, where the user gave no deadline."""
_WORDS = frozenset(
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
"""What comes from a server."""
_NEVER_DONE = (Outcome.CANCELED, Outcome.SERVER_AMBIGUOUS)
"""Outcomes that a goal was canceled for and that stand, should it succeed all the same."""


class Goal:
    """The life of one goal. Events go in through `on` and `poll`, commands come out.

    After construction the caller asks for `resources` and reports GRANTED or TAKEN.
    """

    def __init__(
        self,
        goal_id: bytes,
        server: str,
        timeouts: Timeouts,
        now: Now,
        *,
        resources: frozenset[str] = frozenset(),
        busy: Busy = Busy.WAIT,
        settles: Callable[[Any], bool] = lambda result: True,
    ) -> None:
        self.id = goal_id
        self.server = server
        self.timeouts = timeouts
        self.resources = resources or frozenset({server})
        self.busy = busy
        self._settles = (
            settles  # whether a result, None: a lost one, says that nothing it began still runs
        )
        self.state = State.QUEUED
        self.outcome: Outcome | None = None
        self.end = End.NEVER_STARTED
        self.reason = ""
        self.result: Any = None
        self.feedback: Any = None
        self.late = False
        """The result came while the goal was already being canceled for a deadline."""
        self.lost = False
        """Its server went away, or our node did; where both meet again, it is canceled first."""
        self.waited_for = False
        """The end of its tree was held up for it, in vain; nobody waits for it again, unless its
        server comes back."""
        self.dropped = 0
        """Events that came too late, or twice, to mean anything."""
        self._holding = True  # the resources, or a place in the queue for them
        self._sent = False
        self._accepted = False
        self._replaced = False
        self._why: Outcome | None = None  # the outcome that CANCELING will have
        self._suspect = False  # the request went unanswered for timeout.accept
        self._denied_since: float | None = None  # each cancel since then was: unknown goal
        self._denied_at: float | None = None  # the last of these answers
        self._judged = False  # the tree went on because of them
        self._never_came = False  # denied for good
        self._judged_before = False  # and its server was lost since
        self._was_left = False  # LEFT, not SERVER_LOST
        self._doubts = 0
        self._seen_status: int | None = None  # terminal, from the status topic
        self._asked_since = 0  # questions for the result since then, in vain,
        self._first_asked = 0.0  # and when the first of them was asked
        self._cancel_sent = False
        self._cancel_code: int | None = None  # what was answered to a cancel request
        self._asked = 0  # in a row, of a server that has it and does not say that it has ended
        self._unheard = 0  # so often was it asked to cancel since anything was heard of the goal,
        self._asked_at = 0.0  # and when the last time
        self._commands: list[Command] = []
        self._deadlines = Deadlines(now)
        self._deadlines.arm(Event.QUEUE_DUE, timeouts.queue, now)

    def __repr__(self) -> str:
        told = "" if self.outcome is None else f" {self.outcome}, end {self.end}"
        return f"<Goal {self.server} {self.id.hex()} {self.state.value}{told}>"

    # What the caller may ask

    @property
    def sent(self) -> bool:
        """Whether a request went out, so that answers may come."""
        return self._sent

    @property
    def accepted(self) -> bool:
        """Whether the server is known to have accepted the goal."""
        return self._accepted

    @property
    def holding(self) -> bool:
        """Whether the goal holds its resources, or waits for them."""
        return self._holding

    @property
    def live(self) -> bool:
        """Whether the goal may be running on its server, as far as anybody knows."""
        return self._sent and self.state is not State.DONE and self.end is End.UNKNOWN

    @property
    def suspect(self) -> bool:
        """Whether the request is still unanswered, though nobody wants it any more.

        The server may still be deciding, also where it denies the goal by now: the tree goes on,
        but must not end without asking again.
        """
        open_question = self._sent and not self._accepted and not self.lost
        return self.state is State.CANCELING and open_question and not self._never_came

    @property
    def unanswered(self) -> bool:
        """Whether its request has no answer yet, and `timeout.accept` has not passed."""
        return self.state is State.SENDING or (self.suspect and not self._suspect)

    @property
    def in_flight(self) -> bool:
        """Whether its request may lie in its server's queue."""
        unanswered = self.suspect and self._denied_since is None
        return self.state is State.SENDING or unanswered

    @property
    def outstanding(self) -> bool:
        """Whether a server that has it must be rid of it before it gets another goal."""
        unknown = self._sent and self.end is End.UNKNOWN and not self._holding
        return unknown and (self._accepted or not self.waited_for)

    def blocks(self, other: Goal, *, same_server: bool) -> bool:
        """Whether this goal, given up as it is, must be accounted for before `other` is sent."""
        shares = other.busy in (Busy.WAIT, Busy.FAIL) and bool(self.resources & other.resources)
        return self.outstanding and (same_server or shares)

    @property
    def drains_within(self) -> float:
        """Seconds from the wish to cancel until the end is known, or will not be for long."""
        cancel = PATIENCE if self.timeouts.cancel is None else self.timeouts.cancel
        if self._accepted:
            return cancel
        return max(cancel + (self.timeouts.accept or 0.0), 2 * self._patience)

    def due_in(self, now: Now) -> float | None:
        """Return the seconds until the earliest deadline (0 when it has passed), or None."""
        waits = self._deadlines.left(now)
        return max(0.0, waits[0][0]) if waits else None

    def deadline(self, now: Now) -> tuple[Event, float] | None:
        """Return the deadline that falls due first and the seconds left, or None."""
        for left, event in self._deadlines.left(now):
            if event is not Event.POLL_DUE:
                return event, max(0.0, left)
        return None

    def duplicate(self, now: Now) -> Goal:
        """Return the same goal, which has ended here, as a second server runs it.

        It counts as lost, and is canceled at SERVER_RETURNED.
        """
        duplicate = Goal(
            self.id, self.server, self.timeouts, now, resources=self.resources, busy=self.busy
        )
        duplicate._deadlines.clear()
        duplicate._holding, duplicate._sent, duplicate._accepted, duplicate.lost = (
            False,
            True,
            True,
            True,
        )
        duplicate.state, duplicate.end = State.CANCELING, End.SERVER_GONE
        duplicate._settle(
            Outcome.SERVER_AMBIGUOUS, "a second server took it, too, when it had ended"
        )
        return duplicate

    # What the caller may tell

    def on(self, event: Event, now: Now, detail: Any = None) -> tuple[Command, ...]:
        """Take what happened and return what to do, in order.

        Raises ValueError when `now` is not a moment at all (a bug of the caller).
        """
        if now.steady != now.steady or now.ros != now.ros:
            raise ValueError(f"not a moment: {now}")
        self._deadlines.follow(now)
        if event in _WORDS:
            self._is_heard_of(now)
        row = TABLE[self.state, event]
        state = row.step(self, now, detail)
        assert state in row.to, f"{event} took {self!r} to {state}"
        if state is State.DONE and self.state is not State.DONE:
            self._deadlines.clear()
            self._release()
        self.state = state
        commands, self._commands = tuple(self._commands), []
        self._cancel_sent |= Command.CANCEL in commands
        return commands

    def _is_heard_of(self, now: Now) -> None:
        """Whoever may have it speaks, and so can be asked again."""
        if self._unheard > UNHEARD and self.state is not State.DONE:
            self._deadlines.arm(Event.POLL_DUE, ASK_AGAIN, now)
        self._unheard = 0

    def poll(self, now: Now) -> tuple[Command, ...]:
        """Let every deadline that has passed take effect, the earliest first."""
        self._deadlines.follow(now)
        commands: tuple[Command, ...] = ()
        for _, event in self._deadlines.left(now):
            if self._deadlines.take_passed(event, now):
                commands += self.on(event, now)
        return commands

    def postpone(self, seconds: float) -> None:
        """Give a goal that was not sent yet so much more time: the tree was paused."""
        if self.state in (State.QUEUED, State.WAITING_FOR_SERVER):
            self._deadlines.postpone(seconds)

    def hold(self, seconds: float, now: Now) -> None:
        """Let no deadline take effect for so many seconds: what is awaited may be on its way."""
        self._deadlines.hold(seconds, now)

    # Steps of the table: each decides, acts on the goal, and returns the next state

    def _stay(self, now: Now, detail: Any) -> State:
        """Nothing."""
        return self.state

    def _drop(self, now: Now, detail: Any) -> State:
        """Count it."""
        self.dropped += 1
        return self.state

    def _give_up_unsent(self, outcome: Outcome, reason: str) -> State:
        self._settle(outcome, reason)
        return State.DONE

    def _granted(self, now: Now, detail: Any) -> State:
        """Hold the resources, and wait for the server."""
        self._deadlines.disarm(Event.QUEUE_DUE)
        self._deadlines.arm(Event.SERVER_DUE, self.timeouts.server, now)
        return State.WAITING_FOR_SERVER

    def _taken(self, now: Now, detail: Any) -> State:
        """Give up: SERVER_BUSY."""
        names = ", ".join(sorted(self.resources))
        return self._give_up_unsent(Outcome.SERVER_BUSY, f"{names} is in use by another goal")

    def _queue_due(self, now: Now, detail: Any) -> State:
        """Give up: SERVER_BUSY."""
        names = ", ".join(sorted(self.resources))
        why = f"{names} was not free within {self.timeouts.queue:g} s"
        return self._give_up_unsent(Outcome.SERVER_BUSY, why)

    def _server_due(self, now: Now, detail: Any) -> State:
        """Give up: SERVER_UNAVAILABLE."""
        why = f"no action server {self.server} within {self.timeouts.server:g} s"
        return self._give_up_unsent(Outcome.SERVER_UNAVAILABLE, why)

    def _ambiguous(self, now: Now, detail: Any) -> State:
        """Give up: SERVER_AMBIGUOUS."""
        why = f"two action servers answer to {self.server}: a goal would be executed twice"
        return self._give_up_unsent(Outcome.SERVER_AMBIGUOUS, why)

    def _taken_by_two(self, now: Now, detail: Any) -> State:
        """Cancel, at both: SERVER_AMBIGUOUS."""
        why = f"two action servers answer to {self.server}, and both may have it"
        outcome = Outcome.CANCELED if self._replaced else Outcome.SERVER_AMBIGUOUS
        return self._cancel(now, outcome, why)

    def _taken_by_two_unanswered(self, now: Now, detail: Any) -> State:
        """Cancel, at whoever has it: SERVER_AMBIGUOUS."""
        self._interrupted_unanswered(now, detail)
        why = f"two action servers answer to {self.server}, and both may have it"
        self._plan(Outcome.SERVER_AMBIGUOUS, why)
        self._ask(now)
        return State.CANCELING

    def _taken_by_two_while_canceling(self, now: Now, detail: Any) -> State:
        """Cancel, at both; it must not count as done, or be tried again."""
        if self.outcome is None and self._why not in _NEVER_DONE:
            self._plan(Outcome.SERVER_AMBIGUOUS, f"both of two servers may have it ({self.reason})")
        if not self.lost:
            self._ask(now)
        return State.CANCELING

    def _invalid(self, now: Now, detail: Any) -> State:
        """Give up: INVALID_GOAL."""
        return self._give_up_unsent(Outcome.INVALID_GOAL, str(detail))

    def _withdraw(self, now: Now, detail: Any) -> State:
        """Give up: CANCELED; nothing was sent."""
        return self._give_up_unsent(Outcome.CANCELED, "interrupted before the goal was sent")

    def _send(self, now: Now, detail: Any) -> State:
        """Send it; until the server says how it ended, its end is UNKNOWN."""
        self._deadlines.disarm(Event.SERVER_DUE)
        self._deadlines.hold(0.0, now)  # it was for a server that is out of sight
        self._deadlines.arm(Event.ACCEPT_DUE, self.timeouts.accept, now)
        self._sent = True
        self.end = End.UNKNOWN
        self._commands.append(Command.SEND)
        return State.SENDING

    def _send_failed(self, now: Now, detail: Any) -> State:
        """Give up: SERVER_UNAVAILABLE; nothing was started."""
        self._sent = False
        self.end = End.NEVER_STARTED
        why = f"the goal request could not be sent: {detail}"
        return self._give_up_unsent(self._why or Outcome.SERVER_UNAVAILABLE, why)

    def _begin(self, now: Now, detail: Any) -> State:
        """Ask for the result; timeout.result and timeout.feedback begin."""
        self._accepted = True
        self._deadlines.disarm(Event.ACCEPT_DUE)
        self._deadlines.arm(Event.RESULT_DUE, self.timeouts.result, now)
        self._deadlines.arm(Event.FEEDBACK_DUE, self.timeouts.feedback, now)
        self._deadlines.arm(Event.POLL_DUE, ASK_IN_ANY_CASE, now)
        self._commands.append(Command.ASK_RESULT)
        return State.EXECUTING

    def _begin_by_status(self, now: Now, detail: Any) -> State:
        """The acceptance was overtaken, or lost: only an accepted goal has a status."""
        self._begin(now, None)
        self._terminal_status_seen(now, detail)
        return State.EXECUTING

    def _begin_by_feedback(self, now: Now, detail: Any) -> State:
        """The acceptance was overtaken by feedback, or lost: only an accepted goal has any."""
        self.feedback = detail
        return self._begin(now, None)

    def _rejected(self, now: Now, detail: Any) -> State:
        """Nothing was started: REJECTED, or what it was canceled for."""
        if self._accepted:
            return self._drop(now, detail)
        self.end = End.NEVER_STARTED
        if self._why is Outcome.ACCEPT_TIMEOUT:
            self.late = True
        else:
            self._settle_as_planned()
        self._settle(Outcome.REJECTED, f"{self.server} refused the goal")
        return State.DONE

    def _accept_due(self, now: Now, detail: Any) -> State:
        """It becomes a suspect: a cancel both asks for it and stops it."""
        why = f"no answer to the goal request within {self.timeouts.accept:g} s"
        self._plan(Outcome.ACCEPT_TIMEOUT, why)
        return self._suspicion(now, detail)

    def _suspicion(self, now: Now, detail: Any) -> State:
        """Ask by canceling; the second time: NEVER_STARTED if the server denies the goal."""
        if self._accepted:
            return self.state
        if self._suspect:
            return self._verdict(now)
        self._suspect = True
        self._deadlines.arm(Event.ACCEPT_DUE, self._patience, now)
        self._ask(now)
        return State.CANCELING

    def _verdict(self, now: Now) -> State:
        """A second timeout.accept has passed. Does the server answer, and deny the goal?"""
        self._settle_as_planned()
        if self._denied_lately(now):
            self.end = End.NEVER_STARTED  # should it turn up after all, it is canceled
            self._deadlines.clear()
            self._release()
            self._judged = True
            self._ask_once_more(now)
        else:
            self._deadlines.arm(Event.ACCEPT_DUE, self._patience, now)
        return State.CANCELING

    def _denied_lately(self, now: Now) -> bool:
        if self._denied_since is None or self._denied_at is None:
            return False
        return now.steady - self._denied_at <= 2 * ASK_AGAIN

    def _turned_up(self, now: Now, detail: Any) -> State:
        """Accepted after nobody wanted it any more: canceled at once, however late."""
        if self._accepted:
            return self._drop(now, detail)
        self._accepted = True
        self.end = End.UNKNOWN
        self._denied_since, self._judged, self._never_came = None, False, False
        self.lost = False
        self._deadlines.disarm(Event.ACCEPT_DUE)
        if self.outcome is None:
            self._deadlines.arm(Event.CANCEL_DUE, self.timeouts.cancel, now)
        self._ask(now)
        return State.CANCELING

    def _feedback(self, now: Now, detail: Any) -> State:
        """The silence is over; timeout.feedback begins anew."""
        self.feedback = detail
        self._doubts = 0
        self._runs_after_all()
        if not self._replaced and self._seen_status is None:
            self._deadlines.arm(Event.FEEDBACK_DUE, self.timeouts.feedback, now)
        return State.EXECUTING

    def _feedback_while_canceling(self, now: Now, detail: Any) -> State:
        """Only a goal that runs has feedback: if that is news, cancel it at once."""
        if not self._accepted:
            return self._turned_up(now, detail)
        self._runs_after_all()
        return self._server_returned(now, detail) if self.lost else State.CANCELING

    def _runs_after_all(self) -> None:
        """Feedback long after a terminal status shows that the status was somebody else's word."""
        if self._asked_since > 0:
            self._seen_status, self._asked_since = None, 0

    def _terminal_status_seen(self, now: Now, detail: Any) -> State:
        """The result is due; if its message was lost, it has to be asked for again."""
        if detail not in ENDS:
            self._doubts = 0  # whatever it was asked for, and denied: it has the goal
            self._seen_status, self._asked_since = None, 0
        elif self._seen_status is None:
            self._seen_status = detail
            self._deadlines.disarm(Event.FEEDBACK_DUE)  # it is silent because it has ended
            self._deadlines.arm(Event.POLL_DUE, ASK_AGAIN, now)
        return self.state

    def _terminal_status_canceling(self, now: Now, detail: Any) -> State:
        """Only an accepted goal has a status: if that is news, cancel it at once."""
        if not self._accepted:
            self._turned_up(now, detail)
        elif self.lost and detail not in ENDS:
            self._server_returned(now, detail)
        return self._terminal_status_seen(now, detail)

    def _ask_for_lost_result(self, now: Now, detail: Any) -> State:
        """Ask again; after several questions believe the status, or go on asking."""
        if self._result_seems_lost(now, RESULT_QUESTIONS):
            self._settle_as_planned()
            self._settle(Outcome.SERVER_LOST, f"{self.server} finished, but gave no result")
            return self._finished_by_status()
        self._commands.append(Command.ASK_RESULT)
        again = ASK_IN_ANY_CASE if self._seen_status is None else ASK_AGAIN
        self._deadlines.arm(Event.POLL_DUE, again, now)
        return State.EXECUTING

    def _finished(self, now: Now, detail: Any) -> State:
        """SUCCEEDED, ABORTED or CANCELED_BY_OTHER; CANCELED if it was replaced."""
        status, self.result = detail
        self.end = ENDS[status] if self._settles(self.result) else End.UNKNOWN
        if self._replaced:
            self._settle(Outcome.CANCELED, f"replaced by a newer goal; it ended as {self.end}")
        else:
            told = {
                STATUS_CANCELED: "canceled, and not by this process",
                STATUS_ABORTED: f"aborted by {self.server}",
            }
            self._settle(OUTCOMES[status], told.get(status, ""))
        return State.DONE

    def _finished_while_canceling(self, now: Now, detail: Any) -> State:
        """What it was canceled for; SUCCEEDED, late, if only a deadline had passed."""
        status, self.result = detail
        self.end = ENDS[status] if self._settles(self.result) else End.UNKNOWN
        if status == STATUS_SUCCEEDED and self._why not in _NEVER_DONE:
            self.late = True
            self._settle(Outcome.SUCCEEDED, f"late: {self.reason}")
        if self.outcome is None and self._cancel_code == CANCEL_REJECTED:
            self.reason += self.cancel_said
        self._settle_as_planned()
        return State.DONE

    def _denied_while_executing(self, now: Now, detail: Any) -> State:
        """Ask again; believed the third time: SERVER_LOST."""
        self._doubts += 1
        if self._doubts < DOUBTS:
            self._deadlines.arm(Event.POLL_DUE, ASK_AGAIN, now)
            return State.EXECUTING
        return self._forgotten()

    def _denied_while_canceling(self, now: Now, detail: Any) -> State:
        """Believed the third time: what it was canceled for."""
        self._doubts += 1
        if self._doubts < DOUBTS or not self._accepted:
            return State.CANCELING
        return self._forgotten()

    def _forgotten(self) -> State:
        if self._seen_status is None:
            self._commands.append(Command.CANCEL)  # should it run all the same
        self._settle_as_planned()
        why = f"{self.server} no longer knows the goal it accepted"
        if self._seen_status is not None:
            end = ENDS[self._seen_status]
            why = (
                f"it ended as {end}, but {self.server} knew its result no longer when asked for it"
            )
        self._settle(Outcome.SERVER_LOST, why)
        return self._finished_by_status()

    def _cancel_answered(self, now: Now, detail: Any) -> State:
        """Take note of a denial; if the goal is known after all, cancel it at once."""
        if self._cancel_code != CANCEL_ACCEPTED:  # after that, rcl calls it TERMINATED
            self._cancel_code = detail
        if detail != CANCEL_UNKNOWN_GOAL:
            self._denied_since = None
        else:
            self._denied_at = now.steady
            if self._denied_since is None:
                self._denied_since = now.steady
            if self.suspect and self._judged:
                self._ask_once_more(now)
            elif self.suspect and self._judged_before:
                self._verdict(now)  # once more; the time to be late in is over
        if detail != CANCEL_UNKNOWN_GOAL and not self._accepted:
            return self._turned_up(now, detail)  # known to the server: it had been accepted
        return State.CANCELING

    def _ask_once_more(self, now: Now) -> None:
        """Ask when it has been denied for long enough, or believe it if it has."""
        assert self._denied_since is not None
        left = self._denied_since + DENIED_FOR_GOOD - now.steady
        if left > 0.0:
            self._deadlines.arm(Event.POLL_DUE, left, now)
        else:
            self._never_came, self.end = True, End.NEVER_STARTED
            self._deadlines.disarm(Event.POLL_DUE)

    def _ask_again(self, now: Now, detail: Any) -> State:
        """Ask again, cancel and result; after several questions believe the status."""
        if self._result_seems_lost(now, DOUBTS):
            return self._finished_by_status()
        self._ask(now)
        return State.CANCELING

    def _result_seems_lost(self, now: Now, questions: int) -> bool:
        """The status topic showed the end; has the result been asked for often enough since?"""
        if self._seen_status is None:
            return False
        if self._asked_since == 0:
            self._first_asked = now.steady
        self._asked_since += 1
        return self._asked_since > questions

    def _finished_by_status(self) -> State:
        if self._seen_status is not None:
            self.end = ended = ENDS[self._seen_status]
            if ended is End.ABORTED and not self._settles(None):
                self.end = End.UNKNOWN  # only its result could have told what goes on below it
            if self.outcome is None:
                self.reason += f"; it ended as {ended}, and its result was lost"
        self._settle_as_planned()
        return State.DONE

    def _ask_changed_server(self, now: Now, detail: Any) -> State:
        """Ask for the result; what is to be canceled, is asked to cancel again, too."""
        open_end = self.end is End.UNKNOWN or self.suspect
        if self.state is State.CANCELING and not self.lost and open_end:
            self._commands.append(Command.CANCEL)
        if self._accepted:
            self._commands.append(Command.ASK_RESULT)
        return self.state

    def _lose(self, now: Now, detail: Any) -> State:
        """Free the leaf: SERVER_LOST; keep the goal in mind, in case the server is not dead."""
        self._settle_as_planned()
        self._settle(Outcome.SERVER_LOST, str(detail))
        if self._seen_status is not None:
            return self._finished_by_status()
        self.lost, self._was_left, self._unheard = True, False, 0
        if not self._never_came:  # else it was denied for good; for less, it may have come
            self.end = End.SERVER_GONE
        self._deadlines.clear()
        self._release()
        return State.CANCELING

    def _server_returned(self, now: Now, detail: Any) -> State:
        """Cancel what it may still run."""
        if not self.lost:
            return self._drop(now, detail)
        self.lost = False
        if not (self._was_left and self._denied_lately(now)):
            self._denied_since = None
        self._asked, self._cancel_code = 0, None
        if self._never_came:  # nor will it; to ask does no harm
            self._commands.append(Command.CANCEL)
            return State.CANCELING
        if self.end is End.NEVER_STARTED:  # and this is the question whether that still holds
            self._ask(now)
            return State.CANCELING
        self.end = End.UNKNOWN
        self.waited_for = False  # there is somebody again who can tell
        if not self._accepted:
            self._judged_before |= self._judged
            self._suspect, self._judged = True, False
            self._deadlines.arm(Event.ACCEPT_DUE, self._patience, now)
        self._ask(now)
        return State.CANCELING

    def _replaced_while_executing(self, now: Now, detail: Any) -> State:
        """Give it timeout.cancel to be preempted; where another server has the newer, cancel."""
        if detail is not None and detail != self.server:
            self._replaced = True
            return self._cancel(now, Outcome.CANCELED, f"replaced by a newer goal on {detail}")
        if self._replaced:
            return State.EXECUTING  # by a newer one still, which gives it no more time
        self._replaced = True
        self._plan(Outcome.CANCELED, "replaced by a newer goal")
        self._deadlines.disarm(Event.RESULT_DUE)
        self._deadlines.disarm(Event.FEEDBACK_DUE)
        self._deadlines.arm(Event.CANCEL_DUE, self.timeouts.cancel or PATIENCE, now)
        return State.EXECUTING

    def _replaced_unsent(self, now: Now, detail: Any) -> State:
        """Give up: CANCELED."""
        return self._give_up_unsent(Outcome.CANCELED, "replaced by a newer goal before it was sent")

    def _replaced_unanswered(self, now: Now, detail: Any) -> State:
        """Replaced before acceptance: it is canceled as soon as it is accepted."""
        self._interrupted_unanswered(now, detail)
        self._plan(Outcome.CANCELED, "replaced by a newer goal before it was accepted")
        return State.CANCELING

    def _replaced_while_canceling(self, now: Now, detail: Any) -> State:
        """Whatever it was canceled for, it must not be tried again beside the newer one."""
        if self.outcome is None and self._why is not Outcome.CANCELED:
            self._plan(Outcome.CANCELED, f"replaced by a newer goal ({self.reason})")
        return State.CANCELING

    def _replaced_too_long(self, now: Now, detail: Any) -> State:
        """Cancel: it was replaced, and did not end."""
        return self._cancel(now, Outcome.CANCELED, "replaced by a newer goal, and did not end")

    def _interrupted(self, now: Now, detail: Any) -> State:
        """Cancel: CANCELED."""
        return self._cancel(now, Outcome.CANCELED, "interrupted by the tree")

    def _result_due(self, now: Now, detail: Any) -> State:
        """Cancel: RESULT_TIMEOUT."""
        why = f"not finished within {self.timeouts.result:g} s"
        return self._cancel(now, Outcome.RESULT_TIMEOUT, why)

    def _feedback_due(self, now: Now, detail: Any) -> State:
        """Cancel: STALLED."""
        why = f"no feedback for {self.timeouts.feedback:g} s"
        return self._cancel(now, Outcome.STALLED, why)

    def _cancel(self, now: Now, outcome: Outcome, reason: str) -> State:
        self._plan(outcome, reason)
        self._deadlines.disarm(Event.RESULT_DUE)
        self._deadlines.disarm(Event.FEEDBACK_DUE)
        self._deadlines.disarm(Event.CANCEL_DUE)  # that of a replacement, which may be all there is
        self._deadlines.arm(Event.CANCEL_DUE, self.timeouts.cancel, now)
        self._ask(now)
        return State.CANCELING

    def _interrupted_unanswered(self, now: Now, detail: Any) -> State:
        """Interrupted before acceptance: it is canceled as soon as it is accepted."""
        self._plan(Outcome.CANCELED, "interrupted by the tree before the goal was accepted")
        if self.timeouts.accept is None:
            self._deadlines.arm(Event.ACCEPT_DUE, self._patience, now)
        return State.CANCELING

    def _interrupted_while_canceling(self, now: Now, detail: Any) -> State:
        """Whatever it was canceled for, its outcome will be CANCELED."""
        is_news = self.outcome is not None or self._why is not Outcome.CANCELED
        long_ago = self._unheard > UNHEARD and now.steady - self._asked_at >= ASK_AGAIN
        if is_news and long_ago and not self.lost:
            self._ask(now)  # now somebody waits for it
        if self.outcome is None and self._why is not Outcome.CANCELED:
            self._plan(Outcome.CANCELED, f"interrupted by the tree ({self.reason})")
        return State.CANCELING

    def _cancel_due(self, now: Now, detail: Any) -> State:
        """The leaf has waited long enough; the questions go on, unless the status shows the end."""
        if self._seen_status is None:
            self._settle_as_planned()
            self._ask(now)
            return State.CANCELING
        if self._asked_since == 0:
            self._ask_again(now, detail)
        left = self._first_asked + ASK_AGAIN - now.steady
        if left <= 0.0:
            return self._finished_by_status()
        self._deadlines.arm(Event.CANCEL_DUE, left, now)  # the result itself tells more
        return State.CANCELING

    def _drained(self, now: Now, detail: Any) -> State:
        """Nobody waits any longer; what is not known by now is UNKNOWN, and may become known."""
        self.waited_for = True
        if self._asked_since > 0:
            return self._finished_by_status()
        self._settle_as_planned()
        if self.suspect:
            self.end = End.UNKNOWN  # canceled if it turns up all the same
        return State.CANCELING

    def _left(self, now: Now, detail: Any) -> State:
        """Keep it in mind as if its server were lost; what is not known stays UNKNOWN."""
        if self.lost:
            return self.state
        self._settle_as_planned()
        self._settle(Outcome.CANCELED, "its node was closed")
        if self._seen_status is not None:
            return self._finished_by_status()
        if self.suspect:
            self.end = End.UNKNOWN
        self.lost, self._was_left, self._unheard = True, True, 0
        self._deadlines.clear()
        self._release()
        return State.CANCELING

    def _close_unsent(self, now: Now, detail: Any) -> State:
        """Give up: CANCELED."""
        return self._give_up_unsent(Outcome.CANCELED, "the process ended")

    def _close(self, now: Now, detail: Any) -> State:
        """CANCELED; what is not known by now stays UNKNOWN."""
        self._settle_as_planned()
        self._settle(Outcome.CANCELED, "the process ended")
        if self.suspect:
            self.end = End.UNKNOWN
        return self._finished_by_status()

    @property
    def cancel_said(self) -> str:
        """What its server has said of the request to cancel it, to follow a reason; or ""."""
        gone = self.lost and self.end is not End.UNKNOWN  # else its node is, and this still holds
        if self.state is not State.CANCELING or gone or not self._cancel_sent:
            return ""
        words = {
            None: "has not answered the request to cancel it",
            CANCEL_ACCEPTED: "has agreed to cancel it, and it has not ended",
            CANCEL_REJECTED: "refuses to cancel it",
        }
        said = words.get(self._cancel_code)
        return f"; {self.server} {said}" if said else ""

    # Small tools of the steps

    @property
    def _patience(self) -> float:
        return self.timeouts.accept or self.timeouts.cancel or PATIENCE

    def _plan(self, outcome: Outcome, reason: str) -> None:
        self._why, self.reason = outcome, reason

    def _settle_as_planned(self) -> None:
        if self._why is not None:
            self._settle(self._why, self.reason)

    def _settle(self, outcome: Outcome, reason: str) -> None:
        if self.outcome is None:
            self.outcome, self.reason = outcome, reason

    def _release(self) -> None:
        if self._holding:
            self._holding = False
            self._commands.append(Command.RELEASE)

    def _ask(self, now: Now) -> None:
        """Ask to cancel and, where there will be one, for the result; again in a while."""
        self._commands.append(Command.CANCEL)
        self._unheard, self._asked_at = self._unheard + 1, now.steady
        again = ASK_AGAIN
        if self._unheard > UNHEARD:  # of a suspect it is to be known when timeout.accept passes
            again = ASK_LESS if self._accepted else min(ASK_LESS, max(again, self._patience))
        if self._accepted:
            self._commands.append(Command.ASK_RESULT)
            self._asked += 1
            if self._asked > OFTEN and self._seen_status is None:
                again = ASK_LESS
        self._deadlines.arm(Event.POLL_DUE, again, now)


@dataclass(frozen=True, slots=True)
class Row:
    """One decision of the table: what is done, and which states may follow."""

    step: Callable[[Goal, Now, Any], State]
    to: frozenset[State]

    @property
    def says(self) -> str:
        """The step in words, for docs/goal.md."""
        return (self.step.__doc__ or self.step.__name__).splitlines()[0].rstrip(".")

    @property
    def drops(self) -> bool:
        """Whether the event means nothing in this state."""
        return self.step is Goal._drop


def _table() -> dict[tuple[State, Event], Row]:
    queued, waiting, sending = State.QUEUED, State.WAITING_FOR_SERVER, State.SENDING
    executing, canceling, done = State.EXECUTING, State.CANCELING, State.DONE
    decided: dict[tuple[State, Event], tuple[Callable[[Goal, Now, Any], State], set[State]]] = {
        (queued, Event.GRANTED): (Goal._granted, {waiting}),
        (queued, Event.TAKEN): (Goal._taken, {done}),
        (queued, Event.QUEUE_DUE): (Goal._queue_due, {done}),
        (waiting, Event.SERVER_READY): (Goal._send, {sending}),
        (waiting, Event.SERVER_AMBIGUOUS): (Goal._ambiguous, {done}),
        (waiting, Event.SERVER_DUE): (Goal._server_due, {done}),
        (waiting, Event.REPLACED): (Goal._replaced_unsent, {done}),
        (sending, Event.SEND_FAILED): (Goal._send_failed, {done}),
        (sending, Event.ACCEPTED): (Goal._begin, {executing}),
        (sending, Event.REJECTED): (Goal._rejected, {done}),
        (sending, Event.FEEDBACK): (Goal._begin_by_feedback, {executing}),
        (sending, Event.STATUS): (Goal._begin_by_status, {executing}),
        (sending, Event.ACCEPT_DUE): (Goal._accept_due, {canceling}),
        (sending, Event.SERVER_AMBIGUOUS): (Goal._taken_by_two_unanswered, {canceling}),
        (sending, Event.INTERRUPTED): (Goal._interrupted_unanswered, {canceling}),
        (sending, Event.REPLACED): (Goal._replaced_unanswered, {canceling}),
        (executing, Event.FEEDBACK): (Goal._feedback, {executing}),
        (executing, Event.STATUS): (Goal._terminal_status_seen, {executing}),
        (executing, Event.POLL_DUE): (Goal._ask_for_lost_result, {executing, done}),
        (executing, Event.RESULT): (Goal._finished, {done}),
        (executing, Event.RESULT_UNKNOWN): (Goal._denied_while_executing, {executing, done}),
        (executing, Event.RESULT_DUE): (Goal._result_due, {canceling}),
        (executing, Event.FEEDBACK_DUE): (Goal._feedback_due, {canceling}),
        (executing, Event.INTERRUPTED): (Goal._interrupted, {canceling}),
        (executing, Event.SERVER_AMBIGUOUS): (Goal._taken_by_two, {canceling}),
        (executing, Event.REPLACED): (Goal._replaced_while_executing, {executing, canceling}),
        (executing, Event.CANCEL_DUE): (Goal._replaced_too_long, {canceling}),
        (canceling, Event.SEND_FAILED): (Goal._send_failed, {done}),
        (canceling, Event.ACCEPTED): (Goal._turned_up, {canceling}),
        (canceling, Event.REJECTED): (Goal._rejected, {canceling, done}),
        (canceling, Event.FEEDBACK): (Goal._feedback_while_canceling, {canceling}),
        (canceling, Event.STATUS): (Goal._terminal_status_canceling, {canceling}),
        (canceling, Event.RESULT): (Goal._finished_while_canceling, {done}),
        (canceling, Event.RESULT_UNKNOWN): (Goal._denied_while_canceling, {canceling, done}),
        (canceling, Event.CANCEL_ANSWERED): (Goal._cancel_answered, {canceling}),
        (canceling, Event.ACCEPT_DUE): (Goal._suspicion, {canceling}),
        (canceling, Event.CANCEL_DUE): (Goal._cancel_due, {canceling, done}),
        (canceling, Event.POLL_DUE): (Goal._ask_again, {canceling, done}),
        (canceling, Event.DRAINED): (Goal._drained, {canceling, done}),
        (canceling, Event.INTERRUPTED): (Goal._interrupted_while_canceling, {canceling}),
        (canceling, Event.SERVER_AMBIGUOUS): (Goal._taken_by_two_while_canceling, {canceling}),
        (canceling, Event.REPLACED): (Goal._replaced_while_canceling, {canceling}),
        (canceling, Event.SERVER_RETURNED): (Goal._server_returned, {canceling}),
        (done, Event.INTERRUPTED): (Goal._stay, {done}),
        (done, Event.REPLACED): (Goal._stay, {done}),
        (done, Event.DRAINED): (Goal._stay, {done}),
        (done, Event.PROCESS_EXITING): (Goal._stay, {done}),
    }
    for state in (queued, waiting):
        decided[state, Event.INVALID] = (Goal._invalid, {done})
        decided[state, Event.INTERRUPTED] = (Goal._withdraw, {done})
        decided[state, Event.PROCESS_EXITING] = (Goal._close_unsent, {done})
    decided[sending, Event.SERVER_LOST] = (Goal._lose, {canceling})
    for state in (executing, canceling):
        decided[state, Event.SERVER_CHANGED] = (Goal._ask_changed_server, {state})
        decided[state, Event.SERVER_LOST] = (Goal._lose, {canceling, done})
    for state in (sending, executing, canceling):
        decided[state, Event.NODE_CLOSED] = (Goal._left, {canceling, done})
        decided[state, Event.PROCESS_EXITING] = (Goal._close, {done})
    table = {}
    for state in State:
        for event in Event:
            step, to = decided.get((state, event), (Goal._drop, {state}))
            table[state, event] = Row(step, frozenset(to))
    return table


TABLE: dict[tuple[State, Event], Row] = _table()
"""Every pair is decided; what has no row of its own came too late, or twice, and is dropped."""
