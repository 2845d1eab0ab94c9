"""Simulated servers, and clients of theirs: on rclpy under an executor, or on the virtual network.

What holds on both is tested on both; what a server decides is tested in virtual time alone, and
what only rclpy has (`ros_bench`) under both of its executors. On rclpy the test's own thread spins
the clients, in another context, while it waits for what it waits for.
"""

from __future__ import annotations

import itertools
import threading
import time
import traceback
import uuid
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bt_actions.simulation import journal
from bt_actions.simulation.journal import Event, JournalLine
from bt_actions.testing import VirtualNetwork
from bt_actions.testing.transport import VirtualParticipant
from bt_actions.traffic.transport import Request
from tests.support.waiting import until

STEPS = {Event.STEP, Event.OPENED, Event.CLOSED}


class Goal:
    """A goal as its client sees it."""

    def __init__(self, client: Client, goal_id: str) -> None:
        self.goal_id = goal_id
        self.feedback: list[Any] = []
        self.accepted: bool | None = None
        self.status: int | None = None
        self.result: Any = None
        self.cancels: list[int] = []
        """The answers to requests to cancel it: return codes, 1 where rclpy lists no goal."""
        self._client = client

    def ask_for_result(self) -> None:
        self._client.ask_for_result(self)

    def cancel(self) -> None:
        self._client.cancel(self)

    def until_accepted(self, within: float = 5.0) -> Goal:
        self._client.until(lambda: self.accepted is not None, within, "the goal is answered")
        assert self.accepted
        return self

    def until_moving(self) -> Goal:
        self.until_accepted()
        self._client.until(lambda: self.feedback, what="feedback")
        return self

    def all_feedback(self, count: int) -> list[Any]:
        """Return the feedback once there are `count` of them; the last may come after the end."""
        self._client.until(lambda: len(self.feedback) >= count, what=f"{count} feedback messages")
        return self.feedback

    def until_ended(self, within: float = 10.0) -> Goal:
        self._client.until(lambda: self.status is not None, within, "the goal has ended")
        return self


class Client(ABC):
    """An action client."""

    def __init__(self, bench: Bench, action_type: Any) -> None:
        self.until = bench.until
        self.action_type = action_type

    @abstractmethod
    def is_ready(self) -> bool: ...

    @abstractmethod
    def send(self, **fields: Any) -> Goal: ...

    @abstractmethod
    def ask_for_result(self, goal: Goal) -> None: ...

    @abstractmethod
    def cancel(self, goal: Goal) -> None: ...

    def until_ready(self) -> Client:
        self.until(self.is_ready, 10.0, "the server is there")
        return self


class RosClient(Client):
    """One that the test's thread spins."""

    def __init__(self, bench: RosBench, action_type: Any, name: str) -> None:
        from rclpy.action import ActionClient

        super().__init__(bench, action_type)
        self.rclpy_client = ActionClient(bench.client_node, action_type, name)
        self._questions: list[Any] = []
        self._ask_at = 0.0

    def is_ready(self) -> bool:
        return bool(self.rclpy_client.server_is_ready())

    def until_ready(self) -> Client:
        """Wait for the server, and for its answer to a question: it may see this client later."""
        super().until_ready()
        self.until(self._is_answered, 10.0, "the server answers")
        return self

    def _is_answered(self) -> bool:
        """Whether it was answered; asks for a goal that nobody knows, now and then."""
        if any(question.done() for question in self._questions):
            return True
        if time.monotonic() >= self._ask_at:
            self._ask_at = time.monotonic() + 0.5
            self._questions.append(self.handle(uuid.uuid4().hex).get_result_async())
        return False

    def handle(self, goal_id: str) -> Any:
        """A handle of rclpy's, to ask about any goal."""
        from rclpy.action.client import ClientGoalHandle
        from unique_identifier_msgs.msg import UUID

        return ClientGoalHandle(self.rclpy_client, UUID(uuid=list(bytes.fromhex(goal_id))), None)

    def send(self, **fields: Any) -> Goal:
        goal = Goal(self, uuid.uuid4().hex)

        def answered(future: Any) -> None:
            goal.accepted = future.result().accepted
            if goal.accepted:
                goal.ask_for_result()

        future = self.rclpy_client.send_goal_async(
            self.action_type.Goal(**fields),
            feedback_callback=lambda message: goal.feedback.append(message.feedback),
            goal_uuid=self.handle(goal.goal_id).goal_id,
        )
        future.add_done_callback(answered)
        return goal

    def ask_for_result(self, goal: Goal) -> None:
        def ended(future: Any) -> None:
            goal.result, goal.status = future.result().result, future.result().status

        self.handle(goal.goal_id).get_result_async().add_done_callback(ended)

    def cancel(self, goal: Goal) -> None:
        def canceled(future: Any) -> None:
            answer = future.result()
            goal.cancels.append(answer.return_code or (0 if answer.goals_canceling else 1))

        self.handle(goal.goal_id).cancel_goal_async().add_done_callback(canceled)


