"""What is believed of a goal that has ended, and turns up at another server."""

from __future__ import annotations

from typing import Any

import pytest

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Timeouts
from bt_actions.goals.terms import Event, Now, State
from bt_actions.servers import replies as replies
from bt_actions.servers.duplicates import DuplicateReplies
from bt_actions.servers.presence import SETTLED_AFTER, SLOWEST_START, ServerWatch

ONE, OTHER, THIRD, NEW = b"one", b"other", b"third", b"new"
AGREED, REFUSED, DENIED, ENDED = 0, 1, 2, 3
"""Answers to a request to cancel."""
SUCCEEDED, CANCELED, ABORTED, UNKNOWN = (4, "done"), (5, None), (6, "failed"), (0, None)
"""Answers to a question for the result."""


def events(told: replies.Told) -> list[Event]:
    return [event for event, _ in told]


class Case:
    """A goal that was sent to some servers, and its duplicate."""

    def __init__(self, *servers: bytes) -> None:
        self.watch = ServerWatch()
        self.sees(0.0, *servers)
        self.goal = Goal(b"1", "move", Timeouts(), Now(0.0, 0.0))
        for event in (Event.GRANTED, Event.SERVER_READY):
            self.goal.on(event, Now(0.0, 0.0))
        self.said = replies.Replies(self.goal)
        self.said.sent(self.watch)

    def sees(self, now: float, *servers: bytes) -> None:
        self.watch.observe(now, True, frozenset(servers))

    def duplicate(self) -> DuplicateReplies:
        """It has turned up at another of the servers in sight, at 1.0."""
        goal = self.goal.duplicate(Now(1.0, 1.0))
        duplicate = DuplicateReplies(goal, self.said, self.said.sent_to)
        self.watch.two_answered()
        duplicate.is_at_another(self.watch, 1.0)
        goal.on(Event.SERVER_RETURNED, Now(1.0, 1.0))
        return duplicate

    def twin_elsewhere(self) -> DuplicateReplies:
        """It may run at those that are out of sight."""
        duplicate = DuplicateReplies(
            self.goal.duplicate(Now(1.0, 1.0)), self.said, self.said.may_run_at(self.watch)
        )
        duplicate.taken_over()
        return duplicate

    def looked(self, duplicate: DuplicateReplies, now: float) -> list[Event]:
        """Let the duplicate take what is in sight, and tell its goal."""
        told = duplicate.looked(self.watch, now)
        for event, detail in told:
            duplicate._goal.on(event, Now(now, now), detail)
        return events(told)

    def taken_by_both(self, *ends: Any) -> None:
        """Both have taken the goal, and these ends are told."""
        self.takes(0.1, self.said.answered(self.watch, 0.1, [True]))
        self.takes(0.1, self.said.answered(self.watch, 0.1, [True, True]))
        self.takes(0.3, self.said.finished(self.watch, 0.3, 0.2, ends))
        assert self.goal.state is State.DONE

    def takes(self, now: float, told: replies.Told) -> None:
        """Tell the goal."""
        for event, detail in told:
            self.goal.on(event, Now(now, now), detail)


@pytest.fixture
def case() -> Case:
    """Of a goal that has succeeded at one of two."""
    case = Case(ONE, OTHER)
    case.goal.end = End.SUCCEEDED
    return case


@pytest.mark.parametrize("answers", [[SUCCEEDED, CANCELED], [CANCELED, SUCCEEDED]])
def test_its_end_is_not_that_which_was_told_before(case: Case, answers: list[Any]) -> None:
    duplicate = case.duplicate()
    assert duplicate.finished(case.watch, 1.1, 0.9, answers) == [], (
        "asked before the other accepted it"
    )
    assert duplicate.finished(case.watch, 1.1, 1.0, [SUCCEEDED]) == [], "the first once more"
    assert duplicate.finished(case.watch, 1.2, 1.0, answers) == [(Event.RESULT, CANCELED)]
    assert duplicate.finished(case.watch, 1.2, 1.0, [CANCELED]) == [(Event.RESULT, CANCELED)]
    assert duplicate.finished(case.watch, 1.2, 1.0, [SUCCEEDED] * 2) == [(Event.RESULT, SUCCEEDED)]


