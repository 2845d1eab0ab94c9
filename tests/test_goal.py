"""The life of one goal, rule by rule (DESIGN.md). Every interleaving is tried in machine/."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import bt_actions.goals
from bt_actions.goals.asking import (
    ASK_AGAIN,
    ASK_IN_ANY_CASE,
    ASK_LESS,
    DENIED_FOR_GOOD,
    DOUBTS,
    LOOKED_OUT_FOR,
    RESULT_QUESTIONS,
    UNHEARD,
)
from bt_actions.goals.facts import PATIENCE, drop
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Busy, End, Outcome, Timeouts
from bt_actions.goals.table import TABLE
from bt_actions.goals.terms import (
    CANCEL_ACCEPTED,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN_GOAL,
    STATUS_ABORTED,
    STATUS_CANCELED,
    STATUS_EXECUTING,
    STATUS_SUCCEEDED,
    Command,
    Event,
    Now,
    State,
)

LIMITS = Timeouts(queue=10.0, server=5.0, accept=3.0, result=30.0, feedback=2.0, cancel=4.0)
SEND, ASK, CANCEL, RELEASE = Command.SEND, Command.ASK_RESULT, Command.CANCEL, Command.RELEASE
SUCCEEDED = (STATUS_SUCCEEDED, "the result")
ABORTED = (STATUS_ABORTED, "the result")
CANCELED = (STATUS_CANCELED, "the result")


class Life:
    """A goal and a clock; `sent` is all it has commanded."""

    def __init__(self, timeouts: Timeouts = LIMITS, **kwargs: Any) -> None:
        self.now = Now(100.0, 1000.0)
        self.goal = Goal(b"\x2a" * 16, "/move", timeouts, self.now, **kwargs)
        self.sent: list[Command] = []

    def on(self, event: Event, detail: Any = None) -> list[Command]:
        commands = list(self.goal.on(event, self.now, detail))
        self.sent += commands
        return commands

    def pass_time(self, seconds: float, ros: float | None = None) -> list[Command]:
        """Let time pass (on the node's clock `ros` seconds, the same by default) and poll."""
        ros = seconds if ros is None else ros
        self.now = Now(self.now.steady + seconds, self.now.ros + ros)
        commands = [each for due in self.goal.due(self.now) for each in self.goal.on(due, self.now)]
        self.sent += commands
        return commands

    @property
    def due_in(self) -> float | None:
        return self.goal.due_in(self.now)

    def ended(self, outcome: Outcome, end: End) -> None:
        assert (self.goal.state, self.goal.outcome, self.goal.end) == (State.DONE, outcome, end)
        assert self.sent.count(RELEASE) == 1
        assert self.due_in is None

    def is_free(self, outcome: Outcome, end: End) -> None:
        """The leaf may go on, though the goal is not DONE."""
        goal = self.goal
        assert (goal.outcome, goal.end) == (outcome, end)
        assert goal.state is not State.DONE


def waiting(timeouts: Timeouts = LIMITS, **kwargs: Any) -> Life:
    life = Life(timeouts, **kwargs)
    life.on(Event.GRANTED)
    return life


def sending(timeouts: Timeouts = LIMITS, **kwargs: Any) -> Life:
    life = waiting(timeouts, **kwargs)
    assert life.on(Event.SERVER_READY) == [SEND]
    return life


def executing(timeouts: Timeouts = LIMITS, **kwargs: Any) -> Life:
    life = sending(timeouts, **kwargs)
    assert life.on(Event.ACCEPTED) == [ASK]
    assert life.goal.state is State.EXECUTING
    return life


def unconfirmed(timeouts: Timeouts = LIMITS) -> Life:
    """A goal whose request was not answered within timeout.accept."""
    life = sending(timeouts)
    assert life.pass_time(timeouts.accept or 0.0) == [CANCEL]
    return life


def denied(life: Life) -> None:
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)


def denied_unconfirmed() -> Life:
    """One for which the tree did not wait any longer, because its server denied it."""
    life = unconfirmed()
    life.pass_time((LIMITS.accept or 0.0) - 1.0)
    denied(life)
    life.pass_time(1.0)
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.NEVER_STARTED)
    return life


# The table


def test_a_wish_to_stop_means_something_in_every_state_and_each_event_in_some() -> None:
    for state in set(State) - {State.DONE}:
        assert {TABLE[state, Event.ABANDONED], TABLE[state, Event.PARKED]} != {drop}, state
    for state in set(State) - {State.DONE, State.LOST, State.NOT_RECEIVED}:
        assert TABLE[state, Event.INTERRUPTED] is not drop, state
    for event in set(Event) - {Event.LOOK_OUT_DUE}:  # which ends a wait, and tells nothing
        assert not all(TABLE[state, event] is drop for state in State), event


