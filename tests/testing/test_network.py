"""Topics and services on the virtual network, as leaves of a YAML tree use them."""

from pathlib import Path
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, Int32, String
from std_srvs.srv import SetBool, Trigger

from bt_actions import TreeError, load_tree
from bt_actions.testing import VirtualNetwork, VirtualRunner

TREE = """
tree: door
root:
  sequence: Through the door
  children:
    - wait_for_message: The door is near
      topic: at_door
      type: std_msgs/msg/String
      timeout: 5 s
    - publish: knock
      type: std_msgs/msg/String
      message: {data: knock}
      subscribers: 1
    - service: Open
      type: std_srvs/srv/Trigger
      server: door
      timeout: 5 s
"""


LISTENS = """
tree: listens
topics: {{level: {{topic: level, type: std_msgs/msg/Int32, qos: {qos}}}}}
root: {{check: $level.data > 0}}
"""


@pytest.fixture
def network() -> VirtualNetwork:
    return VirtualNetwork("/house")


def tree(directory: Path, text: str) -> Behaviour:
    (directory / "tree.yaml").write_text(text)
    return load_tree(directory / "tree.yaml")


@pytest.mark.parametrize("qos", ["default", "sensor", "latched"])
@pytest.mark.parametrize(("first_at", "ends_at"), [(0.5, 0.5), (0.99, 0.99), (2.0, 1.0)])
def test_a_topic_is_given_a_second_where_somebody_publishes(
    tmp_path: Path, network: VirtualNetwork, qos: str, first_at: float, ends_at: float
) -> None:
    publisher = network.publisher(Int32, "level")
    network.timeline.call_at(first_at, lambda: publisher.publish(Int32(data=1)))
    runner = VirtualRunner(tree(tmp_path, LISTENS.format(qos=qos)), network)
    assert runner.run() is (Status.FAILURE if first_at > 1.0 else Status.SUCCESS)
    assert network.now() == pytest.approx(ends_at, abs=0.005)


def test_a_latched_message_of_before_is_waited_for(tmp_path: Path, network: VirtualNetwork) -> None:
    network.publish("level", Int32(data=1), latched=True)
    assert VirtualRunner(tree(tmp_path, LISTENS.format(qos="latched")), network).run() is (
        Status.SUCCESS
    )


@pytest.mark.parametrize(
    ("topic", "kind", "why"),
    [
        ("levels", Int32, "nobody publishes on it; did you mean '/house/levels'?"),
        ("/level", Int32, "nobody publishes on it; there is /level of that type"),
        ("level", String, "what is published there is std_msgs/msg/String, not std_msgs/msg/Int32"),
    ],
)
def test_a_topic_on_which_nothing_comes_fails_at_once_and_tells_why(
    tmp_path: Path, network: VirtualNetwork, topic: str, kind: type, why: str
) -> None:
    network.publisher(kind, topic)
    root = tree(tmp_path, LISTENS.format(qos="default"))
    assert VirtualRunner(root, network).run() is Status.FAILURE
    assert root.feedback_message == f"no message has come on /house/level yet ($level): {why}"
    assert network.now() == 0.0


@pytest.mark.parametrize("kind", [Bool, String])
def test_what_nobody_hears_is_told(tmp_path: Path, network: VirtualNetwork, kind: type) -> None:
    network.subscribe(kind, "said", lambda _: pytest.fail("it is of another type, or topic"))
    topic = "said" if kind is Bool else "/said"
    root = tree(tmp_path, SAYS.replace("publish: said", f"publish: {topic}"))
    assert VirtualRunner(root, network).run() is Status.SUCCESS
    other = ": what is asked for there is std_msgs/msg/Bool, not std_msgs/msg/String"
    why = f"/house/said{other}" if kind is Bool else "/said; there is /house/said of that type"
    assert root.feedback_message == f"nobody listens on {why}"


SAYS = "{tree: says, root: {publish: said, type: std_msgs/msg/String, message: {data: done}}}"
CALLS = "{tree: calls, root: {service: Open, type: std_srvs/srv/Trigger, server: door}}"


def test_what_a_tree_says_last_has_arrived_when_its_run_is_over(
    tmp_path: Path, network: VirtualNetwork
) -> None:
    heard: list[str] = []
    network.subscribe(String, "said", lambda message: heard.append(message.data))
    runner = VirtualRunner(tree(tmp_path, SAYS), network)
    assert runner.run() is Status.SUCCESS
    assert heard == ["done"]
    runner.start()
    assert runner.advance(0.0) is Status.SUCCESS
    assert heard == ["done"] * 2