def test_a_status_with_the_end_that_was_told_before_is_none_of_it(case: Case) -> None:
    duplicate = case.duplicate()
    assert duplicate.shown(case.watch, 1.2, 4) == []
    assert duplicate.shown(case.watch, 1.2, 3) == [(Event.STATUS, 3)]
    assert duplicate.shown(case.watch, 1.2, 5) == [(Event.STATUS, 5)], (
        "only the other can have said so"
    )


def test_it_is_lost_when_only_what_was_told_before_is_left(case: Case) -> None:
    duplicate = case.duplicate()
    case.looked(duplicate, 1.1)
    case.sees(1.5, ONE)
    assert case.looked(duplicate, 1.5) == [Event.SERVER_CHANGED], "ask whoever is left"
    told = duplicate.finished(case.watch, 1.6, 1.5, [SUCCEEDED])
    assert events(told) == [Event.SERVER_LOST]
    duplicate._goal.on(Event.SERVER_LOST, Now(1.6, 1.6), told[0][1])
    assert duplicate._goal.end is End.SERVER_GONE
    assert duplicate.finished(case.watch, 1.6, 1.5, [SUCCEEDED]) == []
    assert case.looked(duplicate, 1.7) == []
    case.sees(2.0, ONE, OTHER)
    assert case.looked(duplicate, 2.0) == [Event.SERVER_RETURNED]
    assert duplicate.finished(case.watch, 2.1, 2.0, [SUCCEEDED]) == []
    assert duplicate.finished(case.watch, 2.1, 2.0, [CANCELED]) == [(Event.RESULT, CANCELED)]


def test_where_one_is_a_ghost_it_waits_until_that_is_gone(case: Case) -> None:
    duplicate = case.duplicate()
    case.watch = ServerWatch()
    case.sees(1.0, ONE, OTHER)
    case.watch.probe_sent(1.0, 1)
    case.watch.probe_answered(1.0, 1)
    now = 1.0 + SLOWEST_START + SETTLED_AFTER
    case.sees(now, ONE, OTHER)
    assert case.watch.alone
    assert duplicate.finished(case.watch, now, now, [SUCCEEDED]) == [], "of which of the two?"
    case.sees(now + 20.0, ONE)
    assert events(duplicate.finished(case.watch, now + 20.0, now, [SUCCEEDED])) == [
        Event.SERVER_LOST
    ]


def test_what_its_server_has_forgotten_is_denied_but_not_by_a_newcomer(case: Case) -> None:
    duplicate = case.duplicate()
    told = duplicate.finished(case.watch, 1.2, 1.1, [SUCCEEDED, UNKNOWN])
    assert events(told) == [Event.RESULT_UNKNOWN]
    case.sees(1.3, ONE, OTHER, NEW)
    assert duplicate.finished(case.watch, 1.4, 1.3, [SUCCEEDED, UNKNOWN]) == []
    case.sees(2.0, ONE, NEW)
    assert case.looked(duplicate, 2.0) == [Event.SERVER_CHANGED]
    told = duplicate.finished(case.watch, 2.2, 2.1, [SUCCEEDED, UNKNOWN])
    assert events(told) == [Event.SERVER_LOST], "it was denied by the newcomer"


@pytest.mark.parametrize("said", [AGREED, REFUSED])
@pytest.mark.parametrize("newcomer", [(), (NEW,)])
def test_whoever_is_left_and_has_it_to_cancel_tells_its_end(
    case: Case, said: int, newcomer: tuple[bytes, ...]
) -> None:
    duplicate = case.duplicate()
    case.looked(duplicate, 1.1)
    case.sees(1.5, OTHER, *newcomer)
    case.looked(duplicate, 1.5)
    duplicate.canceled(case.watch, 1.5, 1.5, [said])
    duplicate.canceled(case.watch, 1.5, 1.5, [said, *([DENIED] if newcomer else [])])
    case.looked(duplicate, 1.6)
    assert duplicate.finished(case.watch, 1.7, 1.6, [SUCCEEDED]) == []
    assert case.looked(duplicate, 1.8) == [Event.RESULT]
    assert duplicate._goal.end is End.SUCCEEDED


