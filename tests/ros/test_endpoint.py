"""Which goals of other nodes a line takes upon itself, and for how long it leaves them be.

Asked of one decision at a time, with stand-ins for what is around it; tests/scenarios does it with
real servers, and tests/machine with whole histories.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from bt_actions import End, Outcome
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Busy, Timeouts
from bt_actions.goals.terms import (
    CANCEL_UNKNOWN_GOAL,
    STATUS_ABORTED,
    STATUS_SUCCEEDED,
    Event,
    Now,
    State,
)
from bt_actions.servers.presence import PROBES_KEPT, Server, ServerWatch
from bt_actions.servers.stalls import Stalls
from bt_actions.traffic import alarm, shared, traffic
from bt_actions.traffic import endpoint as module
from bt_actions.traffic.cancel_queue import Cancels
from bt_actions.traffic.endpoint import (
    BESIDE,
    LEASE,
    SILENT_FOR,
    ActionEndpoint,
)
from bt_actions.traffic.predecessors import Predecessors
from bt_actions.traffic.shared import FEEDBACK_KEPT, LOST_KEPT, GoalHandle, lock
from bt_actions.traffic.traffic import Traffic

OURS, NEW = b"ours", b"new"


def watch(*shown: bytes, answers: int = 0, ready: bool = True) -> ServerWatch:
    seen = ServerWatch()
    for now in (0.0, 2.0):
        seen.observe(now, ready, frozenset(shown))
    if answers > 1:
        seen.two_answered(answers)
    seen.probe_sent(0.0, 1)
    return seen


@pytest.mark.parametrize(
    ("here", "there", "orphaned", "taken"),
    [
        (watch(OURS), watch(), False, True),
        (watch(), watch(), False, False),
        (watch(OURS, NEW), watch(OURS, NEW), False, False),  # lost there: it is taken for a ghost
        (watch(OURS, NEW, answers=2), watch(OURS, NEW), False, True),
        (watch(OURS, NEW, b"newer", answers=2), watch(OURS, NEW, b"newer"), False, False),
        (watch(OURS), watch(OURS, ready=False), False, True),
        (watch(OURS, ready=False), watch(), False, False),
        (watch(OURS), watch(OURS), True, True),  # whose node is gone sees nothing any more
    ],
    ids=[
        "seen here only",
        "not seen",
        "a ghost",
        "no ghost",
        "a ghost beside two",
        "not ready there",
        "not ready here",
        "orphaned",
    ],
)
def test_a_lost_goal_goes_to_who_sees_more_of_its_server(
    here: ServerWatch, there: ServerWatch, orphaned: bool, taken: bool
) -> None:
    line: Any = SimpleNamespace(watch=here)
    other: Any = SimpleNamespace(watch=there, orphaned=orphaned)
    assert ActionEndpoint._sees_more_than(line, other, frozenset({OURS}), 2.0) is taken


def test_a_goal_that_was_left_is_waited_for_as_long_whoever_adopts_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Runners that are made one after the other, each of which ends before the lease does."""
    monkeypatch.setattr(alarm, "mind", lambda _: None)
    handle: Any = SimpleNamespace(
        traffic=None,
        begun_at=time.monotonic(),
        not_gone_before=module.NEVER,
        goal=SimpleNamespace(id=b"1"),
        replies=SimpleNamespace(taken_over=lambda: None),
    )

    def adopt() -> float:
        domain = SimpleNamespace(take_lost=lambda *_: [handle])
        traffic = SimpleNamespace(domain=domain, made_at=time.monotonic())
        line: Any = SimpleNamespace(traffic=traffic, name="/move", action_type=None, goals={})
        ActionEndpoint._adopt(line)
        until: float = handle.not_gone_before
        return until

    began = time.monotonic()
    first = adopt()
    assert first >= began + LEASE
    assert adopt() == first


