"""What is on record of a goal (recovery/ledger.py): from before it is sent until its answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from bt_actions import MoveRobot
from bt_actions.goals.terms import Event
from bt_actions.ros.action_transport import RosTransport
from bt_actions.ros.host import host as process
from bt_actions.ros.node_participant import traffic_of
from bt_actions.traffic.driver import tell
from bt_actions.traffic.state import Entry
from tests.support.processes import Host, HostFactory
from tests.support.trees import started, state
from tests.support.waiting import until


class Recorder:
    """In place of the ledger: tells what was done to it, and what was on its way by then."""

    def __init__(self) -> None:
        self.open: dict[bytes, tuple[str, int, frozenset[bytes], bool]] = {}
        self.entered: list[bytes] = []

    def enter(self, goal_id: bytes, entry: Entry) -> None:
        assert entry.accept == 5.0, "as the tree says"
        self.entered.append(goal_id)
        self.open[goal_id] = entry.action, entry.domain, entry.servers, entry.lost

    def __contains__(self, goal_id: bytes) -> bool:
        return goal_id in self.open

    def strike(self, goal_id: bytes) -> None:
        self.open.pop(goal_id, None)


@pytest.fixture
def ledger(monkeypatch: pytest.MonkeyPatch) -> Recorder:
    recorder = Recorder()
    monkeypatch.setattr(process, "record", recorder)
    return recorder


@contextmanager
def losing(host: Host, name: str, node: Any) -> Iterator[MoveRobot]:
    """Run a leaf whose server is killed while it decides, and knows it as lost."""
    journal = host.open(name, "1:delay_accept=60")
    leaf = MoveRobot("m", 0.1, action_name=name)
    with started(leaf, node=node):
        journal.wait_for("received")
        host.kill()
        until(lambda: leaf.outcome is not None, 40.0)
        yield leaf


def test_a_goal_is_on_record_until_it_is_accepted(
    serve: Any, name: str, node: Any, ledger: Recorder
) -> None:
    journal = serve("1:delay_accept=3")
    leaf = MoveRobot("m", 0.5, action_name=name)
    with started(leaf, node=node):
        goal = journal.wait_for("received").goal
        [(goal_id, (action, domain, servers, lost))] = ledger.open.items()
        assert (goal_id.hex(), action, domain) == (goal, name, node.context.get_domain_id())
        assert (len(servers), lost) == (1, False)
        until(lambda: state(leaf) == "EXECUTING")
        assert ledger.open == {}


def test_it_is_on_record_before_it_is_sent(
    serve: Any, name: str, run: Any, ledger: Recorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve()
    seen: list[bool] = []
    real = RosTransport.send

    def send(client: Any, goal_id: bytes, goal: Any) -> None:
        seen.append(goal_id in ledger.open)
        real(client, goal_id, goal)

    monkeypatch.setattr(RosTransport, "send", send)
    run(MoveRobot("m", 0.1, action_name=name))
    assert seen == [True]


def test_a_refusal_takes_it_off(serve: Any, name: str, run: Any, ledger: Recorder) -> None:
    serve("1:reject")
    run(MoveRobot("m", 0.1, action_name=name))
    assert ledger.open == {}
    assert len(ledger.entered) == 1


def test_what_could_not_be_sent_is_taken_off(
    serve: Any, name: str, run: Any, ledger: Recorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve()

    def send(*_: Any) -> None:
        raise RuntimeError("no")

    monkeypatch.setattr(RosTransport, "send", send)
    run(MoveRobot("m", 0.1, action_name=name))
    assert ledger.open == {}
    assert len(ledger.entered) == 1


def test_what_is_not_accounted_for_stays(
    serve: Any, name: str, node: Any, ledger: Recorder
) -> None:
    journal = serve("1:delay_accept=1")
    leaf = MoveRobot("m", 0.1, action_name=name)
    with started(leaf, node=node):
        goal = journal.wait_for("received").goal
        with process.lock:
            [handle] = traffic_of(node).endpoint(leaf.action_type, name).goals.values()
            tell(handle, Event.PARKED)
            tell(handle, Event.ABANDONED)
        assert [goal_id.hex() for goal_id in ledger.open] == [goal]


def test_that_its_server_went_away_is_on_record_and_that_it_is_back(
    new_host: HostFactory, name: str, node: Any, ledger: Recorder
) -> None:
    with losing(new_host(), name, node) as leaf:
        [(*_, lost)] = ledger.open.values()
        assert lost
        with process.lock:
            [handle] = traffic_of(node).endpoint(leaf.action_type, name).goals.values()
            tell(handle, Event.SERVER_RETURNED)
            [(*_, lost)] = ledger.open.values()
            assert not lost