@pytest.mark.parametrize("asked", [1.4, 1.5])
def test_whoever_has_ended_it_does_not_show_that_it_runs(case: Case, asked: float) -> None:
    """Nor who was asked to cancel it before the other had gone."""
    duplicate = case.duplicate()
    case.looked(duplicate, 1.1)
    case.sees(1.5, ONE)
    case.looked(duplicate, 1.5)
    duplicate.canceled(case.watch, 1.5, asked, [REFUSED if asked < 1.5 else ENDED])
    case.looked(duplicate, 1.6)
    assert events(duplicate.finished(case.watch, 1.7, 1.6, [SUCCEEDED])) == [Event.SERVER_LOST]


def test_who_told_before_and_is_back_is_not_taken_for_who_runs_it(case: Case) -> None:
    duplicate = case.duplicate()
    case.looked(duplicate, 1.1)
    case.sees(2.0, OTHER)
    case.looked(duplicate, 2.0)
    duplicate.canceled(case.watch, 2.1, 2.1, [REFUSED])
    case.looked(duplicate, 2.2)
    assert duplicate.finished(case.watch, 2.3, 2.2, [SUCCEEDED]) == [], (
        "told before it is seen again?"
    )
    case.sees(2.4, ONE, OTHER)
    assert Event.RESULT not in case.looked(duplicate, 2.4)
    assert duplicate.finished(case.watch, 2.5, 2.4, [SUCCEEDED]) == []
    assert Event.RESULT not in case.looked(duplicate, 2.6)
    assert duplicate.finished(case.watch, 2.7, 2.4, [SUCCEEDED, SUCCEEDED]) == [
        (Event.RESULT, SUCCEEDED)
    ]


def test_who_refuses_just_before_it_is_seen_again_is_not_taken_for_who_is_shown(case: Case) -> None:
    duplicate = case.duplicate()
    case.looked(duplicate, 1.1)
    case.sees(2.0, ONE)
    case.looked(duplicate, 2.0)
    duplicate.canceled(case.watch, 2.1, 2.1, [REFUSED])
    case.sees(2.2, ONE, OTHER)
    case.looked(duplicate, 2.2)
    case.sees(3.0, ONE)
    case.looked(duplicate, 3.0)
    assert events(duplicate.finished(case.watch, 3.1, 3.0, [SUCCEEDED])) == [Event.SERVER_LOST]


@pytest.mark.parametrize("end", [CANCELED, SUCCEEDED])
def test_the_end_that_was_told_while_the_other_was_out_of_sight_is_not_the_others(end: Any) -> None:
    case = Case(ONE, OTHER)
    case.takes(0.1, case.said.answered(case.watch, 0.1, [True]))
    case.takes(0.1, case.said.answered(case.watch, 0.1, [True, True]))
    case.sees(0.5, ONE)
    case.takes(0.5, case.said.looked(case.watch, 0.5))
    case.takes(0.7, case.said.finished(case.watch, 0.7, 0.6, [end]))
    duplicate = case.twin_elsewhere()
    assert duplicate.sent_to == {OTHER}
    case.looked(duplicate, 1.5)
    case.sees(2.0, ONE, OTHER)
    assert case.looked(duplicate, 2.0) == [Event.SERVER_RETURNED]
    duplicate.canceled(case.watch, 2.0, 2.0, [ENDED, REFUSED])
    assert duplicate.finished(case.watch, 2.1, 2.0, [end]) == [], "once more"
    assert Event.RESULT not in case.looked(duplicate, 2.2)
    case.sees(3.0, NEW, OTHER)
    case.looked(duplicate, 3.0)
    assert duplicate.finished(case.watch, 3.1, 3.0, [UNKNOWN, end]) == []
    assert case.looked(duplicate, 3.2) == [Event.RESULT], "whoever told it before has gone"


def test_who_refused_before_another_answered_is_not_taken_for_that_one(case: Case) -> None:
    duplicate = case.duplicate()
    case.looked(duplicate, 1.1)
    duplicate.canceled(case.watch, 1.0, 1.0, [REFUSED])
    case.sees(2.0, ONE)
    duplicate.canceled(case.watch, 1.0, 1.0, [REFUSED, ENDED])
    case.looked(duplicate, 2.0)
    assert events(duplicate.finished(case.watch, 2.2, 2.1, [SUCCEEDED])) == [Event.SERVER_LOST]


def test_who_has_told_an_end_does_not_run_it_when_it_is_out_of_sight(case: Case) -> None:
    """The other has taken it, and canceled it, meanwhile."""
    duplicate = case.duplicate()
    duplicate.finished(case.watch, 1.9, 1.8, [CANCELED])
    case.sees(2.0, OTHER)
    assert not duplicate.may_run_at(case.watch)