def look(line: Any, seen: ServerWatch, now: float) -> None:
    """As far as the watch is concerned: then the node is gone."""

    def observe(now: float) -> None:
        seen.observe(now, True, seen.gids)
        raise RuntimeError

    line._looked_like, line._was_away = Server.ABSENT, False
    line.watch, line._observe = seen, observe
    line._take_in = lambda now: ActionEndpoint._take_in(line, now)
    line.traffic, line.route = SimpleNamespace(node=None), SimpleNamespace(fall_back=lambda: True)
    line.client = SimpleNamespace(closed=False)
    ActionEndpoint.look(line, now)


def test_an_answer_that_lies_there_counts_before_a_server_is_called_the_only_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nobody has spun the node since it came."""
    monkeypatch.setattr(module, "is_valid", lambda _: True)
    seen = watch(OURS, NEW)
    seen.probe_answered(0.5, 1)
    line: Any = SimpleNamespace(_look_at=3.0, pump=lambda: seen.probe_answered(3.0, 1))
    look(line, seen, 3.0)
    assert seen.both_live
    assert not seen.alone


@pytest.mark.parametrize(("due", "alone"), [(3.0, True), (2.4, False)])
def test_a_look_that_comes_late_decides_nothing_about_who_is_alone(
    monkeypatch: pytest.MonkeyPatch, due: float, alone: bool
) -> None:
    """The process stood still: what came meanwhile is not in its reader yet."""
    monkeypatch.setattr(module, "is_valid", lambda _: True)
    seen = watch(OURS, NEW)
    seen.probe_answered(0.5, 1)
    line: Any = SimpleNamespace(_look_at=due, pump=lambda: None)
    look(line, seen, 3.0)
    assert seen.alone is alone


def test_a_break_between_two_looks_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """What else comes back with the server is waited for."""
    monkeypatch.setattr(module, "is_valid", lambda _: True)
    monkeypatch.setattr(ActionEndpoint, "_adopt", lambda _: None)
    monkeypatch.setattr(ActionEndpoint, "_take_over", lambda *_: None)
    line: Any = object.__new__(ActionEndpoint)
    domain = SimpleNamespace(lost_sight=False, known=set(), number=1)
    line.traffic = SimpleNamespace(node=None, notify=lambda _: None, domain=domain)
    line.name, line.action_type, line.goals, line.watch = "x", None, {}, ServerWatch()
    line._looked_like, line._was_away, line._held_up = Server.ABSENT, False, (False, False)
    line._look_at, line._warned_crowd = 0.0, False
    shown = frozenset({OURS})
    line.client = SimpleNamespace(closed=False, server_is_ready=lambda: bool(shown))
    line.route = SimpleNamespace(
        shown=lambda: shown,
        wants_question=lambda _: False,
        seek=lambda _: None,
        holds_back=lambda _: False,
    )
    for now in (1.0, 1.2):
        line.look(now)
    assert line.in_sight_since == 1.0
    shown = frozenset()
    line.see()
    shown = frozenset({OURS})
    for now in (1.4, 1.6):
        line.look(now)
    assert line.in_sight_since == 1.4


def test_a_line_without_goals_is_not_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a server that is alone would settle anew for each goal after a pause."""
    monkeypatch.setattr(module, "is_valid", lambda _: True)
    monkeypatch.setattr(alarm, "forget", lambda _: None)
    traffic: Any = SimpleNamespace(drop_if_unused=lambda _: None)
    line: Any = SimpleNamespace(goals={}, _look_at=1.0, traffic=traffic, pump=lambda: None)
    ActionEndpoint.retire(line, SimpleNamespace(goal=SimpleNamespace(id=b"1")))  # type: ignore[arg-type]
    seen = watch(OURS, NEW)
    seen.probe_answered(0.5, 1)
    look(line, seen, 4.0)
    assert seen.alone