def test_after_done_nothing_is_sent_whatever_comes() -> None:
    life = executing()
    life.on(Event.RESULT, SUCCEEDED)
    for event in Event:
        assert life.on(event, SUCCEEDED) == []
    assert life.pass_time(1e6) == []
    life.ended(Outcome.SUCCEEDED, End.SUCCEEDED)


@pytest.mark.parametrize("make", [Life, waiting, sending, executing, unconfirmed])
@pytest.mark.parametrize("event", list(Event))
def test_any_event_may_come_in_any_state(make: Any, event: Event) -> None:
    details = {Event.STATUS: STATUS_ABORTED, Event.RESULT: ABORTED, Event.CANCEL_ANSWERED: 0}
    make().on(event, details.get(event, "detail"))


@pytest.mark.parametrize("name", ["goal", "facts", "asking", "deadlines", "table", "steps/*"])
def test_the_machine_knows_no_thread_and_no_clock(name: str) -> None:
    files = list(Path(bt_actions.goals.__file__).parent.glob(f"{name}.py"))
    imports = [line for each in files for line in each.read_text().splitlines() if "import" in line]
    assert imports
    assert not [line for line in imports if re.search(r"\b(time|threading|asyncio|rclpy)\b", line)]


def test_what_is_known_of_a_goal_can_be_kept_in_mind() -> None:
    assert len(vars(Life().goal)) <= 20


def test_a_goal_shows_where_it_is() -> None:
    assert repr(sending().goal) == f"<Goal /move {'2a' * 16} SENDING>"
    life = executing()
    life.on(Event.RESULT, ABORTED)
    assert repr(life.goal) == f"<Goal /move {'2a' * 16} DONE ABORTED, end ABORTED>"


def test_without_resources_of_its_own_a_goal_needs_its_servers_name() -> None:
    assert Life().goal.resources == {"/move"}
    assert Life(resources=frozenset({"base"})).goal.resources == {"base"}


# The row of the outcome table


def test_an_aborted_goal_keeps_its_result() -> None:
    life = executing()
    life.on(Event.RESULT, ABORTED)
    life.ended(Outcome.ABORTED, End.ABORTED)
    assert life.goal.result == "the result"
    assert life.goal.reason == "aborted by /move"


def test_canceled_without_being_asked_was_somebody_else() -> None:
    life = executing()
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.CANCELED_BY_OTHER, End.CANCELED)


def test_a_refused_goal_never_started() -> None:
    life = sending()
    life.on(Event.REJECTED)
    life.ended(Outcome.REJECTED, End.NEVER_STARTED)


def test_no_server_in_time() -> None:
    life = waiting()
    life.pass_time(5.0)
    life.ended(Outcome.SERVER_UNAVAILABLE, End.NEVER_STARTED)
    assert life.goal.reason == "no action server /move within 5 s"


def test_two_servers_are_sent_nothing() -> None:
    life = waiting()
    life.on(Event.SERVER_AMBIGUOUS)
    life.ended(Outcome.SERVER_AMBIGUOUS, End.NEVER_STARTED)
    assert SEND not in life.sent


def test_what_two_servers_may_have_taken_is_canceled() -> None:
    life = executing()
    assert life.on(Event.SERVER_AMBIGUOUS) == [CANCEL, ASK]
    assert life.on(Event.SERVER_AMBIGUOUS) == [CANCEL, ASK], "a second acceptance: at once"
    life.on(Event.RESULT, SUCCEEDED)
    life.ended(Outcome.SERVER_AMBIGUOUS, End.SUCCEEDED)
    assert not life.goal.late


@pytest.mark.parametrize("why", [Event.INTERRUPTED, Event.RESULT_DUE])
def test_what_two_servers_may_have_taken_is_no_late_success(why: Event) -> None:
    life = executing()
    life.on(why)
    assert life.on(Event.SERVER_AMBIGUOUS) == [CANCEL, ASK]
    life.on(Event.RESULT, SUCCEEDED)
    canceled = why is Event.INTERRUPTED
    life.ended(Outcome.CANCELED if canceled else Outcome.SERVER_AMBIGUOUS, End.SUCCEEDED)


def test_what_turns_up_again_is_canceled_and_holds_nothing() -> None:
    """A goal that has ended, and that a second server runs."""
    life = Life()
    life.goal = Goal(b"1", "/move", LIMITS, life.now)
    life.goal.turns_up_again()
    assert life.goal.outcome is Outcome.SERVER_AMBIGUOUS
    assert not life.goal.claims_resources
    assert life.on(Event.SERVER_RETURNED) == [CANCEL, ASK]
    assert life.goal.end is End.UNKNOWN
    assert life.goal.outstanding
    assert life.on(Event.RESULT, CANCELED) == []
    assert (life.goal.state, life.goal.end) == (State.DONE, End.CANCELED)