class VirtualClient(Client):
    """One on the virtual network; it is its transport's listener."""

    def __init__(self, bench: VirtualBench, action_type: Any, name: str) -> None:
        super().__init__(bench, action_type)
        participant = VirtualParticipant(bench.network, "client", "/")
        self._transport = participant.open_transport(action_type, name, self)
        self._goals: dict[bytes, Goal] = {}

    def is_ready(self) -> bool:
        return self._transport.ready()

    def send(self, **fields: Any) -> Goal:
        goal_id = len(self._goals).to_bytes(16, "big")
        self._goals[goal_id] = Goal(self, goal_id.hex())
        self._transport.send(goal_id, self.action_type.Goal(**fields))
        return self._goals[goal_id]

    def ask_for_result(self, goal: Goal) -> None:
        self._transport.ask_result(bytes.fromhex(goal.goal_id))

    def cancel(self, goal: Goal) -> None:
        self._transport.cancel(bytes.fromhex(goal.goal_id))

    def answer_came(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        goal = self._goals[goal_id]
        if request == "result":
            goal.status, goal.result = answers[-1]
        elif request == "cancel":
            goal.cancels.append(answers[-1])
        else:
            goal.accepted = answers[-1]
            if goal.accepted:
                self._transport.ask_result(goal_id)

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        self._goals[goal_id].feedback.append(feedback)

    def statuses_came(self, statuses: dict[bytes, int]) -> None: ...

    def all_delivered(self) -> None: ...


class Spun:
    """A node for servers, spun by an executor of one kind on a thread of its own."""

    def __init__(self, context: Any, kind: str) -> None:
        from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
        from rclpy.node import Node

        self.node = Node(f"servers_{kind}", context=context)
        self.executor: Any = (
            SingleThreadedExecutor(context=context)
            if kind == "single"
            else MultiThreadedExecutor(2, context=context)
        )
        self.executor.add_node(self.node)
        self.died: list[str] = []
        self._thread = threading.Thread(target=self._spin, name="servers")
        self._thread.start()

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException, ShutdownException

        try:
            self.executor.spin()
        except (ExternalShutdownException, ShutdownException):
            return
        except BaseException:  # noqa: BLE001 - a test looks at it
            self.died.append(traceback.format_exc())

    def stop(self) -> None:
        """Stop to spin; the node lives on."""
        if not self._thread.is_alive():
            return
        self.executor.shutdown()
        self._thread.join(5.0)
        assert not self._thread.is_alive()
        if pool := getattr(self.executor, "_executor", None):
            pool.shutdown(wait=True)


class Bench(ABC):
    """Servers and clients, and what the servers wrote."""

    def __init__(self, node: Any, path: Path) -> None:
        self.node = node
        """What servers stand on: a node, or the virtual network."""
        self.path = path
        self.serving: list[Any] = []

    def serve(self, server: Any) -> Any:
        """Keep a server or a simulation until the test is over."""
        self.serving.append(server)
        return server

    @abstractmethod
    def client(self, action_type: Any, name: str) -> Client: ...

    @abstractmethod
    def now(self) -> float: ...

    @abstractmethod
    def until(self, condition: Callable[[], Any], within: float = 5.0, what: str = "") -> Any:
        """Let the clients go on until `condition` holds."""

    @abstractmethod
    def go_on_for(self, seconds: float) -> None:
        """Let the clients go on for a while, to see that something does not come."""

    def entries(self) -> list[JournalLine]:
        return journal.read(self.path) if self.path.exists() else []

    def events(self) -> list[str]:
        """What happened to goals, without the steps."""
        return [str(each.event) for each in self.entries() if each.event not in STEPS]

    def happened(self, event: str, times: int = 1) -> Callable[[], bool]:
        return lambda: self.events().count(event) >= times

    def close(self) -> None:
        for server in self.serving:
            server.close()


class VirtualBench(Bench):
    """All of it on the virtual network."""

    def __init__(self, path: Path) -> None:
        self.network = VirtualNetwork()
        super().__init__(self.network, path)

    def client(self, action_type: Any, name: str) -> Client:
        return VirtualClient(self, action_type, name)

    def now(self) -> float:
        return self.network.now()

    def until(self, condition: Callable[[], Any], within: float = 5.0, what: str = "") -> Any:
        end = self.now() + within
        while not (found := condition()):
            assert self.now() < end, f"not within {within:g} s: {what}"
            self.network.timeline.advance(min(self.now() + 0.01, end))
        return found

    def go_on_for(self, seconds: float) -> None:
        end = self.now() + seconds
        while self.network.timeline.advance(end):
            pass


class RosBench(Bench):
    """Servers on a spun node, and clients that the test spins."""

    def __init__(self, spun: Spun, clients: Any, path: Path) -> None:
        super().__init__(spun.node, path)
        self.spun = spun
        self.client_node, self._client_executor = clients
        self._clients: list[RosClient] = []

    def client(self, action_type: Any, name: str) -> RosClient:
        """Make a client; made before its server, it need not wait for the next announcement."""
        client = RosClient(self, action_type, name)
        self._clients.append(client)
        return client

    def now(self) -> float:
        return time.monotonic()

    def until(self, condition: Callable[[], Any], within: float = 5.0, what: str = "") -> Any:
        def look() -> Any:
            assert not self.spun.died, f"the servers' executor died: {self.spun.died[0]}"
            return condition()

        return until(look, within, what=what, meanwhile=self._spin_clients)

    def _spin_clients(self) -> None:
        self._client_executor.spin_once(timeout_sec=0.01)
        for _ in range(20):
            self._client_executor.spin_once(timeout_sec=0.0)

    def go_on_for(self, seconds: float) -> None:
        done = threading.Event()
        timer = threading.Timer(seconds, done.set)
        timer.start()
        self.until(done.is_set, seconds + 5.0)
        timer.join()

    def close(self) -> None:
        super().close()
        for client in self._clients:
            client.rclpy_client.destroy()
        assert not self.spun.died, f"the servers' executor died: {self.spun.died[0]}"


@pytest.fixture(scope="session")
def contexts(domain: int) -> Iterator[tuple[Any, Any]]:
    """A context for the servers, and one for the clients."""
    from rclpy.context import Context

    both = Context(), Context()
    for each in both:
        each.init(domain_id=domain)
    yield both
    for each in both:
        each.shutdown()


@pytest.fixture(scope="session")
def clients(contexts: tuple[Any, Any]) -> Iterator[tuple[Any, Any]]:
    """A node for clients and the executor with which tests spin it: up before all servers."""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    node = Node("clients", context=contexts[1])
    executor = SingleThreadedExecutor(context=contexts[1])
    executor.add_node(node)
    yield node, executor
    executor.shutdown()
    node.destroy_node()


@pytest.fixture(scope="session")
def spun_nodes(contexts: tuple[Any, Any]) -> Iterator[Callable[[str], Spun]]:
    """The servers' nodes, which outlive the tests: a new one is discovered after seconds."""
    made: dict[str, Spun] = {}

    def spun(kind: str) -> Spun:
        if kind not in made:
            made[kind] = Spun(contexts[0], kind)
        return made[kind]

    yield spun
    for each in made.values():
        each.stop()
        each.node.destroy_node()


@pytest.fixture(params=[pytest.param("multi", marks=pytest.mark.ros), "virtual"])
def stands_on(request: pytest.FixtureRequest) -> str:
    """What servers stand on; a module of tests may choose one."""
    return str(request.param)


@pytest.fixture
def bench(stands_on: str, request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    """Servers on either."""
    path = tmp_path / "journal.jsonl"
    if stands_on == "virtual":
        each: Bench = VirtualBench(path)
    else:
        spun, clients = map(request.getfixturevalue, ("spun_nodes", "clients"))
        each = RosBench(spun(stands_on), clients, path)
    yield each
    each.close()


@pytest.fixture
def ros_bench(
    spun_nodes: Callable[[str], Spun], clients: Any, executor: str, tmp_path: Path
) -> Iterator[RosBench]:
    """Servers on rclpy under either executor."""
    each = RosBench(spun_nodes(executor), clients, tmp_path / "journal.jsonl")
    yield each
    each.close()


@pytest.fixture
def own_bench(
    contexts: tuple[Any, Any], clients: Any, executor: str, tmp_path: Path
) -> Iterator[RosBench]:
    """Servers on a node of the test's own, which it may stop to spin."""
    spun = Spun(contexts[0], executor)
    each = RosBench(spun, clients, tmp_path / "journal.jsonl")
    yield each
    spun.stop()
    each.close()
    spun.node.destroy_node()


@pytest.fixture
def space() -> str:
    """A namespace that no other test uses."""
    return f"/sim{next(_numbers)}"


_numbers = itertools.count(1)