@pytest.mark.parametrize(
    ("now", "hidden", "left"),
    [(10.2, 0.0, 2.8), (14.0, 0.0, 2.6), (14.0, 4.0, 3.0)],
    ids=["a look", "a late one", "just after a standstill"],
)
def test_a_server_is_looked_out_for_as_long_as_it_would_be_seen(
    monkeypatch: pytest.MonkeyPatch, now: float, hidden: float, left: float
) -> None:
    still = SimpleNamespace(servers_take=lambda _: hidden)
    monkeypatch.setattr(alarm, "stalls", still)
    handle: Any = SimpleNamespace(goal=SimpleNamespace(lost=True), look_out_left=3.0)
    line: Any = SimpleNamespace(goals={b"1": handle}, _looked_out_at=10.0)
    ActionEndpoint._look_out(line, now)
    assert handle.look_out_left == pytest.approx(left)


def test_no_deadline_counts_the_time_in_which_nothing_is_sent_on_our_account() -> None:
    """Nor does it while the tree is paused, which gives that time back itself."""
    given: list[float] = []
    goal = SimpleNamespace(state=State.WAITING_FOR_SERVER, postpone=given.append)
    handle: Any = SimpleNamespace(goal=goal, kept_since=None)
    holds_back = True
    line: Any = SimpleNamespace(route=SimpleNamespace(holds_back=lambda _: holds_back))
    for now in (1.0, 1.2, 1.5):
        ActionEndpoint._give_back_time(line, handle, now)
    holds_back = False
    ActionEndpoint._give_back_time(line, handle, 1.6)
    ActionEndpoint._give_back_time(line, handle, 9.0)
    assert given == pytest.approx([0.2, 0.3, 0.1])
    goal.state = State.EXECUTING
    ActionEndpoint._give_back_time(line, handle, 9.1)
    assert handle.kept_since is None


def test_the_node_that_adopts_a_goal_tells_that_it_is_accounted_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It was told on another node that it is not."""
    said: list[str] = []
    monkeypatch.setattr(traffic.log, "error", said.append)
    monkeypatch.setattr(traffic.log, "info", said.append)
    clocks = SimpleNamespace(now=lambda: SimpleNamespace(ros=0.0))
    first, next_one = (Traffic.__new__(Traffic) for _ in range(2))
    for each in (first, next_one):
        each.clocks, each._observers = clocks, []  # type: ignore[assignment]
    monkeypatch.setattr(traffic.log, "warning", said.append)
    goal: Any = SimpleNamespace(outcome=Outcome.CANCELED, end=End.UNKNOWN, reason="", state=None)
    goal.cancel_said = "; it refuses"
    handle: Any = SimpleNamespace(goal=goal, told_unknown=False, told_gone=False)
    with lock:
        first.note(handle)
        next_one.note(handle)
        goal.end = End.CANCELED
        next_one.note(handle)
        next_one.note(handle)
        goal.end = End.SERVER_GONE
        next_one.note(handle)
        goal.end = End.UNKNOWN
        next_one.note(handle)
    first_word, last_word, of_its_return = said
    assert "not accounted for" in first_word
    assert "it refuses" in first_word
    assert "accounted for at last" in last_word
    assert "its server is back; canceling it" in of_its_return, "no error: it soon has an end"


def test_a_goal_that_succeeded_was_not_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Any other end may be the doing of a newer goal, whose acceptance it has overtaken."""
    told = list[Event]()
    line: Any = SimpleNamespace(_rival_sent=lambda _: True)
    line.tell = lambda _handle, event, _detail=None: told.append(event)
    ActionEndpoint._pass_on(line, SimpleNamespace(), [(Event.RESULT, (STATUS_SUCCEEDED, None))])  # type: ignore[arg-type]
    assert told == [Event.RESULT]
    ActionEndpoint._pass_on(line, SimpleNamespace(), [(Event.RESULT, (STATUS_ABORTED, None))])  # type: ignore[arg-type]
    assert told[1:] == [Event.REPLACED, Event.RESULT]