@pytest.mark.parametrize("how", ["at once", "in time"])
def test_a_taken_resource_ends_as_server_busy(how: str) -> None:
    life = Life()
    if how == "at once":
        life.on(Event.TAKEN)
    else:
        life.pass_time(10.0)
    life.ended(Outcome.SERVER_BUSY, End.NEVER_STARTED)


def test_a_message_that_cannot_be_built_is_not_sent() -> None:
    life = waiting()
    life.on(Event.INVALID, "no variable $pick_at")
    life.ended(Outcome.INVALID_GOAL, End.NEVER_STARTED)
    assert life.goal.reason == "no variable $pick_at"


def test_a_request_that_does_not_leave_started_nothing() -> None:
    life = sending()
    life.on(Event.SEND_FAILED, "no space left")
    life.ended(Outcome.SERVER_UNAVAILABLE, End.NEVER_STARTED)


# Rule 2: interrupted before acceptance


@pytest.mark.parametrize("make", [Life, waiting])
def test_interrupted_before_it_was_sent_nothing_is_sent(make: Any) -> None:
    life = make()
    life.on(Event.INTERRUPTED)
    life.ended(Outcome.CANCELED, End.NEVER_STARTED)
    assert life.sent == [RELEASE]


@pytest.mark.parametrize("event", [Event.ACCEPTED, Event.FEEDBACK, Event.STATUS])
def test_interrupted_before_acceptance_it_is_canceled_as_soon_as_it_turns_up(event: Event) -> None:
    life = sending()
    assert life.on(Event.INTERRUPTED) == [], "the server does not know it yet"
    assert life.on(event, STATUS_CANCELED) == [CANCEL, ASK]
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.CANCELED, End.CANCELED)


@pytest.mark.parametrize("code", [CANCEL_ACCEPTED, CANCEL_TERMINATED])
def test_a_server_that_knows_a_goal_it_had_not_answered_has_accepted_it(code: int) -> None:
    life = unconfirmed()
    assert life.on(Event.CANCEL_ANSWERED, code) == [CANCEL, ASK]
    assert life.goal.accepted


def test_accepted_however_late_it_is_canceled() -> None:
    life = denied_unconfirmed()
    life.pass_time(3600.0)
    assert life.on(Event.ACCEPTED) == [CANCEL, ASK]
    assert life.goal.end is End.UNKNOWN
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.ACCEPT_TIMEOUT, End.CANCELED)


# Rule 3: unconfirmed goals


def test_an_unanswered_request_is_asked_about_by_canceling() -> None:
    life = sending()
    assert life.pass_time(3.0) == [CANCEL]
    assert life.goal.outcome is None, "the leaf waits: it might have been executed"


def test_an_unconfirmed_goal_that_the_server_denies_never_started_and_frees_its_resource() -> None:
    life = unconfirmed()
    life.pass_time(2.0)
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
    assert RELEASE in life.pass_time(1.0)
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.NEVER_STARTED)


def test_an_unconfirmed_goal_that_nobody_denies_stays_unknown_and_keeps_its_resource() -> None:
    life = unconfirmed()
    life.pass_time(3.0)
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.UNKNOWN)
    assert life.goal.claims_resources
    assert life.pass_time(ASK_AGAIN) == [CANCEL], "and the questions go on"
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
    life.pass_time(3.0)
    assert life.goal.end is End.UNKNOWN, "an old denial does not count"
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
    life.pass_time(2.0, 2.0)
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
    life.pass_time(1.0)
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.NEVER_STARTED)


def test_an_unconfirmed_goal_that_is_refused_late_was_rejected() -> None:
    life = unconfirmed()
    life.on(Event.REJECTED)
    life.ended(Outcome.REJECTED, End.NEVER_STARTED)
    assert life.goal.late


def test_without_a_deadline_for_acceptance_an_unwanted_goal_is_not_waited_for_for_ever() -> None:
    for limits, patience in (
        (Timeouts(accept=None, cancel=4.0), 4.0),
        (Timeouts(accept=None, cancel=None), PATIENCE),
    ):
        life = sending(limits)
        assert life.due_in is None
        life.on(Event.INTERRUPTED)
        assert life.due_in == patience
        assert life.pass_time(patience) == [CANCEL]
        life.pass_time(patience - 1.0)
        life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
        life.pass_time(1.0)
        life.is_free(Outcome.CANCELED, End.NEVER_STARTED)


# Rule 4: what comes late or twice


def test_what_comes_twice_changes_nothing() -> None:
    life = executing()
    life.on(Event.ACCEPTED)
    life.on(Event.REJECTED)
    assert life.goal.state is State.EXECUTING
    life.on(Event.RESULT, SUCCEEDED)
    life.on(Event.RESULT, ABORTED)
    life.ended(Outcome.SUCCEEDED, End.SUCCEEDED)


