"""The action client: it loses no answer, and it can be read without an executor."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from robot_control_interfaces.action import MoveRobot as MoveRobotAction

from bt_actions import Gripper, MoveRobot
from bt_actions.ros.action_transport import RosTransport
from bt_actions.ros.node_participant import NodeParticipant
from bt_actions.traffic.transport import Request
from tests.support.processes import Host
from tests.support.waiting import until

TIMES = 20


class Heard:
    """A listener that takes note."""

    def __init__(self) -> None:
        self.goals: list[tuple[bytes, bool]] = []
        self.results: list[tuple[bytes, int, Any]] = []
        self.cancels: list[tuple[bytes, int]] = []

    def answer_came(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        told = answers[-1] if request == "result" else (answers[-1],)
        self.answers(request).append((goal_id, *told))

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None: ...

    def statuses_came(self, statuses: dict[bytes, int]) -> None: ...

    def all_delivered(self) -> None: ...

    def answers(self, kind: str) -> list[Any]:
        return {"goal": self.goals, "result": self.results, "cancel": self.cancels}[kind]


class LateFiling:
    """rclpy's low-level client, which returns from sending, so that the request can be filed, when
    the answer has been taken, or after `patience` seconds."""

    def __init__(self, handle: Any, kind: str, patience: float) -> None:
        self._handle = handle
        self._kind = kind
        self._patience = patience
        self._taken = threading.Event()

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._handle, name)
        if name == f"send_{self._kind}_request":
            return self._sending(method)
        if name == f"take_{self._kind}_response":
            return self._taking(method)
        return method

    def __enter__(self) -> Any:
        return self._handle.__enter__()

    def __exit__(self, *error: Any) -> None:
        self._handle.__exit__(*error)

    def _sending(self, send: Callable[[Any], int]) -> Callable[[Any], int]:
        def sending(request: Any) -> int:
            self._taken.clear()
            number = send(request)
            self._taken.wait(self._patience)
            return number

        return sending

    def _taking(self, take: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def taking(kind: Any) -> Any:
            answer = take(kind)
            if answer[1] is not None:
                self._taken.set()
            return answer

        return taking


@pytest.fixture
def heard() -> Heard:
    return Heard()


def transport_to(node: Node, name: str, heard: Heard) -> RosTransport:
    return NodeParticipant.of(node).open_transport(MoveRobotAction, name, heard)


@pytest.fixture
def client(node: Node, host: Host, name: str, heard: Heard) -> Iterator[RosTransport]:
    """A client of a server that is there."""
    client = transport_to(node, name, heard)
    host.open(name)
    until(client.ready)
    yield client
    client.close()
    host.close_server(name)


def request(client: RosTransport, kind: str) -> bytes:
    """Send a request that is answered at once, and return the goal's id."""
    goal_id = uuid.uuid4().bytes
    if kind == "goal":
        client.send(goal_id, MoveRobotAction.Goal(distance=0.0))
    elif kind == "result":
        client.ask_result(goal_id)
    else:
        client.cancel(goal_id)
    return goal_id


@pytest.mark.parametrize("kind", ["goal", "result", "cancel"])
def test_an_answer_that_arrives_before_its_request_is_filed_is_not_lost(
    client: RosTransport, heard: Heard, kind: str
) -> None:
    client.handle = LateFiling(client.handle, kind, patience=0.02)
    asked: list[bytes] = []
    for _ in range(TIMES):
        asked.append(request(client, kind))
        until(lambda: len(asked) - len(heard.answers(kind)) < 8)  # a server's queue holds ten
    until(lambda: len(heard.answers(kind)) == TIMES)
    assert [answer[0] for answer in heard.answers(kind)] == asked