def test_a_goal_that_is_accepted_replaces_the_older_ones_and_no_newer() -> None:
    now, told = Now(0.0, 0.0), list[str]()
    goals = [Goal(name.encode(), "m", Timeouts(), now, busy=Busy.REPLACE) for name in "abc"]
    line: Any = SimpleNamespace(goals={}, _carry_out=lambda *_: None)
    line._tell_who_waits = lambda: None
    line.tell = lambda handle, _event, _detail: told.append(handle.name)
    handles = []
    for goal in goals:
        for event in (Event.GRANTED, Event.SERVER_READY):
            goal.on(event, now)
        traffic: Any = SimpleNamespace(note=lambda _: None)
        handles.append(GoalHandle(goal, line, traffic, None, goal.id.decode()))
    holders = SimpleNamespace(holders=lambda _: handles)
    clocks = SimpleNamespace(now=lambda: now)
    line.traffic = SimpleNamespace(clocks=clocks, domain=SimpleNamespace(resources=holders))
    with lock:
        ActionEndpoint._apply(line, handles[1], lambda now: goals[1].on(Event.ACCEPTED, now), None)
    assert told == ["a"]


@pytest.mark.parametrize("changes", [True, False])
def test_who_waits_on_another_node_is_told_when_a_goal_changes(changes: bool) -> None:
    """It may have room at the server now; nobody else would tell it, without a heartbeat."""
    now, woken = Now(0.0, 0.0), list[str]()

    class Stub(SimpleNamespace):
        __hash__ = object.__hash__

    def line_of(traffic: Any, *, waits: bool = True) -> Any:
        return SimpleNamespace(traffic=traffic, route=SimpleNamespace(is_waited_for=lambda: waits))

    def traffic_of(name: str) -> Any:
        return Stub(notify=lambda _: woken.append(name), note=lambda _: None)

    ours, other, idle = traffic_of("ours"), traffic_of("other"), traffic_of("idle")
    ours.clocks = SimpleNamespace(now=lambda: now)
    line: Any = line_of(ours)
    line.goals, line._carry_out = {}, lambda *_: None
    line._tell_who_waits = partial(ActionEndpoint._tell_who_waits, line)
    line.neighbors = lambda: [line, line_of(other), line_of(idle, waits=False)]
    goal = Goal(b"1", "m", Timeouts(), now)
    events = (Event.GRANTED, Event.SERVER_READY, Event.ACCEPTED if changes else Event.REPLACED)
    for event in events[:-1]:
        goal.on(event, now)
    with lock:
        step = partial(goal.on, events[-1], now)
        ActionEndpoint._apply(line, GoalHandle(goal, line, ours, None, "m"), lambda _: step(), None)
    assert sorted(woken) == (["other", "ours"] if changes else [])


@pytest.mark.parametrize(("suspect", "closed"), [(False, [0, 1, 2]), (True, [])])
def test_the_oldest_of_many_lost_goals_are_given_up(suspect: bool, closed: list[int]) -> None:
    """But none that its server may still be deciding on."""
    given_up = list[int]()
    goal = SimpleNamespace(
        end=End.NEVER_STARTED,
        outcome=Outcome.ACCEPT_TIMEOUT,
        unconfirmed=suspect,
        lost=True,
        id=b"",
    )
    handles = {n: SimpleNamespace(number=n, goal=goal) for n in range(LOST_KEPT + 3)}
    line: Any = SimpleNamespace(goals=handles)
    line.tell = lambda handle, _event: given_up.append(handle.number)
    ActionEndpoint._bound_the_lost(line)
    assert given_up == closed


def test_probes_of_long_ago_are_forgotten() -> None:
    forgotten = list[int]()
    client = SimpleNamespace(forget=forgotten.append, probe=lambda *_: None)
    line: Any = SimpleNamespace(watch=ServerWatch(), _last_probes=deque(), client=client)
    for _ in range(PROBES_KEPT + 10):
        ActionEndpoint.probe(line)
    assert len(forgotten) == 10


