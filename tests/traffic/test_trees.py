"""What a tree tells of its topics and services is the same over rclpy and in virtual time."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from std_msgs.msg import Int32, String
from std_srvs.srv import SetBool

from bt_actions import load_tree
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner
from tests.support.waiting import until


class World(Protocol):
    """What stands around a tree; relative names are in a namespace of the test's own."""

    def publish(self, topic: str, message: Any, *, latched: bool) -> None:
        """Publish a message, by a publisher that stays."""

    def subscribe(self, message_type: type, topic: str, take: Callable[[Any], None]) -> None:
        """Have `take` called with each message."""

    def provide(self, service_type: type, name: str, answer: Callable[[Any], Any]) -> None:
        """Offer a service, which `answer` answers."""

    def robot(self) -> None:
        """Serve the action `robot`."""

    def run(self, root: Behaviour) -> None:
        """Run a tree to its end, and shut it down."""

    def arrives(self, condition: Callable[[], Any]) -> None:
        """Wait for what the middleware has; in virtual time it was delivered."""


class Ros:
    """A node, which the tree shares."""

    def __init__(self, node: Any, run: Callable[..., Any], serve: Callable[..., Any]) -> None:
        self._node, self.run, self._serve = node, run, serve
        self._ends: list[tuple[Callable[[Any], Any], Any]] = []

    def publish(self, topic: str, message: Any, *, latched: bool) -> None:
        """Publish on the node."""
        from bt_actions.ros.connections import qos_profile

        qos = qos_profile("latched" if latched else "default")
        publisher = self._node.create_publisher(type(message), topic, qos)
        self._ends.append((self._node.destroy_publisher, publisher))
        publisher.publish(message)

    def subscribe(self, message_type: type, topic: str, take: Callable[[Any], None]) -> None:
        """Listen on the node."""
        subscription = self._node.create_subscription(message_type, topic, take, 10)
        self._ends.append((self._node.destroy_subscription, subscription))

    def provide(self, service_type: type, name: str, answer: Callable[[Any], Any]) -> None:
        """Offer it on the node."""
        service = self._node.create_service(service_type, name, lambda request, _: answer(request))
        self._ends.append((self._node.destroy_service, service))

    def robot(self) -> None:
        """Serve it in another process."""
        self._serve()

    def arrives(self, condition: Callable[[], Any]) -> None:
        """Spin the node, which nobody spins any more."""
        from rclpy.executors import SingleThreadedExecutor

        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        until(condition, meanwhile=lambda: executor.spin_once(timeout_sec=0.01))
        executor.shutdown()
        self._node.executor = None

    def close(self) -> None:
        """Leave the node as it was."""
        for destroy, end in self._ends:
            destroy(end)


class Virtual:
    """The network in virtual time."""

    def __init__(self, name: str) -> None:
        network = VirtualNetwork()
        self._network, self._name = network, name
        self.publish, self.subscribe = network.publish, network.subscribe
        self.provide = network.provide

    def robot(self) -> None:
        """Serve it on the network."""
        ScriptedServer(self._network, MoveRobot, self._name, Script(duration=0.01))

    def run(self, root: Behaviour) -> None:
        """Run it."""
        VirtualRunner(root, self._network).run(timeout=15.0)

    def arrives(self, condition: Callable[[], Any]) -> None:
        """Look at once."""
        assert condition()


@pytest.fixture
def ros(request: pytest.FixtureRequest) -> Iterator[World]:
    """The node of all tests."""
    serve, node, run = map(request.getfixturevalue, ("serve", "node", "run"))
    world = Ros(node, run, serve)
    yield world
    world.close()


@pytest.fixture
def virtual(name: str) -> World:
    """A network of its own for each test."""
    return Virtual(name)


@pytest.fixture(params=[pytest.param("ros", marks=pytest.mark.ros), "virtual"])
def world(request: pytest.FixtureRequest) -> World:
    """Each world there is."""
    world: World = request.getfixturevalue(request.param)
    return world


Load = Callable[[str], Behaviour]


@pytest.fixture
def load(tmp_path: Path, name: str) -> Load:
    """Load a tree in which each `NAME` is one that no other test uses."""

    def load(text: str) -> Behaviour:
        (tmp_path / "inner.yaml").write_text("{tree: i, inputs: {n: int32}, root: {success: S}}")
        (tmp_path / "tree.yaml").write_text("tree: t\n" + text.replace("NAME", name))
        return load_tree(tmp_path / "tree.yaml")

    return load