def test_what_all_in_sight_deny_is_denied(case: Case) -> None:
    """Also by the one that was out of sight when the goal ended."""
    case.sees(0.5, ONE)
    case.said.looked(case.watch, 0.5)
    duplicate = case.twin_elsewhere()
    assert duplicate.sent_to == {OTHER}
    case.sees(2.0, ONE, OTHER)
    case.looked(duplicate, 2.0)
    assert events(duplicate.finished(case.watch, 2.1, 2.0, [UNKNOWN])) == []
    told = duplicate.finished(case.watch, 2.1, 2.0, [UNKNOWN, UNKNOWN])
    assert events(told) == [Event.RESULT_UNKNOWN]


def test_two_ends_that_were_told_are_told_once_more() -> None:
    case = Case(ONE, OTHER, THIRD)
    case.taken_by_both(CANCELED, CANCELED, UNKNOWN)
    duplicate = case.duplicate()
    assert duplicate.finished(case.watch, 1.1, 1.0, [CANCELED]) == []
    assert duplicate.finished(case.watch, 1.1, 1.0, [CANCELED, CANCELED]) == [], "the third runs it"
    assert duplicate.finished(case.watch, 1.1, 1.0, [CANCELED] * 3) == [(Event.RESULT, CANCELED)]


def test_the_twin_of_a_twin_has_a_third_end(case: Case) -> None:
    duplicate = case.duplicate()
    case.sees(2.0, ONE, OTHER, THIRD)
    duplicate.finished(case.watch, 1.9, 1.8, [CANCELED])
    third = DuplicateReplies(duplicate._goal.duplicate(Now(2.0, 2.0)), duplicate, duplicate.sent_to)
    third.is_at_another(case.watch, 2.0)
    assert third.finished(case.watch, 2.1, 2.0, [SUCCEEDED, CANCELED]) == []
    told = third.finished(case.watch, 2.1, 2.0, [CANCELED, ABORTED, SUCCEEDED])
    assert told == [(Event.RESULT, ABORTED)]
    assert third.shown(case.watch, 1.2, 5) == [], "by the second"


def test_two_more_that_take_it_have_to_tell_two_ends() -> None:
    case = Case(ONE, OTHER, THIRD)
    case.goal.end = End.SUCCEEDED
    duplicate = case.duplicate()
    told = duplicate.answered(case.watch, 2.0, [True, True, True])
    assert events(told) == [Event.SERVER_AMBIGUOUS]
    assert duplicate.finished(case.watch, 2.1, 2.0, [SUCCEEDED, CANCELED]) == []
    assert duplicate.shown(case.watch, 1.2, 5) == [], "of one of the two"
    told = duplicate.finished(case.watch, 2.1, 2.0, [SUCCEEDED, CANCELED, ABORTED])
    assert told == [(Event.RESULT, ABORTED)]


def test_who_has_refused_it_tells_no_end() -> None:
    case = Case(ONE, OTHER, THIRD)
    duplicate = case.duplicate()
    duplicate.answered(case.watch, 1.1, [False, True, True])
    assert duplicate.finished(case.watch, 1.3, 1.2, [UNKNOWN, CANCELED]) == [], "the third runs it"
    told = duplicate.finished(case.watch, 1.3, 1.2, [UNKNOWN, CANCELED, ABORTED])
    assert told == [(Event.RESULT, ABORTED)]


@pytest.mark.parametrize(
    "word",
    [
        lambda duplicate, watch: duplicate.answered(watch, 2.1, [True, True]),
        lambda duplicate, watch: duplicate.canceled(watch, 2.1, 2.0, [DENIED, REFUSED]),
        lambda duplicate, watch: duplicate.shown(watch, 2.1, 2)[:1],
        lambda duplicate, watch: duplicate.lives(watch, 2.1),
    ],
    ids=["accepts", "refuses to cancel", "status", "feedback"],
)
def test_another_has_it_too_while_the_one_that_may_run_it_is_out_of_sight(word: Any) -> None:
    case = Case(ONE, OTHER, THIRD)
    case.goal.end = End.SUCCEEDED
    case.sees(0.5, ONE, THIRD)
    case.said.looked(case.watch, 0.5)
    duplicate = case.twin_elsewhere()
    assert duplicate.sent_to == {OTHER}
    case.looked(duplicate, 1.5)
    assert events(word(duplicate, case.watch)) == [Event.SERVER_RETURNED]
    assert duplicate.sent_to == {ONE, OTHER, THIRD}
    duplicate._goal.on(Event.SERVER_RETURNED, Now(2.1, 2.1))
    told = duplicate.finished(case.watch, 2.3, 2.2, [SUCCEEDED, CANCELED])
    assert told == [(Event.RESULT, CANCELED)]
    assert duplicate.may_run_at(case.watch) == {OTHER}, "whose end has not been told yet"


