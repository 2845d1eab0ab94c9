"""What is believed of what servers say of a goal, where there may be more than one."""

from __future__ import annotations

import pytest

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Timeouts
from bt_actions.goals.terms import Event, Now
from bt_actions.servers import replies as replies
from bt_actions.servers.presence import LEASE, NO_SECOND_AFTER, SLOWEST_START, ServerWatch

ONE, OTHER = b"one", b"other"
BOTH = frozenset({ONE, OTHER})
DENIED, CANCELED = 2, 0
SUCCEEDED, ABORTED = (4, "done"), (6, "failed")
CANCELED_END = (5, None)
UNKNOWN = (0, None)


def events(told: replies.Told) -> list[Event]:
    return [] if told is None else [told[0]]


@pytest.fixture
def watch() -> ServerWatch:
    seen = ServerWatch()
    seen.see(0.0, True, frozenset({ONE}))
    return seen


def sent(watch: ServerWatch) -> replies.Replies:
    """Return what is believed of a goal that was sent to who is in sight."""
    goal = Goal(b"1", "move", Timeouts(), Now(0.0, 0.0))
    for event in (Event.GRANTED, Event.SERVER_READY):
        goal.on(event, Now(0.0, 0.0))
    said = replies.Replies(goal)
    said.count_receivers(watch)
    return said


@pytest.fixture
def said(watch: ServerWatch) -> replies.Replies:
    """Of a goal that was sent while a second server opened."""
    watch.see(0.0, True, BOTH)
    return sent(watch)


def alone(watch: ServerWatch) -> float:
    """Let one of the two be dead; return the time."""
    watch.probe_sent(0.0, 1)
    watch.probe_answered(0.0, 1)
    now = SLOWEST_START + NO_SECOND_AFTER
    watch.see(now, True, BOTH)
    assert watch.alone
    return now


def test_one_server_is_believed_at_once(watch: ServerWatch) -> None:
    said = sent(watch)
    assert said.weigh_answer("goal", watch, 0.0, 0.0, [True]) == (Event.ACCEPTED, None)
    assert said.weigh_answer("goal", watch, 0.0, 0.0, [False]) == (Event.REJECTED, None)
    assert said.weigh_answer("cancel", watch, 0.0, 0.0, [DENIED]) == (Event.CANCEL_ANSWERED, DENIED)
    assert said.weigh_answer("result", watch, 0.0, 0.0, [SUCCEEDED]) == (Event.RESULT, SUCCEEDED)
    assert said.weigh_answer("result", watch, 0.0, 0.0, [UNKNOWN]) == (Event.RESULT_UNKNOWN, None)


def test_an_acceptance_is_believed_and_a_second_one_shows_that_it_runs_twice(
    said: replies.Replies, watch: ServerWatch
) -> None:
    assert events(said.weigh_answer("goal", watch, 0.0, 0.0, [True])) == [Event.ACCEPTED]
    assert events(said.weigh_answer("goal", watch, 0.0, 0.0, [True, True])) == [
        Event.SERVER_AMBIGUOUS
    ]
    assert watch.both_live


def test_one_server_that_accepts_twice_is_one_server(watch: ServerWatch) -> None:
    said = replies.Replies(Goal(b"1", "move", Timeouts(), Now(0.0, 0.0)))
    said.sent_to = frozenset({ONE})
    assert said.weigh_answer("goal", watch, 0.0, 0.0, [True, True]) is None
    assert not watch.both_live


def test_what_one_refuses_the_other_may_accept(said: replies.Replies, watch: ServerWatch) -> None:
    assert said.weigh_answer("goal", watch, 0.0, 0.0, [False]) is None
    assert events(said.weigh_answer("goal", watch, 0.0, 0.0, [False, True])) == [Event.ACCEPTED]
    assert said.weigh_answer("goal", watch, 0.0, 0.0, [True, False]) is None
    assert events(said.weigh_answer("goal", watch, 0.0, 0.0, [False, False])) == [Event.REJECTED]


def test_a_refusal_counts_when_the_other_is_dead(said: replies.Replies, watch: ServerWatch) -> None:
    assert said.weigh_answer("goal", watch, 0.0, 0.0, [False]) is None
    assert said.weigh_sight(watch, 0.0) is None
    assert events(said.weigh_sight(watch, alone(watch))) == [Event.REJECTED]