@pytest.mark.parametrize("event", [Event.FEEDBACK, Event.STATUS])
def test_what_only_an_accepted_goal_has_is_as_good_as_its_acceptance(event: Event) -> None:
    life = sending()
    assert life.on(event, 2) == [ASK]
    assert life.goal.state is State.EXECUTING
    assert life.on(Event.ACCEPTED) == []


def test_a_goal_that_ended_before_its_acceptance_was_heard_of_is_asked_for_its_result() -> None:
    life = sending()
    life.on(Event.STATUS, STATUS_SUCCEEDED)
    assert life.pass_time(ASK_AGAIN) == [ASK]
    life.on(Event.RESULT, SUCCEEDED)
    life.ended(Outcome.SUCCEEDED, End.SUCCEEDED)


# Rule 5: terminate, and what is drained


@pytest.mark.parametrize("canceled", [False, True])
@pytest.mark.parametrize("result", [SUCCEEDED, ABORTED, CANCELED])
def test_what_a_result_says_goes_on_makes_the_end_unknown(
    canceled: bool, result: tuple[int, str]
) -> None:
    life = executing(accounts_for_all=lambda result: False)
    if canceled:
        life.on(Event.INTERRUPTED)
    life.on(Event.RESULT, result)
    assert (life.goal.state, life.goal.end) == (State.DONE, End.UNKNOWN)


def test_interrupted_while_executing_it_is_canceled_whatever_it_ended_with() -> None:
    for result, end in ((SUCCEEDED, End.SUCCEEDED), (ABORTED, End.ABORTED)):
        life = executing()
        assert life.on(Event.INTERRUPTED) == [CANCEL, ASK]
        assert life.goal.outcome is None
        life.on(Event.RESULT, result)
        life.ended(Outcome.CANCELED, end)
        assert not life.goal.late


@pytest.mark.parametrize("make", [sending, executing, unconfirmed])
def test_interrupting_twice_is_interrupting_once(make: Any) -> None:
    life = make()
    life.on(Event.INTERRUPTED)
    reason, due = life.goal.reason, life.due_in
    for _ in range(3):
        assert life.on(Event.INTERRUPTED) == []
    assert (life.goal.reason, life.due_in) == (reason, due)


def test_an_outcome_is_decided_once() -> None:
    life = executing()
    life.pass_time(2.0)
    life.pass_time(4.0)
    life.is_free(Outcome.STALLED, End.UNKNOWN)
    life.on(Event.INTERRUPTED)
    life.on(Event.SERVER_LOST, "gone")
    life.on(Event.RESULT, SUCCEEDED)
    life.ended(Outcome.STALLED, End.SUCCEEDED)


def test_the_cancel_deadline_runs_to_the_terminal_status_not_to_the_acknowledgement() -> None:
    life = executing()
    life.on(Event.INTERRUPTED)
    life.on(Event.CANCEL_ANSWERED, CANCEL_ACCEPTED)
    life.pass_time(3.9)
    assert life.goal.outcome is None
    life.pass_time(0.1)
    life.is_free(Outcome.CANCELED, End.UNKNOWN)
    assert life.goal.claims_resources, "others queue meanwhile"
    assert life.pass_time(ASK_AGAIN) == [CANCEL, ASK]
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.CANCELED, End.CANCELED)


def test_what_the_server_said_of_a_cancel_is_told_as_long_as_it_holds() -> None:
    life = sending()
    life.on(Event.INTERRUPTED)
    life.on(Event.DRAIN_GAVE_UP)
    assert not life.goal.cancel_said, "it was not asked"
    life.on(Event.ACCEPTED)
    assert "has not answered" in life.goal.cancel_said
    life.on(Event.CANCEL_ANSWERED, CANCEL_REJECTED)
    assert "refuses to cancel it" in life.goal.cancel_said
    life.on(Event.SERVER_LOST, "gone")
    assert not life.goal.cancel_said
    life.on(Event.SERVER_RETURNED)
    assert "has not answered" in life.goal.cancel_said, "it is another one, perhaps"
    life.on(Event.CANCEL_ANSWERED, CANCEL_ACCEPTED)
    life.on(Event.CANCEL_ANSWERED, CANCEL_TERMINATED)
    life.on(Event.PARKED)
    assert "has agreed to cancel it, and it has not ended" in life.goal.cancel_said


def test_a_cancel_that_is_refused_or_not_answered_is_asked_for_again() -> None:
    life = executing()
    life.on(Event.INTERRUPTED)
    life.on(Event.CANCEL_ANSWERED, CANCEL_REJECTED)
    for _ in range(3):
        assert life.pass_time(ASK_AGAIN) == [CANCEL, ASK]


def test_who_refused_to_cancel_is_named_where_the_goal_ends_all_the_same() -> None:
    life = executing(Timeouts(cancel=9.0))
    life.on(Event.INTERRUPTED)
    life.on(Event.CANCEL_ANSWERED, CANCEL_REJECTED)
    life.on(Event.RESULT, (STATUS_SUCCEEDED, None))
    life.ended(Outcome.CANCELED, End.SUCCEEDED)
    assert life.goal.reason.endswith("refuses to cancel it")