FLAG = "topics: {flag: {topic: NAME/flag, type: std_msgs/msg/Int32, qos: latched}}\nroot:\n  "
READS = {
    "action": """action: A
  type: robot_control_interfaces/action/MoveRobot
  server: NAME
  goal: {distance: = $flag.data * 0.01}""",
    "check": "check: $flag.data == 1",
    "for_each": "for_each: F\n  in: = [$flag.data]\n  child: {success: S}",
    "log": "log: It is $(flag.data)",
    "publish": "publish: NAME/x\n  type: std_msgs/msg/Int32\n  message: {data: $flag.data}",
    "repeat": "repeat: R\n  times: $flag.data\n  child: {success: S}",
    "retry": "retry: R\n  attempts: $flag.data\n  child: {success: S}",
    "service": """service: S
  type: std_srvs/srv/SetBool
  server: NAME/switch
  request: {data: = $flag.data == 1}""",
    "set": "set: {seen: $flag.data}",
    "subtree": "subtree: inner.yaml\n  with: {n: $flag.data}",
    "timeout": "timeout: T\n  after: $flag.data\n  child: {success: S}",
    "wait": "wait: = $flag.data * 0.01",
    "while": "while: $flag.data == 1\n  child: {success: S}",
}


def switched(request: Any) -> Any:
    return SetBool.Response(success=request.data)


@pytest.mark.parametrize("kind", READS)
def test_who_reads_a_latched_topic_at_once_is_given_its_message(
    world: World, load: Load, name: str, kind: str
) -> None:
    if kind == "action":
        world.robot()
    world.provide(SetBool, f"{name}/switch", switched)
    world.publish(f"{name}/flag", Int32(data=1), latched=True)
    root = load(FLAG + READS[kind])
    world.run(root)
    assert root.status is Status.SUCCESS, root.feedback_message


WAITS = """root:
  wait_for_message: W
  topic: NAME/flag
  type: std_msgs/msg/Int32
  qos: QOS
  timeout: 1 s
"""
OPENS = (
    "root: {service: S, type: std_srvs/srv/Trigger, server: NAME/door, timeout: {server: 300 ms}}"
)
SAYS = "root: {publish: NAME/said, type: std_msgs/msg/String, message: {data: hello}}"
TELLS = {
    "a topic on which nobody publishes": (
        FLAG + "check: $flag.data == 1",
        "no message has come on NAME/flag yet ($flag): nobody publishes on it",
    ),
    "a message before it is waited for": (
        WAITS.replace("QOS", "default"),
        "no such message on NAME/flag within 1 s",
    ),
    "a latched message before it is waited for": (WAITS.replace("QOS", "latched"), ""),
    "a service that is not there": (
        OPENS,
        "no service NAME/door within 0.3 s: nobody offers it",
    ),
    "a message that nobody hears": (SAYS, "nobody listens on NAME/said"),
}


@pytest.mark.parametrize("what", TELLS)
def test_what_a_tree_tells_is_the_same(world: World, load: Load, name: str, what: str) -> None:
    text, says = TELLS[what]
    if "before" in what:
        world.publish(f"{name}/flag", Int32(data=1), latched="latched" in what)
    root = load(text)
    world.run(root)
    assert root.feedback_message == says.replace("NAME", name)


AGES = """topics:
  flag: {topic: NAME/flag, type: std_msgs/msg/Int32, qos: latched, max_age: 400 ms}
root:
  sequence: S
  children:
    - check: $flag.data == 1
    - wait: 500 ms
    - check: $flag.data == 1
"""


def test_a_message_is_as_old_as_the_time_since_it_came(world: World, load: Load, name: str) -> None:
    world.publish(f"{name}/flag", Int32(data=1), latched=True)
    root = load(AGES)
    world.run(root)
    first, _, last = root.children
    assert (first.status, last.status) == (Status.SUCCESS, Status.FAILURE)
    said = rf"the last message on {name}/flag is \d\.\d s old \(\$flag\)"
    assert re.fullmatch(said, last.feedback_message)


def test_what_a_tree_said_last_arrives(world: World, load: Load, name: str) -> None:
    heard: list[str] = []
    for _ in range(2):
        world.subscribe(String, f"{name}/said", lambda message: heard.append(message.data))
    world.run(load(SAYS))
    world.arrives(lambda: heard == ["hello", "hello"])