class Parting(Behaviour):
    """Says something when it is interrupted, when it raises, and when it is shut down."""

    def __init__(self, raises: bool) -> None:
        super().__init__("Parting")
        self._raises = raises

    def setup(self, **kwargs: Any) -> None:
        self._publisher = kwargs["node"].publisher(String, "said", "default")

    def update(self) -> Status:
        if self._raises:
            self._publisher.publish(String(data="raises"))
            raise RuntimeError("a mistake")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        self._publisher.publish(String(data="interrupted"))

    def shutdown(self) -> None:
        self._publisher.publish(String(data="gone"))


@pytest.mark.parametrize("raises", [False, True])
def test_what_a_leaf_says_at_its_end_has_arrived(network: VirtualNetwork, raises: bool) -> None:
    heard: list[str] = []
    network.subscribe(String, "said", lambda message: heard.append(message.data))
    runner = VirtualRunner(Parting(raises), network)
    with pytest.raises(TreeError if raises else TimeoutError):
        runner.run(timeout=5.0)
    assert heard == (["raises"] if raises else ["interrupted"])
    runner.shutdown()
    assert heard[1:] == ["gone"]


def test_a_service_that_is_called_last_was_called(tmp_path: Path, network: VirtualNetwork) -> None:
    called: list[Any] = []

    def answer(request: Any) -> Trigger.Response:
        called.append(request)
        return Trigger.Response()

    network.provide(Trigger, "door", answer, takes=10.0)
    runner = VirtualRunner(tree(tmp_path, CALLS), network)
    runner.start()
    assert runner.advance(0.0) is None
    runner.interrupt()
    assert runner.advance(0.0) is Status.INVALID
    assert len(called) == 1


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (None, "None"),
        (True, "True"),
        (Trigger.Response, "the class Trigger.Response"),
        (SetBool.Response(), "a SetBool.Response"),
        (Trigger.Request(), "a Trigger.Request"),
    ],
)
def test_a_service_that_is_answered_with_anything_else_ends_the_test(
    tmp_path: Path, network: VirtualNetwork, given: Any, told: str
) -> None:
    network.provide(Trigger, "door", lambda request: given)
    says = f"the service /house/door was answered with {told}: .* instance of Trigger.Response"
    with pytest.raises(TypeError, match=says):
        VirtualRunner(tree(tmp_path, CALLS), network).run()


@pytest.mark.parametrize(
    ("given", "told"), [(None, "None"), (Bool(), "a Bool"), (String, "the class String")]
)
def test_a_topic_that_is_fed_anything_else_says_so(
    network: VirtualNetwork, given: Any, told: str
) -> None:
    with pytest.raises(TypeError, match=f"/house/at_door was given {told}, .* std_msgs/msg/String"):
        network.publisher(String, "at_door").publish(given)
    if not isinstance(given, Bool):
        with pytest.raises(TypeError, match=f"/house/at_door was given {told}, .* no message"):
            network.publish("at_door", given)


def test_types_are_classes_or_names_and_stand_first(
    tmp_path: Path, network: VirtualNetwork
) -> None:
    heard: list[str] = []
    network.subscribe("std_msgs/msg/String", "said", lambda message: heard.append(message.data))
    network.publisher("std_msgs/msg/String", "said").publish(String(data="here"))
    network.provide("std_srvs/srv/Trigger", "door", lambda request: Trigger.Response())
    assert VirtualRunner(tree(tmp_path, CALLS), network).run() is Status.SUCCESS
    assert heard == ["here"]
    mistaken: Any = network
    for wrong in (
        lambda: mistaken.provide("door", Trigger, None),
        lambda: mistaken.subscribe("said", String, None),
        lambda: mistaken.publisher("said", String),
    ):
        with pytest.raises(ValueError, match=r"'\w+' is no type name"):
            wrong()


def test_a_publisher_sets_the_stamp_of_what_arrives_alone(network: VirtualNetwork) -> None:
    heard: list[BatteryState] = []
    network.subscribe(BatteryState, "battery", heard.append)
    publisher, message = network.publisher(BatteryState, "battery"), BatteryState()
    network.timeline.advance(2.0)
    publisher.publish(message)
    network.publish("battery", message)
    network.arrive()
    assert [each.header.stamp.sec for each in heard] == [2, 0]
    with pytest.raises(TypeError, match="/house/battery was given the class BatteryState"):
        publisher.publish(BatteryState)


def test_leaves_hear_speak_and_call(tmp_path: Path, network: VirtualNetwork) -> None:
    heard: list[str] = []
    network.subscribe(String, "knock", lambda message: heard.append(message.data))
    network.provide(Trigger, "door", lambda request: Trigger.Response(success=True), takes=2.0)
    runner = VirtualRunner(tree(tmp_path, TREE), network)
    runner.start()
    assert runner.advance(1.0) is None
    network.publisher(String, "/house/at_door").publish(String(data="here"))
    assert runner.advance(1.0) is None
    assert heard == ["knock"]
    assert runner.advance(2.0) is Status.SUCCESS