def test_a_server_that_says_nothing_is_asked_less_often_until_it_speaks() -> None:
    """What it was asked waits in its queue, in the way of other clients."""
    life = executing(Timeouts(cancel=2.0))
    life.on(Event.INTERRUPTED)
    for _ in range(UNHEARD):
        assert life.pass_time(ASK_AGAIN) == [CANCEL, ASK]
    assert life.pass_time(ASK_LESS - 0.5) == []
    assert life.pass_time(0.5) == [CANCEL, ASK]
    assert life.pass_time(5.0) == []
    life.on(Event.CANCEL_ANSWERED, CANCEL_REJECTED)
    assert life.pass_time(ASK_AGAIN) == [CANCEL, ASK]
    assert life.pass_time(ASK_AGAIN) == [CANCEL, ASK]


def test_a_request_that_was_denied_for_good_never_came_whatever_becomes_of_its_server() -> None:
    life = unconfirmed()
    for _ in range(int(DENIED_FOR_GOOD) + 5):
        life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
        life.pass_time(1.0)
    assert not life.goal.may_still_be_accepted
    for goes in (Event.SERVER_LOST, Event.PARKED):
        life.on(goes, "gone")
        assert life.on(Event.SERVER_RETURNED) == [CANCEL], "to ask does no harm"
        life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
        assert life.pass_time(60.0) == []
        assert (life.goal.end, life.goal.may_still_be_accepted) == (End.NEVER_STARTED, False)
    assert life.on(Event.ACCEPTED) == [CANCEL, ASK], "it came after all"


# Rule 6: deadlines


def test_a_deadline_cancels_and_the_leaf_waits_for_the_end() -> None:
    life = executing(Timeouts(result=30.0))
    assert life.pass_time(30.0) == [CANCEL, ASK]
    assert life.goal.outcome is None
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.RESULT_TIMEOUT, End.CANCELED)
    assert life.goal.reason == "not finished within 30 s"


def test_success_that_comes_late_counts_as_what_it_is() -> None:
    life = executing(Timeouts(result=30.0))
    life.pass_time(30.0)
    life.on(Event.RESULT, SUCCEEDED)
    life.ended(Outcome.SUCCEEDED, End.SUCCEEDED)
    assert life.goal.late


def test_interrupted_after_a_deadline_it_is_canceled_even_if_it_succeeds_late() -> None:
    life = executing(Timeouts(result=30.0))
    life.pass_time(30.0)
    life.on(Event.INTERRUPTED)
    life.on(Event.RESULT, SUCCEEDED)
    life.ended(Outcome.CANCELED, End.SUCCEEDED)


def test_feedback_breaks_the_silence() -> None:
    life = executing()
    for _ in range(5):
        life.pass_time(1.9)
        life.on(Event.FEEDBACK, "moving")
    assert life.goal.feedback == "moving"
    assert life.pass_time(2.0) == [CANCEL, ASK]
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.STALLED, End.CANCELED)


def test_result_and_feedback_run_on_the_nodes_clock() -> None:
    life = executing()
    life.pass_time(1e6, ros=1.9)
    assert life.goal.state is State.EXECUTING
    life.pass_time(0.0, ros=0.1)
    assert life.goal.state is State.CANCELING


@pytest.mark.parametrize("make", [Life, waiting, sending])
def test_queue_server_and_accept_run_on_the_steady_clock(make: Any) -> None:
    life = make()
    before = life.goal.state
    life.pass_time(0.1, ros=1e6)
    assert life.goal.state is before
    life.pass_time(10.0, ros=0.0)
    assert life.goal.state is not before


def test_a_jump_back_of_the_clock_leaves_what_remained() -> None:
    life = executing(Timeouts(result=30.0))
    life.pass_time(20.0)
    life.pass_time(0.0, ros=-500.0)
    assert life.due_in == pytest.approx(10.0)
    life.pass_time(9.9)
    assert life.goal.state is State.EXECUTING
    life.pass_time(0.2)
    assert life.goal.state is State.CANCELING


def test_no_deadline_means_none() -> None:
    none = Timeouts(None, None, None, None, None, None)
    for make in (Life, waiting, sending):
        life = make(none)
        assert life.due_in is None
        assert life.pass_time(1e9) == []


def test_without_deadlines_the_server_is_still_asked_now_and_then() -> None:
    life = executing(Timeouts(None, None, None, None, None, None))
    assert life.goal.deadline(life.now) is None, "it is no deadline"
    for _ in range(3):
        assert life.pass_time(ASK_IN_ANY_CASE - 0.1) == []
        assert life.pass_time(0.1) == [Command.ASK_RESULT]
    assert life.goal.state is State.EXECUTING


