"""When a line takes its server for deaf, and which way to it it prefers.

Asked of one decision at a time, with stand-ins for what is around it; tests/ros/test_lookout.py
moves real lines, and tests/scenarios real processes that were stopped.
"""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from bt_actions.goals.terms import Event, State
from bt_actions.servers.presence import LEASE, Server
from bt_actions.servers.reachability import DOUBT_LASTS, MUTE_AFTER, NEVER, Reachability
from bt_actions.servers.stalls import ANSWERS_TAKE, Stalls
from bt_actions.traffic import alarm
from bt_actions.traffic import route as module
from bt_actions.traffic.route import Route
from bt_actions.traffic.shared import Domain


def way_of(client: Any, state: Server = Server.READY) -> Route:
    """The way of a line that does nothing, with this client, to a server in this state."""
    resolves = SimpleNamespace(
        resolve_topic_name=lambda name: name, resolve_service_name=lambda name: name
    )
    line: Any = SimpleNamespace(
        name="/move",
        client=client,
        traffic=SimpleNamespace(node=resolves, long_stalls=alarm.stalls.long_times),
        watch=SimpleNamespace(state=lambda _: state),
        orphaned=False,
        pump=lambda: None,
        probe=lambda: client.probe(1, b""),
    )
    return Route(line)


def after_a_standstill(monkeypatch: pytest.MonkeyPatch, state: Server = Server.READY) -> Route:
    """The same, where this process has just stood still from second 10 to second 16."""
    still = Stalls()
    monkeypatch.setattr(alarm, "stalls", still)
    way = way_of(SimpleNamespace(reachability=Reachability()), state)
    still.lives(10.0)
    still.lives(16.0)
    return way


@pytest.mark.parametrize("heard", ["it alone", "both", "nobody"])
def test_a_client_is_preferred_where_it_is_heard_and_our_own_is_not(
    monkeypatch: pytest.MonkeyPatch, heard: str
) -> None:
    """A busy server answers nobody."""
    moment = 100.0
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: moment))
    own, trial = Reachability(), Reachability()
    asked: list[Reachability] = []

    def client(reachability: Reachability, hears: bool) -> Any:
        def probe(_: int, __: bytes) -> None:
            asked.append(reachability)
            reachability.asked(moment)
            if hears:
                reachability.answered(moment)

        return SimpleNamespace(reachability=reachability, pump=lambda: None, probe=probe)

    way = way_of(client(own, heard == "both"))
    own.asked(moment)
    other = client(trial, heard != "nobody")
    trial.doubt(moment)
    assert not way.prefers(other), "it is too early"
    preferred = False
    for _ in range(60):
        moment += 0.1
        preferred = preferred or way.prefers(other)
    assert preferred is (heard == "it alone")
    assert asked.count(trial) == 1
    assert asked.count(own) == (heard != "nobody")


def test_who_is_not_heard_is_looked_for_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a doubt; and when there is none, in its turn."""
    found: list[bool] = []
    monkeypatch.setattr(module, "look_for", lambda *_, at_once: found.append(at_once))
    reachability = Reachability()
    way = way_of(SimpleNamespace(reachability=reachability))
    line: Any = way._endpoint
    line.traffic.seen_since, line.traffic.domain = 0.0, Domain(0)
    line.name, line.action_type, line.users, line.orphaned = "/move", None, 1, False
    line.goals = {b"": SimpleNamespace(goal=SimpleNamespace(state=State.EXECUTING))}
    now = time.monotonic()
    way.seek(now)
    reachability.doubt(now - MUTE_AFTER)
    way.seek(now)
    reachability.doubt(now - DOUBT_LASTS)
    way.seek(now)
    assert found == [True, False]


def test_who_moves_gives_its_goals_time_and_has_them_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The server may be shown later there than another one of its name."""
    monkeypatch.setattr(alarm, "wake_by", lambda _: None)
    told: list[Any] = []

    def handle(*sent_to: bytes) -> Any:
        goal = SimpleNamespace(hold=lambda seconds, _: told.append(seconds))
        replies = SimpleNamespace(sent_to=frozenset(sent_to))
        return SimpleNamespace(goal=goal, replies=replies, not_gone_before=NEVER)

    here, nowhere = handle(b"seen"), handle()
    way = way_of(SimpleNamespace(reachability=Reachability(), closed=False))
    line: Any = way._endpoint
    line.watch.gids, line.goals = frozenset({b"seen"}), {b"1": here, b"2": nowhere}
    line.traffic.clocks = SimpleNamespace(now=lambda: None)
    line.tell = lambda handle, event: told.append((handle, event))
    line.close, line.open = way.leave, lambda client: told.append(client)
    trial: Any = SimpleNamespace(on_trial=True)
    sight: Any = SimpleNamespace(users=set())
    now = time.monotonic()
    way.move_to(sight, trial)
    changed = Event.SERVER_CHANGED
    assert told == [trial, ANSWERS_TAKE, (here, changed), ANSWERS_TAKE, (nowhere, changed)]
    assert not trial.on_trial
    assert (way.second, sight.users) == (sight, {way})
    assert here.not_gone_before >= now + LEASE
    assert nowhere.not_gone_before == NEVER


def test_a_client_on_trial_tells_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """Feedback would come twice; and its questions, of which none is the line's, are answered."""
    made = SimpleNamespace(reachability=Reachability(), on_trial=False)
    monkeypatch.setattr(module, "ActionClient", lambda *_: made)
    way = way_of(SimpleNamespace(reachability=Reachability()))
    way._endpoint.action_type = None
    assert way.client_in(SimpleNamespace(node=None)) is made  # type: ignore[arg-type]
    assert made.on_trial
    assert made.reachability.in_doubt(time.monotonic())


def test_who_has_no_node_any_more_has_no_other_way_and_no_doubt(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else a drain that nobody answers would not end: there is no look that ends the doubt."""
    way = after_a_standstill(monkeypatch)
    assert way.in_doubt(16.0)
    way._endpoint.orphaned = True
    assert not way.in_doubt(16.0)


def test_a_doubt_ends_though_nobody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    way = after_a_standstill(monkeypatch)
    assert way.in_doubt(16.0)
    assert not way.in_doubt(16.0 + DOUBT_LASTS)


def test_a_standstill_that_no_look_has_seen_yet_is_a_doubt(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In the user's callable that makes the goal, say: it is not sent before somebody has asked."""
    still = Stalls()
    monkeypatch.setattr(alarm, "stalls", still)
    client: Any = SimpleNamespace(reachability=Reachability())
    still.lives(10.0)
    way = way_of(client)
    assert not way.in_doubt(10.0)
    still.lives(16.0)
    assert way.in_doubt(16.0)
    assert way.wants_question(16.0)
    assert way.in_doubt(16.0) == DOUBT_LASTS, "until it is answered"
    client.reachability.answered(16.0)
    assert not way.in_doubt(16.0)


def test_a_line_that_is_made_later_may_be_deaf_as_its_participant_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is known since before the stall; another node's goals kept the alarm awake."""
    way = after_a_standstill(monkeypatch)
    assert way.in_doubt(16.0)
    way._endpoint.client = SimpleNamespace(reachability=Reachability())  # type: ignore[assignment]
    later = Route(way._endpoint)
    assert later.in_doubt(16.0)
    assert later.wants_question(16.0)


def test_what_is_out_of_sight_is_in_no_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is absent, for which there are other rules."""
    way = after_a_standstill(monkeypatch, Server.ABSENT)
    assert not way.in_doubt(16.0)
    assert not way.wants_question(16.0)