def test_every_answer_reaches_its_goal_when_several_threads_send(
    client: RosTransport, heard: Heard
) -> None:
    asked: list[bytes] = []

    def send() -> None:
        for _ in range(TIMES):
            asked.append(request(client, "result"))
            until(lambda: len(asked) - len(heard.results) < 4)

    threads = [threading.Thread(target=send) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    until(lambda: len(heard.results) == 4 * TIMES)
    assert sorted(result[0] for result in heard.results) == sorted(asked)


def test_answers_are_taken_when_the_context_is_no_longer_valid(
    domain: int, host: Host, name: str, heard: Heard
) -> None:
    """rclpy's SIGINT handler invalidates it; the goals must be canceled all the same."""
    context = Context()
    context.init(domain_id=domain)
    node = Node("dying", context=context)
    client = RosTransport(node, MoveRobotAction, name, heard)
    journal = host.open(name)
    until(client.ready)
    goal_id = uuid.uuid4().bytes
    client.send(goal_id, MoveRobotAction.Goal(distance=5.0))
    until(lambda: heard.goals, meanwhile=client.deliver_arrived)
    context.shutdown()
    client.cancel(goal_id)
    client.ask_result(goal_id)
    until(lambda: heard.results, meanwhile=client.deliver_arrived)
    assert (heard.results[0][:2], journal.ends()) == ((goal_id, 5), ["canceled"])
    client.close()
    node.destroy_node()
    host.close_server(name)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_executor_ends_though_rclpy_does_not_wake_it(domain: int, name: str) -> None:
    """rclpy's handler of SIGTERM shuts a context down in C++, and calls nobody back."""
    context = Context()
    context.init(domain_id=domain)
    node, executor = Node("dying", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    transport_to(node, name, Heard())
    with context.handle:
        context.handle.shutdown()
    until(lambda: not spinning.is_alive())
    node.destroy_node()


def test_a_listener_that_raises_is_told_all_the_same(
    client: RosTransport, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(request: Request, *answer: Any) -> None:
        if request == "cancel":
            raise RuntimeError("on purpose")
        heard.results.append((b"", 0, None))

    with monkeypatch.context() as patch:
        patch.setattr(heard, "answer_came", fails)
        request(client, "cancel")
        request(client, "result")
        until(lambda: heard.results)
        patch.undo()
        request(client, "cancel")
        until(lambda: heard.cancels)


def test_what_cannot_be_taken_keeps_nothing_else_from_being_heard(
    client: RosTransport, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = iter([RuntimeError("not this one")])

    def take_data() -> None:
        for error in taken:
            raise error
        RosTransport.take_data(client)

    monkeypatch.setattr(client, "take_data", take_data)
    request(client, "result")
    until(lambda: heard.results and next(taken, None) is None)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_wait_that_fails_keeps_nobody_waiting(
    client: RosTransport, node: Node, name: str, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    receiver: Any = NodeParticipant.of(node)._receiver
    with monkeypatch.context() as patch:
        patch.setattr(receiver, "_take", lambda _: [][0])
        until(lambda: not receiver._thread.is_alive())
    transport_to(node, f"{name}_2", heard).close()
    request(client, "result")
    until(lambda: heard.results)


def test_a_destroyed_client_is_silent_and_refuses_to_send(
    client: RosTransport, heard: Heard
) -> None:
    request(client, "result")
    client.close()
    client.close()
    heard.results.clear()
    client.deliver_arrived()
    assert not heard.results
    with pytest.raises(Exception, match=r"(?i)destroy|invalid|pointer"):
        request(client, "goal")


def test_clients_come_and_go_while_others_are_waited_for(
    client: RosTransport, node: Node, name: str, heard: Heard
) -> None:
    for number in range(200):
        transport_to(node, f"{name}_{number % 5}", heard).close()
    request(client, "result")
    until(lambda: heard.results)


# Shared per node, name and type


def clients_of(node: Node) -> tuple[Any, ...]:
    return NodeParticipant.of(node)._receiver._members


def test_leaves_with_the_same_action_share_one_client(node: Node, name: str) -> None:
    before = len(clients_of(node))
    leaves = [MoveRobot(f"m{i}", 1.0, action_name=name) for i in range(10)]
    for leaf in leaves:
        leaf.setup(node=node)
        leaf.setup(node=node)
    assert len(clients_of(node)) == before + 1
    for leaf in leaves[:-1]:
        leaf.shutdown()
    assert len(clients_of(node)) == before + 1
    leaves[-1].shutdown()
    assert len(clients_of(node)) == before


def test_a_relative_name_is_the_same_action_as_the_full_one(node: Node, name: str) -> None:
    leaves = [MoveRobot("a", 1.0, action_name=name), MoveRobot("b", 1.0, action_name=name[1:])]
    for leaf in leaves:
        leaf.setup(node=node)
    assert leaves[1].server == name
    assert leaves[0]._own is leaves[1]._own
    for leaf in leaves:
        leaf.shutdown()


def test_two_types_under_one_name_are_an_error_that_names_both(node: Node, name: str) -> None:
    first, second = MoveRobot("a", 1.0, action_name=name), Gripper("b", 1.0, action_name=name)
    first.setup(node=node)
    with pytest.raises(TypeError, match=rf"{name}.*Gripper.*MoveRobot"):
        second.setup(node=node)
    first.shutdown()
    second.setup(node=node)  # the name is free again
    second.shutdown()