def test_what_is_held_falls_due_later_and_nothing_else_does() -> None:
    life = executing()
    life.now = Now(life.now.steady + 2.5, life.now.ros + 2.5)  # nobody polls: timeout.feedback is 2
    life.goal.deadlines.suspend(1.0, life.now)
    assert life.pass_time(0.9) == []
    assert life.goal.deadline(life.now) == (Event.FEEDBACK_DUE, pytest.approx(0.1))
    life.on(Event.FEEDBACK, "at last")
    assert life.goal.deadline(life.now) == (Event.FEEDBACK_DUE, 2.0)


@pytest.mark.parametrize("last", [Event.CANCEL_DUE, Event.DRAIN_GAVE_UP])
def test_an_end_that_the_status_shows_is_known_when_nobody_waits_any_longer(last: Event) -> None:
    life = executing()
    life.on(Event.INTERRUPTED)
    life.on(Event.STATUS, STATUS_CANCELED)
    life.pass_time(ASK_AGAIN)
    life.pass_time(ASK_AGAIN)
    life.on(last)
    life.ended(Outcome.CANCELED, End.CANCELED)


@pytest.mark.parametrize("asked", ["at that moment", "just before"])
def test_a_question_for_a_result_has_time_to_be_answered_at_the_end_of_the_wait(asked: str) -> None:
    life = executing(Timeouts(result=3.0, cancel=2.0))
    life.pass_time(3.0)
    life.on(Event.STATUS, STATUS_SUCCEEDED)
    if asked == "just before":
        life.pass_time(1.9)
        life.pass_time(0.1)
    else:
        life.pass_time(2.0)  # nobody polled between: the question and the verdict are due in one
    assert life.goal.outcome is None
    life.on(Event.RESULT, SUCCEEDED)
    life.ended(Outcome.SUCCEEDED, End.SUCCEEDED)
    assert life.goal.late


# Rule 7: the server dies, restarts, comes back


def test_a_lost_server_frees_the_leaf_and_the_resource() -> None:
    life = executing()
    assert life.on(Event.SERVER_LOST, "gone") == [RELEASE]
    life.is_free(Outcome.SERVER_LOST, End.SERVER_GONE)
    assert life.goal.lost
    assert life.due_in == LOOKED_OUT_FOR


def test_a_lost_server_that_is_back_is_told_to_cancel_first_of_all() -> None:
    life = executing()
    life.on(Event.SERVER_LOST, "gone")
    life.pass_time(10.0)
    assert life.on(Event.SERVER_RETURNED) == [CANCEL, ASK]
    assert life.goal.end is End.UNKNOWN
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.SERVER_LOST, End.CANCELED)


def test_feedback_of_a_goal_given_up_as_lost_shows_that_it_runs() -> None:
    life = executing()
    life.on(Event.SERVER_LOST, "gone")
    assert life.on(Event.FEEDBACK, "moving") == [CANCEL, ASK]
    assert life.goal.end is End.UNKNOWN


def test_a_goal_lost_before_its_acceptance_is_judged_when_the_server_is_back() -> None:
    life = sending()
    life.on(Event.SERVER_LOST, "gone")
    assert life.on(Event.SERVER_RETURNED) == [CANCEL]
    assert life.goal.end is End.UNKNOWN
    life.pass_time(2.0)
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
    life.pass_time(1.0)
    life.is_free(Outcome.SERVER_LOST, End.NEVER_STARTED)
    assert not life.goal.outstanding, "others may be sent"


def test_an_unconfirmed_goal_that_was_denied_once_may_run_on_a_server_that_is_lost() -> None:
    """Its acceptance may have been under way when the link was cut."""
    life = denied_unconfirmed()
    life.on(Event.SERVER_LOST, "cut")
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.SERVER_GONE)
    assert life.on(Event.SERVER_RETURNED) == [CANCEL]
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.UNKNOWN)
    assert life.on(Event.ACCEPTED) == [CANCEL, ASK]


def test_an_unconfirmed_goal_bars_nothing_once_its_server_is_back_and_denies_it() -> None:
    life = denied_unconfirmed()
    life.on(Event.SERVER_LOST, "cut")
    life.on(Event.SERVER_RETURNED)
    assert life.goal.outstanding
    denied(life)
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.NEVER_STARTED)
    assert not life.goal.outstanding
    assert life.on(Event.ACCEPTED) == [CANCEL, ASK], "and if it turns up all the same"


def test_a_new_server_is_asked_whether_it_knows_the_goal() -> None:
    assert executing().on(Event.SERVER_CHANGED) == [ASK]
    assert sending().on(Event.SERVER_CHANGED) == [], "it had not been accepted"
    life = executing()
    life.on(Event.INTERRUPTED)
    assert life.on(Event.SERVER_CHANGED) == [CANCEL, ASK], "which the first may not have heard"
    replaced = executing()
    replaced.on(Event.REPLACED)
    assert replaced.on(Event.SERVER_CHANGED) == [ASK]


