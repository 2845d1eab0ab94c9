"""What a line makes of words about a goal that has ended: is there a second server that runs it?

With stand-ins for client, watch and node; tests/scenarios/test_server.py does it with real servers.
"""

from __future__ import annotations

import gc
import weakref
from types import SimpleNamespace
from typing import Any

import pytest
from action_msgs.msg import GoalStatus

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Timeouts
from bt_actions.goals.terms import Event, Now
from bt_actions.ros.action_client import GOALS_KEPT
from bt_actions.servers.presence import ServerWatch
from bt_actions.traffic import ended as module
from bt_actions.traffic import endpoint as line_module
from bt_actions.traffic import shared
from bt_actions.traffic.cancel_queue import Cancels
from bt_actions.traffic.ended import QUESTIONS, STALE, Ended, Past
from bt_actions.traffic.endpoint import ActionEndpoint
from bt_actions.traffic.predecessors import Predecessors
from bt_actions.traffic.shared import GoalHandle

GOAL, ONE, OTHER = b"goal", b"one", b"other"
AGREED, REFUSED, DENIED, ENDED = 0, 1, 2, 3
"""Answers to a request to cancel."""
EXECUTING, SUCCEEDED = GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_SUCCEEDED


class OfPast(ActionEndpoint):
    """A line with a goal that ended at 10.0, and was sent to `sent_to`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *sent_to: bytes) -> None:
        said: Any = SimpleNamespace(servers=frozenset(sent_to), is_at_another=lambda *_: None)
        shown: Any = SimpleNamespace(servers=frozenset({ONE}), shown=lambda *_: [])
        duplicate: Any = SimpleNamespace(goal=SimpleNamespace(id=GOAL), replies=shown)
        self.goals = {}
        self.past = Past(self)
        self.predecessors = Predecessors("m")
        self.past._ended[GOAL] = Ended(lambda: None, True, 10.0, duplicate, said)
        self.watch: Any = SimpleNamespace(gids=frozenset({ONE}), two_answered=lambda: None)
        self.watch.heard = lambda _: None
        self.asked: list[bytes] = []
        self.client: Any = SimpleNamespace()
        self.cancels = Cancels()
        self._generation = shared.generation
        self.comes_in_sight: frozenset[bytes] = frozenset()
        self.found: list[Event] = []
        self.now = 10.1
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(module, "alarm", SimpleNamespace(mind=lambda _: None))

    def _observe(self, now: float, *, concludes: bool = True) -> None:
        self.watch.gids |= self.comes_in_sight

    def ask_to_cancel(self, goal_id: bytes) -> None:
        self.asked.append(goal_id)

    def tell(self, handle: Any, event: Event, detail: Any = None, message: Any = None) -> None:
        self.found.append(event)


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> OfPast:
    return OfPast(monkeypatch, ONE, OTHER)


def test_one_servers_acceptance_that_the_result_has_overtaken_is_no_news(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    line = OfPast(monkeypatch, ONE)
    line.goal_answered(GOAL, (True,))
    assert not line.found
    line.past._ended[GOAL].accepted = False
    line.goal_answered(GOAL, (True, True))
    assert not line.found, "twice by one"
    assert line.asked == [GOAL], "or by one that is not shown yet"
    line.goal_answered(GOAL, (True,))
    assert line.found == [Event.SERVER_RETURNED]


def test_the_child_of_a_fork_finds_nothing(line: OfPast) -> None:
    line._generation += 1
    line.goal_answered(GOAL, (True,))
    line.cancel_answered(GOAL, 10.5, (AGREED,))
    assert not line.found


def test_what_may_be_older_than_the_end_is_followed_up_where_there_are_two(line: OfPast) -> None:
    line.statuses_came({GOAL: EXECUTING})
    line.feedback_came(GOAL, None)
    assert line.asked == [GOAL, GOAL]
    assert not line.found
    for _ in range(QUESTIONS):
        line.statuses_came({GOAL: EXECUTING})
    assert len(line.asked) == QUESTIONS, "of a server's ten"


def test_one_server_is_not_asked_what_it_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    line = OfPast(monkeypatch, ONE)
    line.statuses_came({GOAL: EXECUTING})
    assert not line.asked
    line.comes_in_sight = frozenset({OTHER})
    line.statuses_came({GOAL: EXECUTING})
    assert line.asked == [GOAL]


@pytest.mark.parametrize("status", [GoalStatus.STATUS_UNKNOWN, SUCCEEDED])
def test_what_has_ended_is_not_asked_for(line: OfPast, status: int) -> None:
    line.statuses_came({GOAL: status})
    line.now = 10.0 + 2 * STALE
    line.statuses_came({GOAL: status})
    assert not line.asked
    assert not line.found


def test_the_child_of_a_fork_asks_nothing(line: OfPast) -> None:
    line._generation += 1
    line.statuses_came({GOAL: EXECUTING})
    assert not line.asked


def test_a_late_word_of_the_only_server_is_no_news(monkeypatch: pytest.MonkeyPatch) -> None:
    line = OfPast(monkeypatch, ONE)
    line.now = 10.0 + STALE + 0.1
    line.statuses_came({GOAL: EXECUTING})
    assert not line.found


def test_a_refusal_is_no_second_server_that_runs_it(line: OfPast) -> None:
    line.goal_answered(GOAL, (False,))
    assert not line.found


def test_who_has_it_too_lives(line: OfPast) -> None:
    told = list[bool]()
    line.watch.two_answered = lambda: told.append(True)
    line.goal_answered(GOAL, (True,))
    assert told


def test_a_word_long_after_the_end_is_no_older_one(line: OfPast) -> None:
    line.now = 10.0 + STALE + 0.1
    line.statuses_came({GOAL: EXECUTING})
    assert line.found == [Event.SERVER_RETURNED]
    assert line.goals[GOAL] is not None
    assert not line.asked


@pytest.mark.parametrize(
    ("answer", "asked", "found"),
    [
        (AGREED, 10.5, True),
        (REFUSED, 10.5, True),
        (DENIED, 10.5, False),
        (ENDED, 10.5, False),
        (AGREED, 9.9, False),  # before it had ended: that is no news
    ],
)
def test_who_agrees_to_cancel_it_or_refuses_runs_it(
    line: OfPast, answer: int, asked: float, found: bool
) -> None:
    line.cancel_answered(GOAL, asked, (ENDED, answer))
    assert bool(line.found) is found


class Leaf:
    """Whose goals these are."""


NOW = Now(0.0, 0.0)


def ended(line: OfPast, goal_id: bytes, *events: Any, owner: Any = None) -> GoalHandle:
    """Let a goal that was sent have these events, and its line close the book on it."""
    goal = Goal(goal_id, "m", Timeouts(), NOW)
    for event in (Event.GRANTED, Event.SERVER_READY):
        goal.on(event, NOW)
    handle = GoalHandle(goal, line, line.traffic, owner, "leaf")
    handle.replies.sent_to = frozenset({ONE})
    for event, detail in events:
        goal.on(event, NOW, detail)
    line.goals[goal_id] = handle
    line.retire(handle)
    return handle


@pytest.fixture
def keeper(monkeypatch: pytest.MonkeyPatch) -> OfPast:
    """A line on which nothing has ended yet."""
    line = OfPast(monkeypatch, ONE)
    line.past = Past(line)
    line.watch = ServerWatch()
    line.watch.observe(0.0, True, frozenset({ONE}))
    clocks = SimpleNamespace(now=lambda: NOW)
    line.traffic = SimpleNamespace(clocks=clocks, drop_if_unused=lambda _: None)  # type: ignore[assignment]
    line.client.forget = lambda _: None
    monkeypatch.setattr(line_module.alarm, "forget", lambda _: None)
    return line


SUCCESS = ((Event.ACCEPTED, None), (Event.RESULT, (SUCCEEDED, None)))


def test_only_the_newest_goals_are_kept_in_mind(keeper: OfPast) -> None:
    for number in range(GOALS_KEPT + 30):
        ended(keeper, b"%d" % number, *SUCCESS)
    assert len(keeper.past._ended) == GOALS_KEPT


def test_what_has_not_ended_is_not_kept_as_past(keeper: OfPast) -> None:
    ended(keeper, GOAL, (Event.ACCEPTED, None))
    assert not keeper.past._ended


def test_what_is_kept_in_mind_keeps_no_leaf_alive_and_finds_it_if_it_lives(keeper: OfPast) -> None:
    leaf, lives = Leaf(), Leaf()
    gone = weakref.ref(leaf)
    ended(keeper, b"1", *SUCCESS, owner=leaf)
    ended(keeper, b"2", *SUCCESS, owner=lives)
    del leaf
    gc.collect()
    assert gone() is None
    keeper.comes_in_sight = frozenset({OTHER})
    keeper.goal_answered(b"2", (True, True))
    assert keeper.goals[b"2"].owner is lives


def test_of_a_lost_goal_that_is_given_up_nothing_is_waited_for(keeper: OfPast) -> None:
    handle = ended(keeper, GOAL, (Event.SERVER_LOST, "gone"))
    handle.replies.sent_to = frozenset({ONE, OTHER})
    handle.replies._fresh_since = 1.0
    handle.goal.on(Event.PROCESS_EXITING, NOW)
    assert handle.replies.may_run_at(keeper.watch), "one of them is out of sight"
    keeper.goals[GOAL] = handle
    keeper.retire(handle)
    assert not keeper.goals
