"""A server that runs, and that our node is not shown any more, is found by a new participant.

Nothing here is stopped or cut: the node is made blind on purpose. tests/scenarios/test_server.py
has the real thing, which Fast DDS does to a node in about every second trial.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

from bt_actions import End, MoveRobot, Outcome, Timeouts, TreeRunner
from bt_actions.ros import node_participant, rediscovery
from bt_actions.ros.graph import enclave
from bt_actions.ros.host import host as process
from bt_actions.ros.rediscovery import SecondParticipant
from bt_actions.servers.stalls import Stalls
from bt_actions.traffic import route
from tests.support.trees import in_turn, started
from tests.support.waiting import until

PARTS = ["send_goal", "cancel_goal", "get_result", "feedback", "status"]
Blind = Callable[[MoveRobot], None]
now = time.monotonic


@pytest.fixture
def blind(monkeypatch: pytest.MonkeyPatch, node: Any) -> Blind:
    """Make a leaf's node blind to its server, from now on, so that neither hears the other."""

    def blind(leaf: MoveRobot) -> None:
        client = leaf._own.transport
        monkeypatch.setattr(client, "servers", frozenset)
        monkeypatch.setattr(client, "ready", lambda: False)
        client._on_close(client)  # nobody waits for it
        monkeypatch.setattr(client, "_on_close", lambda _: None)
        monkeypatch.setattr(client, "take_data", lambda: None)
        monkeypatch.setattr(client, "cancel", lambda _: None)

    return blind


@pytest.fixture(autouse=True)
def nothing_else_is_missed(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """What the tests before this have lost is not looked for meanwhile."""
    misses = route.misses
    monkeypatch.setattr(route, "misses", lambda which: which.name == name and misses(which))
    until(nobody_looks, 10.0)


def nobody_looks() -> bool:
    """Nobody has anything to look for."""
    return not any(each._missing for each in rediscovery._by_domain.values())


def test_what_runs_out_of_sight_is_canceled_and_the_next_goal_succeeds(
    serve: Any, name: str, node: Any, blind: Blind
) -> None:
    journal = serve()
    first = MoveRobot("first", 40.0, action_name=name)
    second = MoveRobot("second", 0.3, action_name=name, timeout=Timeouts(server=20.0))
    with started(in_turn(first, second), node=node) as runner:
        until(lambda: first.progress().feedback is not None)
        blind(first)
        until(lambda: first.outcome)
        assert (first.outcome, first.history[0].end) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert runner.wait(20.0)
        assert (second.outcome, first.end) == (Outcome.SUCCEEDED, End.CANCELED)
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
    until(nobody_looks)
    until(
        lambda: not any(each._participants for each in rediscovery._by_domain.values()),
        what="the participant is taken away with its last line",
    )


@pytest.mark.parametrize(
    "canceled",
    [
        pytest.param(False, id="it ends", marks=pytest.mark.chaos),
        pytest.param(True, id="it is canceled"),
    ],
)
def test_who_is_not_heard_after_a_stall_hears_of_its_goal_all_the_same(
    serve: Any, name: str, node: Any, monkeypatch: pytest.MonkeyPatch, canceled: bool
) -> None:
    """What the node asks gets lost, and what it is told, though the server is in sight."""
    monkeypatch.setattr(process, "stalls", Stalls())  # that of the tests is none
    journal = serve()
    leaf = MoveRobot("m", 60.0 if canceled else 4.0, action_name=name, timeout=Timeouts(cancel=2.0))
    with started(leaf, node=node) as runner:
        until(lambda: leaf.progress().feedback is not None)
        client = leaf._own.transport
        with process.lock:
            for request in ("cancel", "ask_result"):
                monkeypatch.setattr(client, request, lambda *_: client.reachability.asked(now()))
            monkeypatch.setattr(client, "take_data", lambda: None)
            client._on_close(client)  # nobody waits for it
            monkeypatch.setattr(client, "_on_close", lambda _: None)
            monkeypatch.setattr(process.stalls, "_due", process.stalls._idle(now()) - 5.0)
        if canceled:
            runner.interrupt()
        runner.wait(40.0)
        assert leaf.end is (End.CANCELED if canceled else End.SUCCEEDED)
        assert leaf._own.transport is not client
    assert journal.ends() == ["canceled" if canceled else "succeeded"]
    until(nobody_looks)


def _domain(node: Any) -> Any:
    return process.domain(node.context.get_domain_id())


def test_an_action_that_had_a_server_once_is_looked_for(
    serve: Any, name: str, node: Any, blind: Blind, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also by an endpoint that is newer than the loss, where no other endpoint saw it."""
    serve()
    monkeypatch.setattr(_domain(node), "ever_lost_sight", False)
    for again in (False, True):
        leaf = MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(server=20.0))
        leaf.setup(node=node)
        if again:
            blind(leaf)
        with TreeRunner(leaf, node=node) as runner:
            runner.run(30.0)
        assert leaf.outcome is Outcome.SUCCEEDED


@pytest.mark.parametrize("flag", ["--enclave", "-e"])
def test_a_look_is_taken_in_the_enclave_of_the_node_that_misses_something(
    name: str, domain: int, monkeypatch: pytest.MonkeyPatch, flag: str
) -> None:
    """Here, that of arguments which are not the program's."""
    from rclpy.context import Context
    from rclpy.node import Node

    enclaves = list[str]()
    monkeypatch.setattr(node_participant, "look_for", lambda *to: enclaves.append(to[2]))
    context = Context()
    context.init(args=["--ros-args", flag, "/kitchen/robot"], domain_id=domain)
    leaf, secure = MoveRobot("m", 0.1, action_name=name), Node("secure", context=context)
    leaf.setup(node=secure)
    with process.lock:
        leaf._own.participant.seek(leaf._own)
    sight = SecondParticipant(domain, enclaves[0])
    assert {enclave(secure), enclave(sight.node)} == {"/kitchen/robot"}
    sight.close()
    leaf.shutdown()
    secure.destroy_node()
    assert enclave(secure) == "/", "it is gone"
    context.shutdown()


@pytest.mark.parametrize("parts", [PARTS[:1], PARTS], ids=["one", "all"])
def test_where_a_part_of_the_names_is_remapped_nobody_looks(
    parts: list[str], name: str, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A participant without the rules would find another robot."""
    from rclpy.context import Context
    from rclpy.node import Node

    context = Context()
    rules = [f"{name}/_action/{part}:={name}/base/_action/{part}" for part in parts]
    words = [word for rule in rules for word in ("-r", rule)]
    context.init(args=["--ros-args", *words], domain_id=domain)
    remapped = Node("remapped", context=context)
    leaf = MoveRobot("m", 0.1, action_name=name)
    leaf.setup(node=remapped)
    looked_for = list[Any]()
    monkeypatch.setattr(
        node_participant, "look_for", lambda seeker, *_: looked_for.append(seeker.name)
    )
    with process.lock:
        leaf._own.participant.seek(leaf._own)
    assert looked_for == ([f"{name}/base"] if parts == PARTS else [])
    leaf.shutdown()
    remapped.destroy_node()
    context.shutdown()