def test_a_lone_server_is_believed_only_when_it_denies_the_goal_several_times() -> None:
    life = executing(Timeouts(result=None))
    for _ in range(DOUBTS - 1):
        assert life.on(Event.RESULT_UNKNOWN) == []
        assert life.pass_time(ASK_AGAIN) == [ASK]
    life.on(Event.RESULT_UNKNOWN)
    life.ended(Outcome.SERVER_LOST, End.UNKNOWN)


def test_feedback_clears_the_doubt() -> None:
    life = executing(Timeouts(result=None))
    for _ in range(2 * DOUBTS):
        life.on(Event.RESULT_UNKNOWN)
        life.on(Event.FEEDBACK, "moving")
    assert life.goal.state is State.EXECUTING


@pytest.mark.parametrize("make", [sending, executing, unconfirmed])
def test_what_its_node_leaves_is_canceled_where_its_server_is_seen_again(make: Any) -> None:
    life = make()
    life.on(Event.INTERRUPTED)
    assert life.on(Event.PARKED) == [RELEASE]
    life.is_free(Outcome.CANCELED, End.UNKNOWN)
    assert life.due_in is None
    assert life.on(Event.PARKED) == []
    assert CANCEL in life.on(Event.SERVER_RETURNED)
    assert life.goal.outstanding
    life.on(Event.ACCEPTED)
    life.on(Event.RESULT, CANCELED)
    assert (life.goal.state, life.goal.end) == (State.DONE, End.CANCELED)


def test_where_the_result_is_lost_the_status_topic_says_how_it_ended() -> None:
    life = executing(Timeouts(result=None))
    life.on(Event.STATUS, STATUS_ABORTED)
    for _ in range(RESULT_QUESTIONS):
        assert life.pass_time(ASK_AGAIN) == [ASK]
    life.pass_time(ASK_AGAIN)
    life.ended(Outcome.SERVER_LOST, End.ABORTED)


def test_a_result_that_is_lost_until_the_deadline_leaves_its_end_known() -> None:
    life = executing(Timeouts(result=3.0))
    life.on(Event.STATUS, STATUS_SUCCEEDED)
    for _ in range(3 + int(life.goal.timeouts.cancel or 0.0)):
        life.pass_time(ASK_AGAIN)
    life.ended(Outcome.RESULT_TIMEOUT, End.SUCCEEDED)
    assert life.goal.reason.endswith("; it ended as SUCCEEDED, and its result was lost")


def test_a_server_that_dies_after_showing_the_end_leaves_no_question() -> None:
    life = executing()
    life.on(Event.STATUS, STATUS_SUCCEEDED)
    life.on(Event.SERVER_LOST, "gone")
    life.ended(Outcome.SERVER_LOST, End.SUCCEEDED)


# Rule 8: the process ends


@pytest.mark.parametrize("make", [sending, executing, unconfirmed])
def test_a_process_that_ends_says_which_goal_it_cannot_account_for(make: Any) -> None:
    life = make()
    life.on(Event.PARKED)
    life.on(Event.ABANDONED)
    assert life.goal.state is State.DONE
    assert life.goal.end is End.UNKNOWN
    assert life.goal.outcome is not None


# Somebody else's word


@pytest.mark.parametrize("canceling", [False, True])
def test_a_terminal_status_is_not_believed_against_feedback_that_goes_on(canceling: bool) -> None:
    life = executing()
    if canceling:
        life.on(Event.INTERRUPTED)
    life.on(Event.STATUS, STATUS_SUCCEEDED)
    for _ in range(2 * RESULT_QUESTIONS):
        life.pass_time(ASK_AGAIN)
        life.on(Event.FEEDBACK, "moving")
    assert life.goal.state is not State.DONE
    assert life.goal.end is End.UNKNOWN


def test_a_terminal_status_is_taken_back_by_one_that_is_not() -> None:
    life = executing()
    life.on(Event.STATUS, STATUS_SUCCEEDED)
    life.on(Event.STATUS, STATUS_EXECUTING)
    life.on(Event.SERVER_LOST, "gone")
    assert life.goal.end is End.SERVER_GONE


# Replaced


def replaced() -> Life:
    life = executing()
    its_own = life.goal.server
    assert life.on(Event.REPLACED, its_own) == [], "servers that preempt end it by themselves"
    return life


def test_what_was_replaced_is_canceled_whatever_it_ended_with() -> None:
    for result, end in ((SUCCEEDED, End.SUCCEEDED), (ABORTED, End.ABORTED)):
        life = replaced()
        life.on(Event.RESULT, result)
        life.ended(Outcome.CANCELED, end)


