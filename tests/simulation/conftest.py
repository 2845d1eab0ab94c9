"""Simulated servers on an executor of either kind, and clients in another context.

The test's own thread spins the clients, while it waits for what it waits for. Nothing of ROS is
imported before a test asks for a bench.
"""

from __future__ import annotations

import threading
import time
import traceback
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bt_actions.simulation import journal
from bt_actions.simulation.journal import Entry, Event
from tests.support.waiting import until

STEPS = {Event.STEP, Event.OPENED, Event.CLOSED}


class Goal:
    """A goal as its client sees it."""

    def __init__(self, client: Client, message: Any) -> None:
        self.feedback: list[Any] = []
        self.accepted: bool | None = None
        self.status: int | None = None
        self.result: Any = None
        self.handle: Any = None
        self.cancels: list[tuple[int, int]] = []
        """Of each answer to a cancel: the return code, and how many goals it says are canceling.

        rclpy's servers answer a refused cancel with code 0 and no goal, those of rclcpp with 1.
        """
        self._client = client
        future = client.rclpy_client.send_goal_async(
            message, feedback_callback=lambda message: self.feedback.append(message.feedback)
        )
        future.add_done_callback(self._answered)

    def _answered(self, future: Any) -> None:
        self.handle = future.result()
        self.accepted = self.handle.accepted
        if self.accepted:
            self.ask_for_result()

    def ask_for_result(self) -> None:
        self.handle.get_result_async().add_done_callback(self._ended)

    def _ended(self, future: Any) -> None:
        self.result = future.result().result
        self.status = future.result().status

    def cancel(self) -> None:
        self.handle.cancel_goal_async().add_done_callback(self._canceled)

    def _canceled(self, future: Any) -> None:
        answer = future.result()
        self.cancels.append((answer.return_code, len(answer.goals_canceling)))

    @property
    def goal_id(self) -> str:
        return bytes(self.handle.goal_id.uuid).hex()

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


class Client:
    """An action client that the test's thread spins."""

    def __init__(self, bench: Bench, action_type: Any, name: str) -> None:
        from rclpy.action import ActionClient

        self.bench = bench
        self.action_type = action_type
        self.rclpy_client = ActionClient(bench.client_node, action_type, name)
        self._questions: list[Any] = []
        self._ask_at = 0.0

    def until_ready(self) -> Client:
        """Wait for the server, and for its answer to a question: it may see this client later."""
        self.until(self.rclpy_client.server_is_ready, 10.0, "the server is there")
        self.until(self._is_answered, 10.0, "the server answers")
        return self

    def _is_answered(self) -> bool:
        """Whether it was answered; asks for a goal that nobody knows, now and then."""
        from rclpy.action.client import ClientGoalHandle
        from unique_identifier_msgs.msg import UUID

        if any(question.done() for question in self._questions):
            return True
        if time.monotonic() >= self._ask_at:
            self._ask_at = time.monotonic() + 0.5
            nobody = ClientGoalHandle(self.rclpy_client, UUID(uuid=list(uuid.uuid4().bytes)), None)
            self._questions.append(nobody.get_result_async())
        return False

    def until(self, condition: Callable[[], Any], within: float = 5.0, what: str = "") -> Any:
        return self.bench.until(condition, within, what)

    def send(self, **fields: Any) -> Goal:
        return Goal(self, self.action_type.Goal(**fields))


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


class Bench:
    """Servers on a spun node, clients that the test spins, and what the servers wrote."""

    def __init__(self, spun: Spun, clients: Any, path: Path) -> None:
        self.spun = spun
        self.node = spun.node
        self.path = path
        self.client_node, self._client_executor = clients
        self._serving: list[Any] = []
        self._clients: list[Client] = []

    def serve(self, server: Any) -> Any:
        """Keep a server or a simulation until the test is over."""
        self._serving.append(server)
        return server

    def client(self, action_type: Any, name: str) -> Client:
        """Make a client; made before its server, it need not wait for the next announcement."""
        client = Client(self, action_type, name)
        self._clients.append(client)
        return client

    def until(self, condition: Callable[[], Any], within: float = 5.0, what: str = "") -> Any:
        """Spin the clients until `condition` holds."""

        def look() -> Any:
            assert not self.spun.died, f"the servers' executor died: {self.spun.died[0]}"
            return condition()

        return until(look, within, what=what, meanwhile=self._spin_clients)

    def _spin_clients(self) -> None:
        self._client_executor.spin_once(timeout_sec=0.01)
        for _ in range(20):
            self._client_executor.spin_once(timeout_sec=0.0)

    def spin_for(self, seconds: float) -> None:
        """Spin the clients for a while, to see that something does not come."""
        done = threading.Event()
        timer = threading.Timer(seconds, done.set)
        timer.start()
        self.until(done.is_set, seconds + 5.0)
        timer.join()

    def entries(self) -> list[Entry]:
        return journal.read(self.path) if self.path.exists() else []

    def events(self) -> list[str]:
        """What happened to goals, without the steps."""
        return [str(each.event) for each in self.entries() if each.event not in STEPS]

    def happened(self, event: str, times: int = 1) -> Callable[[], bool]:
        return lambda: self.events().count(event) >= times

    def close(self) -> None:
        for server in self._serving:
            server.close()
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


@pytest.fixture
def bench(
    spun_nodes: Callable[[str], Spun], clients: Any, executor: str, tmp_path: Path
) -> Iterator[Bench]:
    """Servers under either executor."""
    each = Bench(spun_nodes(executor), clients, tmp_path / "journal.jsonl")
    yield each
    each.close()


@pytest.fixture
def own_bench(
    contexts: tuple[Any, Any], clients: Any, executor: str, tmp_path: Path
) -> Iterator[Bench]:
    """Servers on a node of the test's own, which it may stop to spin."""
    spun = Spun(contexts[0], executor)
    each = Bench(spun, clients, tmp_path / "journal.jsonl")
    yield each
    spun.stop()
    each.close()
    spun.node.destroy_node()


@pytest.fixture
def space() -> str:
    """A namespace that no other test uses."""
    return f"/sim{next(_numbers)}"


_numbers = iter(range(1, 1_000_000))
