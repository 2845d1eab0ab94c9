"""What every ActionTransport keeps: over rclpy, and on the virtual network.

The same simulated servers stand on both sides of it.
"""

from __future__ import annotations

import itertools
import uuid
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import pytest
from test_msgs.action import Fibonacci, NestedMessage

from bt_actions.goals.terms import (
    CANCEL_ACCEPTED,
    CANCEL_REJECTED,
    CANCEL_UNKNOWN_GOAL,
    STATUS_EXECUTING,
    STATUS_SUCCEEDED,
)
from bt_actions.simulation import Script, ScriptedServer
from bt_actions.testing import VirtualNetwork
from bt_actions.testing.transport import VirtualParticipant
from bt_actions.traffic.state import Participant
from bt_actions.traffic.transport import ActionTransport, Request, nobodys, send_probe
from tests.support.waiting import until

NUMBERS = itertools.count(1)


class World(Protocol):
    """A participant, and what stands around it."""

    participant: Participant
    node: Any
    """What servers stand on."""

    def until(self, condition: Callable[[], Any]) -> None:
        """Let messages travel until something is so."""


class Virtual:
    """The network in virtual time."""

    def __init__(self) -> None:
        self.node = VirtualNetwork()
        self.participant: Participant = VirtualParticipant(self.node, "client", "/")

    def until(self, condition: Callable[[], Any]) -> None:
        """Let time pass."""
        while not condition():
            assert self.node.now() < 60.0
            self.node.timeline.advance(self.node.now() + 0.1)


class Ros:
    """A node that is spun while somebody waits for something."""

    def __init__(self, node: Any) -> None:
        from rclpy.executors import SingleThreadedExecutor

        from bt_actions.ros.node_participant import NodeParticipant

        self.node = node
        self.participant: Participant = NodeParticipant.of(node)
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)

    def until(self, condition: Callable[[], Any]) -> None:
        """Spin."""
        until(condition, meanwhile=lambda: self.executor.spin_once(timeout_sec=0.01))


@pytest.fixture
def virtual() -> World:
    """A network of its own."""
    return Virtual()


@pytest.fixture
def ros(node: Any) -> Iterator[World]:
    """The node of all tests."""
    world = Ros(node)
    yield world
    world.executor.shutdown()
    node.executor = None


@pytest.fixture(params=[pytest.param("ros", marks=pytest.mark.ros), "virtual"])
def world(request: pytest.FixtureRequest) -> World:
    """Each kind of transport there is."""
    world: World = request.getfixturevalue(request.param)
    return world


