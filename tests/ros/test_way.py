"""When a line takes its server for deaf, and which way to it it prefers.

Asked of one decision at a time, with stand-ins for what is around it; tests/ros/test_lookout.py
moves real lines, and tests/scenarios real processes that were stopped.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bt_actions.hearing import DOUBT_LASTS, Hearing
from bt_actions.ros import alarm
from bt_actions.ros import way as module
from bt_actions.ros.way import Way
from bt_actions.server import Server
from bt_actions.standstill import Standstill


def way_of(client: Any, state: Server = Server.READY) -> Way:
    """The way of a line that does nothing, with this client, to a server in this state."""
    resolves = SimpleNamespace(
        resolve_topic_name=lambda name: name, resolve_service_name=lambda name: name
    )
    line: Any = SimpleNamespace(
        name="/move",
        client=client,
        traffic=SimpleNamespace(node=resolves),
        watch=SimpleNamespace(state=lambda _: state),
        pump=lambda: None,
        probe=lambda: client.probe(1, b""),
    )
    return Way(line)


@pytest.mark.parametrize("heard", ["it alone", "both", "nobody"])
def test_a_client_is_preferred_where_it_is_heard_and_our_own_is_not(
    monkeypatch: pytest.MonkeyPatch, heard: str
) -> None:
    """A busy server answers nobody."""
    moment = 100.0
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: moment))
    own, trial = Hearing(), Hearing()
    asked: list[Hearing] = []

    def client(hearing: Hearing, hears: bool) -> Any:
        def probe(_: int, __: bytes) -> None:
            asked.append(hearing)
            hearing.asked(moment)
            if hears:
                hearing.answered(moment)

        return SimpleNamespace(hearing=hearing, pump=lambda: None, probe=probe)

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


def test_a_standstill_that_no_look_has_seen_yet_is_a_doubt(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In the user's callable that makes the goal, say: it is not sent before somebody has asked."""
    still = Standstill()
    monkeypatch.setattr(alarm, "standstill", still)
    client: Any = SimpleNamespace(hearing=Hearing())
    still.lives(10.0)
    way = way_of(client)
    assert not way.in_doubt(10.0)
    still.lives(16.0)
    assert way.in_doubt(16.0)
    assert way.wants_question(16.0)
    assert way.in_doubt(16.0) == DOUBT_LASTS, "until it is answered"
    client.hearing.answered(16.0)
    assert not way.in_doubt(16.0)


def test_what_is_out_of_sight_is_in_no_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is absent, for which there are other rules."""
    still = Standstill()
    monkeypatch.setattr(alarm, "standstill", still)
    way = way_of(SimpleNamespace(hearing=Hearing()), Server.ABSENT)
    still.lives(10.0)
    still.lives(16.0)
    assert not way.in_doubt(16.0)
    assert not way.wants_question(16.0)
