"""What a tree's expressions come to while it runs, on a network in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import Float32, Float64MultiArray
from test_msgs.action import NestedMessage
from test_msgs.msg import BasicTypes

from bt_actions.document import tree_outputs
from bt_actions.messages.conversion import to_plain
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner
from bt_actions.utilities.shorten import shorten
from tests.document.conftest import tick

Load = Callable[..., Behaviour]


@pytest.fixture
def network() -> VirtualNetwork:
    return VirtualNetwork()


GOES_HOME = """
tree: t
topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState, max_age: 5 s}}
actions: {move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 9 s}}
root:
  sequence: S
  children:
    - wait: 10 s
    - fallback: Home when it is low
      children:
        - check: $battery.percentage > 0.2
        - sequence: Home
          children:
            - log: Going home, battery at $(battery.percentage)
            - move: Home
"""


@pytest.mark.parametrize("heard", [False, True], ids=["never heard", "heard 10 s ago"])
def test_a_log_does_not_keep_the_robot_from_going_home(
    load: Load, network: VirtualNetwork, heard: bool
) -> None:
    ScriptedServer(network, MoveRobot, "move_robot")
    runner = VirtualRunner(load(GOES_HOME), network)
    runner.start()
    runner.advance(0.5)
    if heard:
        network.publisher(BatteryState, "battery").publish(BatteryState(percentage=0.7))
    assert runner.advance(60.0) is Status.SUCCESS
    assert network.log.lines == [("info", "Going home, battery at (no value)")]
    assert [name for name, _ in runner.outcomes] == ["Home"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("$(gone): $(list[7]), $(list[1:])", "(no value): (no value), [2]"),
        ("$gone", "(no value)"),
        ("= $gone + 1", "(no value)"),
        ("= 1 / ($list[0] - 1)", "(no value)"),
        ("The key is $(stop.x)", "The key is (no value)"),
        ("= $list[0] == 1", "true"),
    ],
)
def test_a_log_has_a_text_for_what_cannot_be_computed(load: Load, text: str, line: str) -> None:
    root = load(
        f"""
        tree: t
        inputs: {{list: {{type: "int64[]", default: [1, 2]}}}}
        root:
          for_each: Stop
          in: [{{y: 1}}, {{x: 2}}]
          as: stop
          child:
            sequence: S
            children: [{{log: "{text}"}}, {{running: R}}, {{set: {{gone: 1}}}}]
        """
    )
    assert tick(root, 1) is Status.RUNNING
    log = next(each for each in root.iterate() if each.name.startswith("log "))
    assert (log.status, log.feedback_message) == (Status.SUCCESS, line)


def test_known_is_false_without_a_message_and_where_the_last_one_is_too_old(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(
        """
        tree: t
        topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState, max_age: 5 s}}
        outputs: {told: "bool[]"}
        root:
          sequence: S
          children:
            - set: {told: "= [known($battery), known($battery.percentage), known($later)]"}
            - wait_until: known($battery) and $battery.present
            - set: {told: "= $told + [known($battery)]", later: 1}
            - wait: 5 s
            - set: {told: "= $told + [known($battery), known($later)]"}
        """
    )
    runner = VirtualRunner(root, network)
    runner.start()
    assert runner.advance(3.0) is None
    network.publisher(BatteryState, "battery").publish(BatteryState(present=True))
    assert runner.advance(60.0) is Status.SUCCESS
    assert tree_outputs(root) == {"told": [False, False, False, True, False, True]}


def test_lists_that_are_joined_are_plain_and_fit_messages(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(
        """
        tree: t
        topics: {scan: {topic: scan, type: sensor_msgs/msg/LaserScan}}
        inputs: {far: {type: float64, default: 9.5}}
        outputs: {names: "string[]", near: "float32[]"}
        root:
          sequence: S
          children:
            - wait_until: len($scan.ranges) > 0
            - set: {names: [], near: "= $scan.ranges[:1] + [0.5]"}
            - for_each: Range
              in: "= $scan.ranges + [$far]"
              index: n
              child: {set: {names: "= $names + [str($n) + ': ' + str($item)]"}}
            - publish: all
              type: std_msgs/msg/Float64MultiArray
              message: {data: "= $scan.ranges[1:] + [$far] + $near"}
        """
    )
    came: list[Any] = []
    network.subscribe(Float64MultiArray, "all", came.append)
    runner = VirtualRunner(root, network)
    runner.start()
    runner.advance(1.0)
    network.publisher(LaserScan, "scan").publish(LaserScan(ranges=[0.7, 0.1]))
    assert runner.advance(5.0) is Status.SUCCESS
    assert tree_outputs(root) == {"names": ["0: 0.7", "1: 0.1", "2: 9.5"], "near": [0.7, 0.5]}
    assert list(came[0].data) == [0.1, 9.5, 0.7, 0.5]


def test_a_list_that_grows_without_end_fails_and_is_not_waited_for(load: Load) -> None:
    root = load(
        """
        tree: t
        outputs: {list: "int64[]"}
        root:
          sequence: S
          children:
            - set: {list: [1, 2]}
            - repeat: R
              child: {set: {list: = $list + $list}}
        """
    )
    assert tick(root) is Status.FAILURE
    assert root.children[1].children[0].feedback_message == (
        "the list would have more than 100,000 items"
    )


def test_a_float32_is_shown_by_the_fewest_digits_that_give_it(
    load: Load, network: VirtualNetwork
) -> None:
    root = load(
        """
        tree: t
        outputs: {one: float32, whole: std_msgs/msg/Float32, list: "float32[]", wide: float64}
        root:
          sequence: S
          children:
            - wait_for_message: W
              topic: data
              type: std_msgs/msg/Float32
              until: message.data == 0.7
              save: {one: message.data, whole: message, list: "[message.data]", wide: message.data}
            - log: "$(one) $(whole) $(list)"
            - check: $one == 0.7 and $whole.data == $wide
        """
    )
    runner = VirtualRunner(root, network)
    runner.start()
    runner.advance(1.0)
    network.publisher(Float32, "data").publish(Float32(data=0.699999988079071))
    assert runner.advance(5.0) is Status.SUCCESS
    assert network.log.lines == [("info", "0.7 {'data': 0.7} [0.7]")]
    outputs = tree_outputs(root)
    assert (outputs["one"], outputs["list"], outputs["wide"]) == (0.7, [0.7], 0.7)
    assert to_plain(outputs["whole"]) == {"data": 0.7}
    assert shorten(outputs["whole"]) == "{data: 0.7}"


def test_a_float32_of_a_result_is_kept_by_the_fewest_digits_that_give_it(
    load: Load, network: VirtualNetwork
) -> None:
    result = NestedMessage.Result(nested_field=BasicTypes(float32_value=0.699999988079071))
    script = Script(duration=1.0, result=lambda _: result)
    ScriptedServer(network, NestedMessage, "nested", script)
    root = load(
        """
        tree: t
        outputs: {one: float32}
        root:
          action: A
          type: test_msgs/action/NestedMessage
          server: nested
          timeout: 5 s
          save: {one: result.nested_field.float32_value}
        """
    )
    assert VirtualRunner(root, network).run() is Status.SUCCESS
    assert tree_outputs(root) == {"one": 0.7}
