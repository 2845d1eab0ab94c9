"""The generator of histories finds every one of these wrong machines: so it would find it in ours.

Each mutation is one plausible mistake, made on purpose and undone after the test. Only here is
production replaced in part: nothing else in this folder patches it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from bt_actions.goals.asking import Asking
from bt_actions.goals.attempts import AttemptRecord, Attempts
from bt_actions.goals.deadlines import Deadlines
from bt_actions.goals.facts import Does, Facts, Step, drop
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Busy, End, Outcome
from bt_actions.goals.resources import Resources
from bt_actions.goals.steps import canceling, requested, running
from bt_actions.goals.table import TABLE
from bt_actions.goals.terms import MAY_STILL_BE_ACCEPTED, Command, Event, State
from bt_actions.servers import replies
from bt_actions.servers.stalls import Stalls
from bt_actions.traffic import admission, driver, endpoint, handover
from bt_actions.traffic.state import GoalHandle
from tests.machine.crowds import CrowdPlay, crowded_history
from tests.machine.histories import broken, first_broken, random_history, shrink, tell

ENOUGH = 15_000
"""Histories in which each mistake must be found; CI plays 50,000 on the right machine."""

CROWDS_ENOUGH = 2_000
"""The same, of histories of several servers of one name (crowds.py)."""

Patch = pytest.MonkeyPatch
MUTATIONS: dict[str, Callable[[Patch], None]] = {}


def mutation(make: Callable[[Patch], None]) -> Callable[[Patch], None]:
    """File a mutation under what it does wrong."""
    MUTATIONS[make.__name__.replace("_", " ")] = make
    return make


UNWANTED = (State.CANCELING, *MAY_STILL_BE_ACCEPTED)


def decide(patch: Patch, event: Event, does: Does, *states: State) -> None:
    """Replace one row of the table, in some states."""
    for state in states:
        patch.setitem(TABLE, (state, event), Step(does, frozenset(State), "a mistake"))


def ignore(patch: Patch, event: Event, *states: State) -> None:
    """Drop an event in some states, as if nobody had thought of it."""
    decide(patch, event, drop, *states)


@mutation
def forgets_the_cancel_before_acceptance(patch: Patch) -> None:
    def accepted(goal: Facts) -> State:
        state = requested.turned_up(goal)
        goal.commands.remove(Command.CANCEL)
        return state

    decide(patch, Event.ACCEPTED, accepted, *MAY_STILL_BE_ACCEPTED)


@mutation
def begins_though_it_was_interrupted(patch: Patch) -> None:
    decide(patch, Event.ACCEPTED, requested.begin, *MAY_STILL_BE_ACCEPTED)


@mutation
def takes_a_late_answer_for_the_attempt_that_runs_now(patch: Patch) -> None:
    def heard_of(here: Any, goal_id: bytes, *, denies: bool = False) -> GoalHandle | None:
        runs_now: GoalHandle | None = here.host.caller.seen[goal_id].real.owner.handle
        if runs_now is not None:
            return runs_now if runs_now.goal.sent else None
        return original(here, goal_id, denies=denies)

    original = endpoint.ActionEndpoint._heard_of
    patch.setattr(endpoint.ActionEndpoint, "_heard_of", heard_of)


def tried_again_unless(patch: Patch, refused: Callable[[AttemptRecord], bool]) -> None:
    """Ask nothing of an attempt but its outcome, and one thing more."""

    def why_not(self: Attempts, record: AttemptRecord) -> str | None:
        return None if record.outcome in self.retry.outcomes and not refused(record) else ""

    patch.setattr(Attempts, "_why_not", why_not)


@mutation
def retries_before_the_end_is_known(patch: Patch) -> None:
    tried_again_unless(patch, lambda record: False)


@mutation
def does_twice_what_has_succeeded(patch: Patch) -> None:
    tried_again_unless(patch, lambda record: record.end in (End.UNKNOWN, End.SERVER_GONE))


@mutation
def retries_beside_a_server_that_is_gone(patch: Patch) -> None:
    tried_again_unless(patch, lambda record: record.end in (End.UNKNOWN, End.SUCCEEDED))


@mutation
def waits_for_feedback_of_a_goal_that_has_ended(patch: Patch) -> None:
    def seen(goal: Facts) -> State:
        state = running.status(goal)
        goal.deadlines.arm(Event.FEEDBACK_DUE, goal.timeouts.feedback)
        return state

    decide(patch, Event.STATUS, seen, State.EXECUTING)


@mutation
def settles_twice(patch: Patch) -> None:
    def settle(goal: Facts, outcome: Outcome, reason: str) -> None:
        goal.outcome, goal.reason = outcome, reason

    patch.setattr(Facts, "settle", settle)


@mutation
def keeps_the_resource(patch: Patch) -> None:
    patch.setattr(Facts, "release", lambda self: None)


@mutation
def releases_when_the_leaf_stops_waiting(patch: Patch) -> None:
    def cancel_due(goal: Facts) -> State:
        goal.release()
        return canceling.cancel_due(goal)

    decide(patch, Event.CANCEL_DUE, cancel_due, State.CANCELING)


@mutation
def releases_when_the_cancel_is_sent(patch: Patch) -> None:
    def interrupted(goal: Facts) -> State:
        goal.release()
        return interrupt(goal)

    interrupt = TABLE[State.EXECUTING, Event.INTERRUPTED]
    decide(patch, Event.INTERRUPTED, interrupted, State.EXECUTING)


@mutation
def cancels_after_done(patch: Patch) -> None:
    def again(goal: Facts) -> State:
        goal.commands.append(Command.CANCEL)
        return State.DONE

    decide(patch, Event.INTERRUPTED, again, State.DONE)


@mutation
def cancels_again_at_each_interruption(patch: Patch) -> None:
    interrupt = TABLE[State.EXECUTING, Event.INTERRUPTED]
    decide(patch, Event.INTERRUPTED, interrupt, State.CANCELING)


@mutation
def ignores_that_the_server_was_lost(patch: Patch) -> None:
    ignore(patch, Event.SERVER_LOST, State.SENDING, State.EXECUTING, *UNWANTED)


@mutation
def forgets_a_lost_goal(patch: Patch) -> None:
    def lose(goal: Facts) -> State:
        canceling.server_lost(goal)
        return State.DONE

    decide(patch, Event.SERVER_LOST, lose, State.EXECUTING)


@mutation
def lets_a_lost_goal_run_on_when_its_server_is_back(patch: Patch) -> None:
    ignore(patch, Event.SERVER_RETURNED, State.LOST)


@mutation
def sends_beside_a_lost_goal_that_wants_the_same_resource(patch: Patch) -> None:
    patch.setattr(Goal, "exclusive", frozenset[str]())


@mutation
def sends_to_a_server_that_may_run_what_was_given_up(patch: Patch) -> None:
    def near(handle: GoalHandle) -> list[GoalHandle]:
        wanted = handle.goal.resources
        return [each for each in real(handle) if each.goal.resources & wanted]

    real = admission.left_near
    patch.setattr(admission, "left_near", near)


@mutation
def looks_only_at_the_goals_of_its_own_node(patch: Patch) -> None:
    real = admission.left_near

    def of_its_own(handle: GoalHandle) -> list[GoalHandle]:
        return [each for each in real(handle) if each.endpoint is handle.endpoint]

    patch.setattr(admission, "left_near", of_its_own)


@mutation
def knows_of_nothing_in_the_way(patch: Patch) -> None:
    patch.setattr(admission, "left_near", lambda handle: [])


@mutation
def leaves_a_lost_goal_to_a_node_that_is_not_shown_its_server(patch: Patch) -> None:
    patch.setattr(handover, "take_over", lambda endpoint, now: None)


@mutation
def adopts_nothing_that_was_left(patch: Patch) -> None:
    patch.setattr(handover, "adopt", lambda endpoint: None)


@mutation
def remembers_nothing_that_is_lost(patch: Patch) -> None:
    def park(endpoint: Any, *, all_of_them: bool = False) -> None:
        original(endpoint, all_of_them=all_of_them)
        endpoint.domain.lost.clear()

    original = handover.park
    patch.setattr(handover, "park", park)


@mutation
def takes_who_is_not_in_sight_yet_for_lost(patch: Patch) -> None:
    patch.setattr(Stalls, "servers_take", lambda self, now: 0.0)


@mutation
def takes_what_has_not_come_in_yet_for_late(patch: Patch) -> None:
    patch.setattr(Stalls, "answers_take", lambda self, now: 0.0)


@mutation
def reports_success_though_it_was_interrupted(patch: Patch) -> None:
    decide(patch, Event.RESULT, running.finished, *UNWANTED)


@mutation
def calls_a_failed_goal_succeeded(patch: Patch) -> None:
    def finished(goal: Facts) -> State:
        goal.detail = 4, goal.detail[1]
        return running.finished(goal)

    decide(patch, Event.RESULT, finished, State.EXECUTING)


@mutation
def believes_that_an_unanswered_goal_never_started(patch: Patch) -> None:
    patch.setattr(Asking, "denied_lately", lambda self, now: True)


@mutation
def asks_to_cancel_only_once(patch: Patch) -> None:
    patch.setattr(Facts, "ask", lambda goal: goal.commands.append(Command.CANCEL))


@mutation
def never_asks_for_the_result(patch: Patch) -> None:
    def on(goal: Goal, event: Event, now: Any, detail: Any = None) -> tuple[Command, ...]:
        commands = original(goal, event, now, detail)
        return tuple(c for c in commands if c is not Command.ASK_RESULT)

    original = Goal.on
    patch.setattr(Goal, "on", on)


@mutation
def runs_on_beside_the_goal_that_replaced_it(patch: Patch) -> None:
    ignore(patch, Event.REPLACED, State.SENDING, State.EXECUTING, *UNWANTED)


@mutation
def takes_preemption_for_a_failure(patch: Patch) -> None:
    patch.setattr(driver, "_rival_sent", lambda handle: False)


@mutation
def sends_what_replaces_a_goal_beside_the_request_of_that(patch: Patch) -> None:
    patch.setattr(admission, "_may_overtake", lambda handle: False)


@mutation
def does_not_hear_feedback(patch: Patch) -> None:
    ignore(patch, Event.FEEDBACK, State.EXECUTING)


@mutation
def loses_time_when_the_clock_jumps_back(patch: Patch) -> None:
    patch.setattr(Deadlines, "follow", lambda self, now: None)


@mutation
def grants_what_is_taken(patch: Patch) -> None:
    def request(table: Any, holder: Any, names: frozenset[str], busy: Busy) -> Event:
        table._held[holder] = names
        return Event.GRANTED

    patch.setattr(Resources, "request", request)


@mutation
def lets_a_later_one_overtake_in_the_queue(patch: Patch) -> None:
    def release(table: Any, holder: Any) -> list[Any]:
        table._queue = dict(reversed(table._queue.items()))
        return original(table, holder)

    original = Resources.release
    patch.setattr(Resources, "release", release)


@mutation
def forgets_who_waits(patch: Patch) -> None:
    def release(table: Any, holder: Any) -> list[Any]:
        table._held.pop(holder, None)
        table._queue.pop(holder, None)
        return []

    patch.setattr(Resources, "release", release)


@mutation
def says_gone_for_every_end(patch: Patch) -> None:
    def close(goal: Facts) -> State:
        state = canceling.finished(goal)
        goal.end = End.SERVER_GONE
        return state

    decide(patch, Event.RESULT, close, State.CANCELING)


def forget(deadline: Event) -> Callable[[Patch], None]:
    """Return the mutation that never arms this deadline."""

    def make(patch: Patch) -> None:
        def arm(deadlines: Deadlines, event: Event, seconds: float | None) -> None:
            if event is not deadline:
                original(deadlines, event, seconds)

        original = Deadlines.arm
        patch.setattr(Deadlines, "arm", arm)

    return make


for _deadline in (each for each in Event if each.name.endswith("_DUE") and "LOOK" not in each.name):
    MUTATIONS[f"forgets {_deadline.name}"] = forget(_deadline)


@pytest.mark.parametrize("wrong", MUTATIONS)
def test_the_generator_finds_a_machine_that(wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    MUTATIONS[wrong](monkeypatch)
    seed = first_broken(range(ENOUGH))
    assert seed is not None, f"{ENOUGH} histories do not show that it {wrong}"
    monkeypatch.undo()
    assert broken(random_history(seed)) is None, "the right machine passes the same history"


OF_CROWDS: dict[str, tuple[Any, str, Callable[..., Any]]] = {
    "believes two of three": (replies, "_answers_wanted", lambda watch: 2),
    "waits for who is not there": (replies, "_answers_wanted", lambda watch: 3),
    "takes any answer for all": (replies.Replies, "_may_be_at_two", lambda self, watch: False),
    "hears the first of two acceptances": (
        endpoint,
        "_ended_answered",
        lambda endpoint, *answer: None,
    ),
    "forgets what has ended": (driver, "_keep_ended", lambda handle: None),
}


@pytest.mark.parametrize("mistake", list(OF_CROWDS))
def test_the_histories_of_crowds_find_who(monkeypatch: pytest.MonkeyPatch, mistake: str) -> None:
    where, name, instead = OF_CROWDS[mistake]
    monkeypatch.setattr(where, name, instead)
    assert first_broken(range(CROWDS_ENOUGH), CrowdPlay, crowded_history) is not None


def test_a_broken_history_shrinks_to_one_that_is_still_broken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("bt_actions.goals.facts.Facts.release", lambda self: None)
    seed = first_broken(range(100))
    assert seed is not None
    found = random_history(seed)
    short = shrink(found)
    assert len(short.moves) <= 2 < len(found.moves)
    assert broken(short) == "a goal that is DONE has given its resources back"
    assert "BROKEN" in tell(short)
