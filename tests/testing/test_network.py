"""Topics and services on the virtual network, as leaves of a YAML tree use them."""

from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from bt_actions import load_tree
from bt_actions.simulation import Simulation
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


def test_leaves_hear_speak_and_call(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(TREE)
    network, heard = VirtualNetwork("/house"), list[str]()
    network.subscribe(String, "knock", lambda message: heard.append(message.data))
    network.provide(Trigger, "door", lambda request: Trigger.Response(success=True), takes=2.0)
    runner = VirtualRunner(load_tree(tmp_path / "door.yaml"), network)
    runner.start()
    assert runner.advance(1.0) is None
    network.publisher(String, "/house/at_door").publish(String(data="here"))
    assert runner.advance(1.0) is None
    assert heard == ["knock"]
    assert runner.advance(2.0) is Status.SUCCESS


@pytest.mark.parametrize("qos", ["default", "latched"])
def test_the_first_node_of_a_tree_waits_for_a_topic_that_somebody_publishes(
    tmp_path: Path, qos: str
) -> None:
    (tmp_path / "first.yaml").write_text(
        "tree: first\nroot: {check: $battery.percentage > 0.2}\ntopics:\n"
        f"  battery: {{topic: battery_state, type: sensor_msgs/msg/BatteryState, qos: {qos}}}\n"
    )
    network = VirtualNetwork()
    runner = VirtualRunner(load_tree(tmp_path / "first.yaml"), network)
    assert runner.run() is Status.FAILURE
    assert runner.now == 0.0, "nobody publishes on it"
    Simulation(network)
    runner = VirtualRunner(load_tree(tmp_path / "first.yaml"), network)
    assert runner.run() is Status.SUCCESS


def test_what_a_tree_says_last_was_heard_when_its_run_is_over(tmp_path: Path) -> None:
    (tmp_path / "says.yaml").write_text(
        "tree: says\nroot:\n  parallel: Both\n  policy: one\n  children:\n"
        "    - {service: Ask, type: std_srvs/srv/Trigger, server: door}\n"
        "    - {publish: said, type: std_msgs/msg/String, message: {data: done}}\n"
    )
    network, said, asked = VirtualNetwork(), list[str](), list[Any]()
    network.subscribe(String, "said", lambda message: said.append(message.data))

    def answer(request: Any) -> Any:
        asked.append(request)
        return Trigger.Response()

    network.provide(Trigger, "door", answer)
    runner = VirtualRunner(load_tree(tmp_path / "says.yaml"), network)
    assert runner.run() is Status.SUCCESS
    assert (said, len(asked)) == (["done"], 1)


@pytest.mark.parametrize(
    ("given", "was"),
    [
        (None, "None"),
        (True, "true"),
        (Trigger.Response, "the class Trigger.Response"),
        (SetBool.Response(), "a SetBool.Response"),
    ],
)
def test_a_service_that_returns_no_response_is_named_with_what_it_returned(
    tmp_path: Path, given: Any, was: str
) -> None:
    (tmp_path / "door.yaml").write_text(
        "tree: t\nroot: {service: Open, type: std_srvs/srv/Trigger, server: door}\n"
    )
    network = VirtualNetwork()
    network.provide(Trigger, "door", lambda _: given)
    runner = VirtualRunner(load_tree(tmp_path / "door.yaml"), network)
    text = f"the service /door has to return a Trigger.Response, and returned {was}$"
    with pytest.raises(TypeError, match=text):
        runner.run()


def test_a_publisher_takes_no_message_of_another_type() -> None:
    publisher = VirtualNetwork().publisher(String, "said")
    with pytest.raises(TypeError, match=r"/said takes a String, not a Trigger\.Request"):
        publisher.publish(Trigger.Request())
    publisher.destroy()