def test_a_paused_goal_whose_deadline_has_passed_does_not_keep_the_alarm_awake() -> None:
    goal = SimpleNamespace(due_in=lambda _: 0.0)
    handle = SimpleNamespace(goal=goal, paused_at=1.0, accounted_for=True)
    line: Any = SimpleNamespace(_look_at=10.0, orphaned=False, route=SimpleNamespace(second=None))
    line._look_out = lambda _: None
    line.goals, line.traffic = {b"1": handle}, SimpleNamespace(clocks=SimpleNamespace(now=list))
    line.mind, line._bound_the_lost = (lambda _: None), (lambda: None)
    line.cancels = Cancels()
    assert ActionEndpoint.attend(line, 9.9) == pytest.approx(0.1)


def test_a_pause_begins_anew_for_a_goal_whose_turn_comes_in_it() -> None:
    line: Any = SimpleNamespace(is_parents=False, _apply=lambda *_: None)
    handle: Any = SimpleNamespace(paused_at=1.0)
    ActionEndpoint.tell(line, handle, Event.GRANTED)
    assert handle.paused_at > 1.0


def test_what_holds_its_resource_is_not_left_to_whoever_comes_next() -> None:
    told = list[Event]()
    goal = SimpleNamespace(outcome=Outcome.CANCELED, holding=True, lost=False)
    line: Any = SimpleNamespace(goals={b"1": SimpleNamespace(goal=goal)})
    line.tell = lambda _handle, event: told.append(event)
    ActionEndpoint.park(line)
    assert not told


def test_who_has_just_come_in_sight_may_be_followed_by_a_server_that_was_lost() -> None:
    line: Any = SimpleNamespace(in_sight_since=0.0)
    line.shares_server_with, line.has_lost = (lambda _: False), (lambda _: True)
    goal, of_ticket = SimpleNamespace(busy=Busy.WAIT), SimpleNamespace(in_sight_since=9.5)
    handle: Any = SimpleNamespace(goal=goal, endpoint=of_ticket)
    assert ActionEndpoint.may_come_back_for(line, handle, 9.4 + BESIDE)
    assert not ActionEndpoint.may_come_back_for(line, handle, 9.6 + BESIDE)


