"""A server that runs, and that our node is not shown any more, is found by a new participant.

Nothing here is stopped or cut: the node is made blind on purpose. tests/scenarios/test_server.py
has the real thing, which Fast DDS does to a node in about every second trial.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from bt_actions import End, MoveRobot, Outcome, Timeouts, TreeRunner
from bt_actions.ros import line, lookout
from bt_actions.ros.lookout import Sight
from tests.support.trees import in_turn
from tests.support.waiting import holds_for, until

Blind = Callable[[MoveRobot], None]


@pytest.fixture
def blind(monkeypatch: pytest.MonkeyPatch, node: Any) -> Blind:
    """Make a leaf's node blind to its server, from now on, and deaf and dumb."""
    shows = line.publishers

    def blind(leaf: MoveRobot) -> None:
        topic = leaf._line.status_topic
        monkeypatch.setattr(
            line,
            "publishers",
            lambda of, about: frozenset() if of is node and about == topic else shows(of, about),
        )
        client = leaf._line.client
        monkeypatch.setattr(client, "server_is_ready", lambda: False)
        monkeypatch.setattr(client, "add_to_wait_set", lambda _: None)
        monkeypatch.setattr(client, "take_data", lambda: None)
        monkeypatch.setattr(client, "cancel", lambda _: None)

    return blind


def lookouts() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "bt_actions-lookout"]


def test_what_runs_out_of_sight_is_canceled_and_the_next_goal_succeeds(
    serve: Any, name: str, node: Any, blind: Blind
) -> None:
    journal = serve()
    first = MoveRobot("first", 40.0, action_name=name)
    second = MoveRobot("second", 0.3, action_name=name, timeout=Timeouts(server=20.0))
    with TreeRunner(in_turn(first, second), node=node) as runner:
        runner.start()
        until(lambda: first.progress().feedback is not None)
        blind(first)
        until(lambda: first.outcome)
        assert (first.outcome, first.history[0].end) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert runner.wait(20.0)
        assert (second.outcome, first.end) == (Outcome.SUCCEEDED, End.CANCELED)
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
    until(lambda: not lookouts(), what="the participant is taken away with its last line")


def test_a_server_whose_goals_are_all_done_is_found_too(
    serve: Any, name: str, node: Any, blind: Blind, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve()
    monkeypatch.setattr(_domain(node), "lost_sight", True)
    leaf = MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(server=20.0))
    leaf.setup(node=node)
    blind(leaf)
    with TreeRunner(leaf, node=node) as runner:
        runner.run(30.0)
    assert leaf.outcome is Outcome.SUCCEEDED
    until(lambda: not lookouts())


def test_nobody_looks_where_nothing_was_ever_lost(
    name: str, node: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_domain(node), "lost_sight", False)
    leaf = MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(server=1.5))
    with TreeRunner(leaf, node=node) as runner:
        runner.start()
        assert holds_for(lambda: not lookouts(), 1.0)
        runner.wait(5.0)
    assert leaf.outcome is Outcome.SERVER_UNAVAILABLE


def test_a_look_that_cannot_be_taken_is_told_once_and_changes_nothing(
    name: str, node: Any, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def refused(_domain: int) -> Sight:
        raise OSError("no space left")

    monkeypatch.setattr(_domain(node), "lost_sight", True)
    monkeypatch.setattr(lookout, "_lookouts", {})
    monkeypatch.setattr(lookout, "Sight", refused)
    monkeypatch.setattr(lookout, "FIRST_AFTER", 0.01)
    monkeypatch.setattr(lookout, "PAUSE", 0.01)
    leaf = MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(server=1.5))
    with TreeRunner(leaf, node=node) as runner:
        runner.run(5.0)
    assert leaf.outcome is Outcome.SERVER_UNAVAILABLE
    until(lambda: not lookouts())
    assert capfd.readouterr().err.count("no second look for lost servers") == 1


def _domain(node: Any) -> Any:
    from bt_actions.ros.traffic import Traffic

    return Traffic.of(node).domain