def test_what_is_gone_may_have_it_though_all_in_sight_deny_it() -> None:
    case = Case(ONE, OTHER, THIRD)
    case.goal.end = End.SUCCEEDED
    duplicate = case.duplicate()
    case.sees(2.0, ONE, OTHER)
    assert case.looked(duplicate, 2.0) == [Event.SERVER_CHANGED]
    assert duplicate.finished(case.watch, 2.2, 2.1, [SUCCEEDED]) == []
    assert events(duplicate.finished(case.watch, 2.2, 2.1, [SUCCEEDED, UNKNOWN])) == [
        Event.SERVER_LOST
    ]
    assert duplicate.sent_to == {THIRD}


def test_the_end_of_the_one_server_there_is_told_once() -> None:
    """Its acceptance came after the result, and when another server had opened."""
    case = Case(ONE)
    case.goal.end = End.SUCCEEDED
    case.sees(1.0, ONE, NEW)
    duplicate = case.duplicate()
    case.sees(2.0, ONE)
    case.looked(duplicate, 2.0)
    duplicate.sent_to = frozenset({ONE})
    assert events(duplicate.finished(case.watch, 2.2, 2.1, [SUCCEEDED])) == [Event.RESULT_UNKNOWN]


def test_what_was_asked_before_one_left_counts_for_nothing(case: Case) -> None:
    duplicate = case.duplicate()
    case.looked(duplicate, 1.1)
    case.sees(1.5, OTHER)
    duplicate.canceled(case.watch, 1.6, 1.4, [REFUSED])
    assert duplicate.finished(case.watch, 1.6, 1.4, [SUCCEEDED]) == []
    case.looked(duplicate, 1.7)
    told = duplicate.finished(case.watch, 1.9, 1.8, [SUCCEEDED])
    assert events(told) == [Event.SERVER_LOST], "nobody has said that it runs"


def test_three_that_accept_what_one_had_ended_tell_two_ends() -> None:
    case = Case(ONE, OTHER, THIRD)
    case.goal.end = End.SUCCEEDED
    case.sees(0.5, ONE)
    case.said.looked(case.watch, 0.5)
    duplicate = case.twin_elsewhere()
    case.sees(1.5, ONE, OTHER, THIRD)
    assert events(duplicate.answered(case.watch, 1.6, [True] * 3)) == [Event.SERVER_RETURNED]
    duplicate._goal.on(Event.SERVER_RETURNED, Now(1.6, 1.6))
    assert duplicate.finished(case.watch, 1.8, 1.7, [SUCCEEDED, CANCELED]) == []


def test_a_status_instead_of_an_end_is_a_status(case: Case) -> None:
    duplicate = case.duplicate()
    assert duplicate.finished(case.watch, 1.6, 1.4, [UNKNOWN, (2, None)]) == [(Event.STATUS, 2)]


def test_of_three_that_took_it_two_are_left_to_tell() -> None:
    case = Case(ONE, OTHER, THIRD)
    case.goal.end = End.SUCCEEDED
    duplicate = case.duplicate()
    duplicate.answered(case.watch, 2.0, [True] * 3)
    told = duplicate.finished(case.watch, 2.1, 2.0, [SUCCEEDED, CANCELED, UNKNOWN])
    assert told[-1] == (Event.RESULT, CANCELED)


def test_where_one_says_that_it_runs_the_twin_has_not_ended(case: Case) -> None:
    duplicate = case.duplicate()
    for answers in ([ABORTED, (2, None)], [(2, None), ABORTED]):
        assert duplicate.finished(case.watch, 2.1, 2.0, answers) == [(Event.STATUS, 2)]