def test_who_is_alone_is_not_settled_where_this_process_stood_still(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Though the look itself is in time."""
    monkeypatch.setattr(module, "is_valid", lambda _: True)
    still = Stalls()
    still.lives(time.monotonic() - 2.0)
    monkeypatch.setattr(alarm, "stalls", still)
    seen = watch(OURS, NEW)
    seen.probe_answered(0.5, 1)
    look(SimpleNamespace(_look_at=3.0, pump=lambda: None), seen, 3.0)
    assert not seen.alone


class Orphan(ActionEndpoint):
    """A line whose node is gone, with a goal that drains within 100 s; `put`: it was put away."""

    def __init__(self, silent: float, *shown: bytes) -> None:
        goal = SimpleNamespace(outcome=Outcome.CANCELED, drains_within=100.0)
        said: Any = SimpleNamespace(servers=frozenset({OURS}), sent_to=frozenset({OURS}))
        for kind in ("canceled", "finished", "shown", "lives", "answered"):
            setattr(said, kind, lambda *_: [])
        self.goals: Any = {b"1": SimpleNamespace(goal=goal, replies=said, keeps_feedback=False)}
        self.watch = watch(OURS, *shown)
        self.cancels, self._generation = Cancels(), shared.generation
        self.orphaned, self.put = True, False
        self.predecessors = Predecessors("m")
        self._heard_at = time.monotonic() - silent

    def park(self, *, all_of_them: bool = False) -> None:
        self.put = all_of_them

    def tell(self, handle: Any, event: Event, detail: Any = None, message: Any = None) -> None:
        pass


@pytest.mark.parametrize(("silent", "put"), [(SILENT_FOR + 20.0, False), (101.0, True)])
def test_what_an_orphan_drains_it_waits_for(
    monkeypatch: pytest.MonkeyPatch, silent: float, put: bool
) -> None:
    monkeypatch.setattr(alarm, "stalls", Stalls())
    line = Orphan(silent)
    line._orphan()
    assert line.put is put


@pytest.mark.parametrize(
    ("word", "runs"),
    [
        (lambda line: line.cancel_answered(b"1", 0.0, (2,)), False),
        (lambda line: line.result_came(b"1", 0.0, ((0, None),)), False),
        (lambda line: line.cancel_answered(b"1", 0.0, (0,)), True),
        (lambda line: line.result_came(b"1", 0.0, ((2, None),)), True),
        (lambda line: line.statuses_came({b"1": 2}), True),
        (lambda line: line.feedback_came(b"1", None), True),
        (lambda line: line.goal_answered(b"1", (True,)), True),
    ],
    ids=["denies", "knows none", "agrees to cancel", "a result", "a status", "feedback", "accepts"],
)
def test_a_denial_does_not_make_an_orphan_wait_on(
    monkeypatch: pytest.MonkeyPatch, word: Callable[[ActionEndpoint], None], runs: bool
) -> None:
    """It may be the successor's, which goes on denying what its predecessor had."""
    monkeypatch.setattr(alarm, "stalls", Stalls())
    line = Orphan(101.0, NEW)
    word(line)
    line._orphan()
    assert line.put is not runs
    line = Orphan(101.0)
    word(line)
    line._orphan()
    assert not line.put, "where there is no other"


def test_of_feedback_that_no_tick_reads_the_newest_is_kept() -> None:
    line: Any = Orphan(0.0)
    line.traffic = SimpleNamespace(notify=lambda _: None)
    goal = Goal(b"1", "m", Timeouts(), Now(0.0, 0.0))
    handle = line.goals[b"1"] = GoalHandle(goal, line, line.traffic, None, "m", keeps_feedback=True)
    for number in range(2 * FEEDBACK_KEPT):
        line.feedback_came(b"1", number)
    assert list(handle.feedback) == list(range(FEEDBACK_KEPT, 2 * FEEDBACK_KEPT))


def test_an_orphan_finds_out_by_asking_who_lives(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was shown when its node went does not change any more."""
    monkeypatch.setattr(module, "is_valid", lambda _: False)
    monkeypatch.setattr(alarm, "stalls", SimpleNamespace(answers_take=lambda _: 0.0))
    line: Any = object.__new__(ActionEndpoint)
    line.watch, line.orphaned = watch(OURS), True
    line.traffic = SimpleNamespace(node=None, notify=lambda _: None)
    line.watch.observe(2.0, True, frozenset({OURS, NEW}))
    line._heard_at, line._look_at, line._last_probes = time.monotonic(), 0.0, deque()
    line.client = SimpleNamespace(closed=False, probe=lambda probe, _: asked.append(probe))
    line.pump, line.cancels = (lambda: None), Cancels()
    line._generation = shared.generation
    asked, told = list[int](), list[Event]()
    line.tell = lambda _handle, event, _detail=None: told.append(event)
    goal = Goal(b"1", "m", Timeouts(), Now(0.0, 0.0))
    for event in (Event.GRANTED, Event.SERVER_READY, Event.INTERRUPTED):
        goal.on(event, Now(0.0, 0.0))
    handle = GoalHandle(goal, line, line.traffic, None, "leaf")
    handle.replies.sent_to = frozenset({OURS})
    line.goals = {b"1": handle}
    denied = (CANCEL_UNKNOWN_GOAL,)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now))
    now = 2.0
    line.look(now)
    line.cancel_answered(b"1", now, denied)
    for now in (2.5, 3.5, 5.0):
        assert Event.SERVER_LOST not in told
        line.probe_answered(asked[-1])
        line.look(now)
    assert Event.SERVER_LOST in told