def test_what_one_has_ended_the_other_may_run(said: replies.Replies, watch: ServerWatch) -> None:
    assert said.weigh_answer("result", watch, 0.0, 0.0, [ABORTED]) is None
    assert said.weigh_answer("result", watch, 0.0, 0.0, [ABORTED, UNKNOWN]) == (
        Event.RESULT,
        ABORTED,
    )


def test_what_both_have_ended_was_at_two_servers(said: replies.Replies, watch: ServerWatch) -> None:
    assert said.weigh_answer("result", watch, 0.0, 0.0, [ABORTED]) is None
    told = said.weigh_answer("result", watch, 0.0, 0.0, [ABORTED, SUCCEEDED])
    assert told == (Event.SERVER_AMBIGUOUS, SUCCEEDED)
    assert watch.both_live


def test_an_end_counts_when_the_other_is_dead(said: replies.Replies, watch: ServerWatch) -> None:
    assert said.weigh_answer("result", watch, 0.0, 0.0, [ABORTED]) is None
    assert said.weigh_sight(watch, 0.0) is None
    assert said.weigh_sight(watch, alone(watch)) == (Event.RESULT, ABORTED)


def test_an_end_may_be_that_of_the_one_that_has_gone_since(
    said: replies.Replies, watch: ServerWatch
) -> None:
    assert said.weigh_sight(watch, 0.0) is None
    assert said.weigh_answer("result", watch, 0.0, 0.0, [ABORTED]) is None
    watch.see(1.0, True, frozenset({ONE}))
    assert events(said.weigh_sight(watch, 1.0)) == [Event.SERVER_CHANGED], "ask whoever is left"
    assert said.weigh_answer("result", watch, 1.1, 0.9, [ABORTED]) is None, (
        "asked while both were there"
    )
    assert said.weigh_answer("result", watch, 1.2, 1.1, [SUCCEEDED]) == (Event.RESULT, SUCCEEDED)


def test_what_one_denies_the_other_may_have(said: replies.Replies, watch: ServerWatch) -> None:
    assert said.weigh_answer("cancel", watch, 0.0, 0.0, [DENIED]) is None
    assert said.weigh_answer("cancel", watch, 0.0, 0.0, [DENIED, CANCELED]) == (
        Event.CANCEL_ANSWERED,
        CANCELED,
    )
    assert said.weigh_answer("cancel", watch, 0.0, 0.0, [CANCELED, DENIED]) is None
    assert said.weigh_answer("cancel", watch, 0.0, 0.0, [DENIED, DENIED]) == (
        Event.CANCEL_ANSWERED,
        DENIED,
    )
    assert said.weigh_answer("result", watch, 0.0, 0.0, [UNKNOWN]) is None
    assert events(said.weigh_answer("result", watch, 0.0, 0.0, [UNKNOWN, UNKNOWN])) == [
        Event.RESULT_UNKNOWN
    ]


def test_two_that_live_are_told_of_where_both_may_have_it(
    said: replies.Replies, watch: ServerWatch
) -> None:
    assert said.weigh_sight(watch, 0.0) is None
    watch.two_answered()
    assert events(said.weigh_sight(watch, 0.0)) == [Event.SERVER_AMBIGUOUS]
    said.sent_to = frozenset({ONE})
    assert Event.SERVER_AMBIGUOUS not in events(said.weigh_sight(watch, 0.0)), "it came later"


def test_a_lost_server_is_back_only_when_it_can_be_talked_to(
    said: replies.Replies, watch: ServerWatch
) -> None:
    watch.see(1.0, False, frozenset())
    assert events(said.weigh_sight(watch, 1.0)) == [Event.SERVER_LOST]
    said._goal.on(Event.SERVER_LOST, Now(1.0, 1.0))
    watch.see(2.0, False, BOTH)
    assert said.weigh_sight(watch, 2.0) is None
    watch.see(2.1, True, BOTH)
    assert events(said.weigh_sight(watch, 2.1)) == [Event.SERVER_RETURNED]
    said._goal.on(Event.SERVER_RETURNED, Now(2.1, 2.1))
    assert said.weigh_sight(watch, 2.2) is None


def test_a_successor_that_denies_it_and_is_alone_shows_that_the_server_was_restarted(
    said: replies.Replies, watch: ServerWatch
) -> None:
    said.sent_to = frozenset({ONE})
    said._goal.on(Event.ACCEPTED, Now(0.0, 0.0))
    assert events(said.weigh_sight(watch, 0.0)) == [Event.SERVER_CHANGED]
    assert said.weigh_answer("result", watch, 0.0, 0.0, [UNKNOWN]) is None
    assert events(said.weigh_sight(watch, alone(watch))) == [Event.SERVER_LOST]