@pytest.mark.parametrize("already", [False, True])
def test_what_was_replaced_on_another_server_is_canceled_at_once(already: bool) -> None:
    life = replaced() if already else executing()
    assert life.on(Event.REPLACED, "/another") == [CANCEL, ASK]
    life.on(Event.RESULT, CANCELED)
    life.ended(Outcome.CANCELED, End.CANCELED)


@pytest.mark.parametrize("how", ["feedback then silence", "lost", "denied", "result lost"])
def test_what_was_replaced_never_has_an_outcome_that_is_retried(how: str) -> None:
    life = replaced()
    if how == "feedback then silence":
        life.on(Event.FEEDBACK, "moving")
        life.pass_time(2.5)
        life.pass_time(1.5)
        life.pass_time(4.0)
    elif how == "lost":
        life.on(Event.SERVER_LOST, "gone")
    elif how == "denied":
        for _ in range(DOUBTS):
            life.on(Event.RESULT_UNKNOWN)
    else:
        life.on(Event.STATUS, STATUS_SUCCEEDED)
        for _ in range(RESULT_QUESTIONS + 1):
            life.pass_time(ASK_AGAIN)
    assert life.goal.outcome is Outcome.CANCELED


def test_replaced_before_it_was_sent_it_is_not_sent() -> None:
    life = waiting(busy=Busy.WAIT)
    life.on(Event.REPLACED)
    life.ended(Outcome.CANCELED, End.NEVER_STARTED)


def test_replaced_before_acceptance_it_is_canceled_when_it_turns_up() -> None:
    life = sending()
    assert life.on(Event.REPLACED) == []
    assert life.goal.reason == "replaced by a newer goal before it was accepted"
    assert life.on(Event.ACCEPTED) == [CANCEL, ASK]


def test_what_was_waited_for_in_vain_is_unknown_and_still_canceled_if_it_turns_up() -> None:
    life = unconfirmed()
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
    life.pass_time(life.goal.timeouts.accept or 0.0)
    assert life.goal.may_still_be_accepted
    life.on(Event.DRAIN_GAVE_UP)
    assert (life.goal.outcome, life.goal.end) == (Outcome.ACCEPT_TIMEOUT, End.UNKNOWN)
    assert not life.goal.outstanding, "the server may get other goals"
    assert Command.CANCEL in life.on(Event.ACCEPTED)


def test_what_may_run_again_at_a_server_that_is_back_is_outstanding() -> None:
    life = executing()
    life.on(Event.SERVER_LOST, "gone")
    assert not life.goal.outstanding, "nobody can tell, and it holds nothing"
    life.on(Event.SERVER_RETURNED)
    assert life.goal.outstanding


@pytest.mark.parametrize("busy", Busy)
def test_who_waits_or_fails_has_its_resources_for_itself(busy: Busy) -> None:
    goal = Goal(b"2", "lift", LIMITS, executing().now, resources=frozenset({"base"}), busy=busy)
    assert goal.exclusive == ({"base"} if busy in (Busy.WAIT, Busy.FAIL) else set())


def test_an_unconfirmed_goal_that_is_denied_for_good_need_not_be_waited_for() -> None:
    life = denied_unconfirmed()
    assert life.pass_time(DENIED_FOR_GOOD - 2.0) == []
    assert life.goal.may_still_be_accepted
    assert life.pass_time(1.0) == [CANCEL], "asked once more"
    denied(life)
    assert not life.goal.may_still_be_accepted
    assert life.due_in is None
    life.on(Event.DRAIN_GAVE_UP)
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.NEVER_STARTED)
    assert CANCEL in life.on(Event.ACCEPTED), "and it is still canceled if it turns up"
    assert life.goal.end is End.UNKNOWN


def test_only_denials_count_towards_denied_for_good() -> None:
    life = denied_unconfirmed()
    life.pass_time(DENIED_FOR_GOOD)
    assert life.goal.may_still_be_accepted, "silence is no denial"
    denied(life)
    assert not life.goal.may_still_be_accepted


def test_what_was_given_up_as_unknown_is_accounted_for_once_it_is_denied_for_good() -> None:
    life = denied_unconfirmed()
    life.on(Event.DRAIN_GAVE_UP)
    assert life.goal.end is End.UNKNOWN
    life.pass_time(DENIED_FOR_GOOD)
    denied(life)
    life.is_free(Outcome.ACCEPT_TIMEOUT, End.NEVER_STARTED)


def test_an_unconfirmed_goal_whose_server_is_back_beside_another_is_canceled_again() -> None:
    life = denied_unconfirmed()
    assert CANCEL in life.on(Event.SERVER_CHANGED)


def test_a_process_that_ends_does_not_say_never_started_of_a_request_without_answer() -> None:
    life = unconfirmed()
    life.on(Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL)
    life.pass_time(life.goal.timeouts.accept or 0.0)
    life.on(Event.PARKED)
    life.on(Event.ABANDONED)
    life.ended(Outcome.ACCEPT_TIMEOUT, End.UNKNOWN)