class Heard:
    """A listener that takes note, in order."""

    def __init__(self) -> None:
        self.told: list[Any] = []
        self.statuses: list[dict[bytes, int]] = []
        self.feedback: list[tuple[bytes, Any]] = []
        self.delivered = 0

    def answer_came(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        if request == "result":
            answers = tuple(status for status, _ in answers)
        self.told.append((request, goal_id, answers))

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        self.feedback.append((goal_id, feedback))

    def statuses_came(self, statuses: dict[bytes, int]) -> None:
        self.statuses.append(statuses)

    def all_delivered(self) -> None:
        self.delivered += 1


class Side:
    """A transport to an action of its own, and the servers of that."""

    def __init__(self, world: World) -> None:
        self.world, self.heard = world, Heard()
        self.name = f"/transport_{next(NUMBERS)}"
        self.transport: ActionTransport = self.open(self.heard)
        self.servers: list[ScriptedServer] = []

    def open(self, heard: Heard) -> ActionTransport:
        return self.world.participant.open_transport(Fibonacci, self.name, heard)

    def serve(self, *faults: str, seconds: float = 0.1) -> ScriptedServer:
        """Open a server more, and wait until it is in sight."""
        written = [f"*:{fault}" for fault in faults]
        script = Script(duration=seconds)
        server = ScriptedServer(self.world.node, Fibonacci, self.name, script, faults=written)
        self.servers.append(server)
        self.world.until(lambda: len(self.transport.servers()) == len(self.servers))
        self.world.until(self.transport.ready)
        return server

    def send(self) -> bytes:
        goal_id = uuid.uuid4().bytes
        self.transport.send(goal_id, Fibonacci.Goal(order=1))
        return goal_id

    def until_told(self, *told: Any) -> None:
        self.world.until(lambda: len(self.heard.told) >= len(told))
        assert self.heard.told == list(told)


@pytest.fixture
def side(world: World) -> Iterator[Side]:
    side = Side(world)
    yield side
    side.transport.close()
    for server in side.servers:
        server.close()


def test_who_is_there_is_in_sight_until_it_goes(side: Side) -> None:
    assert (side.transport.ready(), side.transport.servers()) == (False, frozenset())
    first = side.serve()
    (gid,) = side.transport.servers()
    side.serve()
    assert gid in side.transport.servers()
    assert side.transport.count() == 2
    first.close()
    side.world.until(lambda: side.transport.count() == len(side.transport.servers()) == 1)
    assert gid not in side.transport.servers()


def test_what_is_in_sight_in_its_place_is_told(side: Side, world: World) -> None:
    instead = world.participant.instead
    there = f"/elsewhere{side.name}"
    side.servers.append(ScriptedServer(world.node, Fibonacci, there))
    world.until(lambda: instead(Fibonacci, side.name) == f"; there is {there} of that type")
    other = "; there is one of another type"
    world.until(lambda: instead(NestedMessage, there).startswith(other))


def test_a_goal_is_answered_shown_and_ends(side: Side) -> None:
    side.serve()
    goal_id = side.send()
    side.until_told(("goal", goal_id, (True,)))
    side.transport.ask_result(goal_id)
    side.until_told(("goal", goal_id, (True,)), ("result", goal_id, (STATUS_SUCCEEDED,)))
    shown = lambda: [each[goal_id] for each in side.heard.statuses if goal_id in each]  # noqa: E731
    side.world.until(lambda: STATUS_SUCCEEDED in shown())
    assert STATUS_EXECUTING in shown()
    side.world.until(lambda: len(side.heard.feedback) == 2)
    assert {each for each, _ in side.heard.feedback} == {goal_id}
    assert side.heard.delivered > 0
    assert side.transport.reachability.heard
    assert not side.transport.has_more


def test_a_refusal_and_what_nobody_knows_are_told(side: Side) -> None:
    side.serve("1:reject")
    goal_id = side.send()
    side.until_told(("goal", goal_id, (False,)))
    side.transport.ask_result(goal_id)
    side.until_told(("goal", goal_id, (False,)), ("result", goal_id, (0,)))


@pytest.mark.parametrize(
    ("fault", "code"), [("2:abort", CANCEL_ACCEPTED), ("1:reject_cancel", CANCEL_REJECTED)]
)
def test_an_answer_to_a_cancel_says_what_was_meant(side: Side, fault: str, code: int) -> None:
    side.serve(fault, seconds=30.0)
    goal_id, nobody = side.send(), uuid.uuid4().bytes
    side.until_told(told := ("goal", goal_id, (True,)))
    side.transport.cancel(goal_id)
    side.until_told(told, ("cancel", goal_id, (code,)))
    side.transport.cancel(nobody)
    side.until_told(told, ("cancel", goal_id, (code,)), ("cancel", nobody, (CANCEL_UNKNOWN_GOAL,)))


def test_each_of_two_servers_answers_and_the_answers_add_up(side: Side) -> None:
    side.serve()
    side.serve()
    send_probe(side.transport, 7, 0.0)
    side.until_told(("result", nobodys(7), (0,)), ("result", nobodys(7), (0, 0)))
    side.heard.told.clear()
    goal_id = side.send()
    side.until_told(("goal", goal_id, (True,)), ("goal", goal_id, (True, True)))


def test_of_what_is_forgotten_only_a_further_acceptance_is_told(side: Side) -> None:
    side.serve("1:delay_accept=0.3")
    goal_id = side.send()
    send_probe(side.transport, 7, 0.0)
    side.transport.cancel(goal_id)
    side.transport.forget(goal_id)
    side.transport.forget(nobodys(7))
    side.until_told(("goal", goal_id, (True,)))


def test_beside_another_it_tells_of_no_feedback(side: Side) -> None:
    side.transport.beside_another = True
    side.serve()
    goal_id = side.send()
    side.world.until(lambda: any(goal_id in each for each in side.heard.statuses))
    side.transport.ask_result(goal_id)
    side.until_told(("goal", goal_id, (True,)), ("result", goal_id, (STATUS_SUCCEEDED,)))
    assert side.heard.feedback == []


def test_who_comes_later_is_shown_the_statuses_that_there_are(side: Side) -> None:
    side.serve(seconds=30.0)
    goal_id = side.send()
    side.world.until(lambda: {goal_id: STATUS_EXECUTING} in side.heard.statuses)
    heard = Heard()
    later = side.open(heard)
    side.world.until(lambda: heard.statuses == [{goal_id: STATUS_EXECUTING}])
    later.close()


def test_what_is_closed_tells_nothing(side: Side) -> None:
    side.serve()
    heard = Heard()
    closed = side.open(heard)
    side.world.until(closed.ready)
    goal_id = uuid.uuid4().bytes
    closed.send(goal_id, Fibonacci.Goal())
    assert not closed.closed
    closed.close()
    closed.close()
    assert closed.closed
    send_probe(side.transport, 1, 0.0)
    side.until_told(("result", nobodys(1), (0,)))
    assert heard.told == []