@pytest.mark.parametrize("how", ["both answer", "two of three, none dead", "the other has gone"])
def test_a_server_that_was_taken_for_dead_is_back_when_that_was_wrong(
    said: replies.Replies, watch: ServerWatch, how: str
) -> None:
    said.sent_to = frozenset({ONE})
    said._goal.on(Event.ACCEPTED, Now(0.0, 0.0))
    said.weigh_sight(watch, 0.0)
    said.weigh_answer("result", watch, 0.0, 0.0, [UNKNOWN])
    now = alone(watch)
    told(said, said.weigh_sight(watch, now), now)
    assert said._goal.lost
    assert said.weigh_sight(watch, now) is None, "it is still taken for one"
    if how == "both answer":
        watch.probe_answered(now, 1)
        watch.see(now, False, BOTH)
        assert said.weigh_sight(watch, now) is None, "it cannot be talked to"
        watch.see(now, True, BOTH)
    elif how == "two of three, none dead":
        watch.see(now, True, BOTH | {b"third"})
        watch.two_answered()
        assert said.weigh_sight(watch, now) is None, "these may be the other two"
        now += LEASE + 1.0
    else:
        watch.see(now, True, frozenset({ONE}))
    assert events(said.weigh_sight(watch, now)) == [Event.SERVER_RETURNED]
    said._goal.on(Event.SERVER_RETURNED, Now(now, now))
    assert Event.SERVER_LOST not in events(said.weigh_sight(watch, now))


def test_the_status_of_one_of_two_shows_no_end(said: replies.Replies, watch: ServerWatch) -> None:
    assert said.weigh_status(watch, 1.2, 5) == (Event.STATUS, 2)
    said.weigh_sight(watch, 0.0)
    watch.see(1.0, True, frozenset({ONE}))
    said.weigh_sight(watch, 1.0)
    assert said.weigh_status(watch, 1.2, 5) == (Event.STATUS, 2), (
        "it may be that of the one that has gone"
    )
    said.sent_to = frozenset({ONE})
    assert said.weigh_status(watch, 1.2, 5) == (Event.STATUS, 5)


def told(said: replies.Replies, what: replies.Told, now: float) -> list[Event]:
    """Tell the goal, too; return the events."""
    if what is not None:
        said._goal.on(what[0], Now(now, now), what[1])
    return events(what)


def beside_a_newcomer(watch: ServerWatch) -> replies.Replies:
    """Of a goal that one server has; a second one came when it was on its way."""
    said = sent(watch)
    watch.see(0.0, True, BOTH)
    told(said, said.weigh_sight(watch, 0.0), 0.0)
    return said


def test_who_was_in_sight_when_the_server_spoke_has_not_taken_its_place(
    watch: ServerWatch,
) -> None:
    """It was too busy to be heard, accepts, and is too busy again; the newcomer denies the goal."""
    said = beside_a_newcomer(watch)
    now = alone(watch)
    assert told(said, said.weigh_answer("goal", watch, now, now, [True]), now) == [Event.ACCEPTED]
    watch.probe_sent(now, 2)
    watch.probe_answered(now, 2)
    later = now + NO_SECOND_AFTER
    assert said.weigh_answer("result", watch, later, now, [UNKNOWN]) is None
    watch.see(later, True, BOTH)
    assert said.weigh_sight(watch, later) is None
    assert watch.alone_since(later, now), "which would do, had it come later"
    watch.see(later, True, frozenset({OTHER}))
    assert told(said, said.weigh_sight(watch, later), later) == [Event.SERVER_LOST]


def test_what_a_newcomer_denies_the_server_may_still_start(watch: ServerWatch) -> None:
    said = beside_a_newcomer(watch)
    told(said, (Event.INTERRUPTED, None), 0.0)
    assert said.weigh_answer("cancel", watch, 0.2, 0.1, [DENIED]) is None
    assert said.weigh_sight(watch, 0.3) is None
    now = alone(watch)
    watch.probe_sent(now, 2)
    watch.probe_answered(now, 2)
    assert said.weigh_answer("cancel", watch, now, now, [DENIED]) is None
    now += NO_SECOND_AFTER
    assert told(said, said.weigh_sight(watch, now), now) == [Event.SERVER_LOST]
    assert said._goal.end is End.SERVER_GONE, "and not NEVER_STARTED"
