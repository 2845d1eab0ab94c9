"""Services, topics and actions in trees, on a network in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from bt_actions.document import tree_outputs
from bt_actions.events import NodeChanged
from bt_actions.testing import Script, ScriptedServer, VirtualNetwork, VirtualRunner

Load = Callable[..., Behaviour]


CALL = """
tree: t
inputs: {{on: {{type: bool, default: true}}}}
outputs: {{said: string}}
root:
  service: Switch
  type: std_srvs/srv/SetBool
  server: switch
  request: {{data: $on}}
  expect: result.success
  save: {{said: result.message}}
  {more}
"""


@pytest.fixture
def network() -> VirtualNetwork:
    return VirtualNetwork()


def test_an_answer_that_is_not_expected_fails_and_is_tried_again(
    load: Load, network: VirtualNetwork
) -> None:
    answers = [False, False, False, True]
    asked: list[bool] = []

    def answer(request: SetBool.Request) -> SetBool.Response:
        asked.append(request.data)
        return SetBool.Response(success=answers.pop(0), message="set")

    network.provide(SetBool, "switch", answer)
    root = load(CALL.format(more="retry: 2"))
    assert VirtualRunner(root, network).run() is Status.FAILURE
    assert root.feedback_message.startswith("result.success was expected, but the answer is: {")
    assert (asked, tree_outputs(root)) == ([True, True], {})
    root = load(CALL.format(more="retry: {attempts: 2, backoff: 5 s}"))
    runner = VirtualRunner(root, network)
    began = runner.now
    assert runner.run() is Status.SUCCESS
    assert runner.now - began > 5.0
    assert (len(asked), tree_outputs(root)) == (4, {"said": "set"})


def test_a_service_that_does_not_answer_fails_in_time(load: Load, network: VirtualNetwork) -> None:
    network.provide(SetBool, "switch", lambda _: SetBool.Response(success=True), takes=60.0)
    root = load(CALL.format(more="timeout: 100 ms"))
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.FAILURE
    assert root.feedback_message == "no answer within 0.1 s"
    assert runner.now < 0.2


def test_a_time_that_another_one_follows_is_not_told_as_what_is_left(
    load: Load, network: VirtualNetwork
) -> None:
    runner = VirtualRunner(load(CALL.format(more="timeout: 9 s")), network)
    runner.start()
    runner.advance(0.5)
    assert runner.state.nodes[1].due_in is None, "it waits for the service, then for the answer"
    network.provide(SetBool, "switch", lambda _: SetBool.Response(success=True), takes=60.0)
    runner = VirtualRunner(load(CALL.format(more="timeout: 9 s")), network)
    runner.start()
    runner.advance(0.5)
    assert runner.state.nodes[1].due_in == 9.0


NUMBERS = """
tree: t
outputs: {{n: int8}}
root:
  parallel: P
  children:
    - wait_for_message: W
      topic: count
      type: std_msgs/msg/Int32
      until: message.data > 1
      save: {{n: message.data}}
      timeout: 500 ms
    - sequence: S
      children:
        - {{publish: count, type: std_msgs/msg/Int32, message: {{data: 1}}}}
        - {{publish: count, type: std_msgs/msg/Int32, message: {{data: {last}}}}}
"""


def test_a_message_is_waited_for_and_kept(load: Load, network: VirtualNetwork) -> None:
    root = load(NUMBERS.format(last=2))
    assert VirtualRunner(root, network).run() is Status.SUCCESS
    assert tree_outputs(root) == {"n": 2}


def test_a_message_that_does_not_fit_into_its_variable_is_not_the_one_waited_for(
    load: Load, network: VirtualNetwork
) -> None:
    """Anybody may send 300 where an int8 is kept; that ends no run."""
    root = load(NUMBERS.format(last=300))
    assert VirtualRunner(root, network).run() is Status.FAILURE
    assert root.children[0].feedback_message.startswith("no such message")


def test_a_visit_begins_when_no_topic_is_waited_for_any_more(
    load: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bt_actions.behaviours.topics import TopicValue

    left = [0.3]
    monkeypatch.setattr(TopicValue, "first_may_come", lambda _self: left[0])
    root: Any = load(
        """
        tree: t
        topics: {limit: {topic: limit, type: std_msgs/msg/Float64}}
        root: {timeout: T, after: $limit.data, child: {running: R}}
        """
    )
    begun: list[Status] = []
    initialise = root.initialise
    root.initialise = lambda: (begun.append(root.status), initialise())
    for _ in range(2):
        root.tick_once()
        assert (root.status, root.due_in()) == (Status.RUNNING, 0.3)
    root.stop(Status.INVALID)
    root.tick_once()
    assert (root.status, begun) == (Status.RUNNING, [])
    left[0] = 0.0
    root.tick_once()
    assert begun == [Status.INVALID], "as the first tick of any visit"


def test_a_message_is_published_when_so_many_listen(load: Load, network: VirtualNetwork) -> None:
    root = load(
        """
        tree: t
        root:
          publish: lamp
          type: std_msgs/msg/Bool
          message: {data: true}
          subscribers: 2
          timeout: 20 s
        """
    )
    heard: list[bool] = []
    runner = VirtualRunner(root, network)
    runner.start()
    for _ in range(2):
        assert runner.advance(1.0) is None
        network.subscribe(Bool, "lamp", lambda message: heard.append(message.data))
    assert runner.advance(1.0) is Status.SUCCESS
    assert heard == [True, True]


FAULTS = ["move_robot:1:ignore_cancel"]
TIMEOUT = """
tree: t
root:
  fallback: F
  children:
    - timeout: T
      after: 5 s
      child:
        action: A
        type: robot_control_interfaces/action/MoveRobot
        server: move_robot
        goal: {distance: 10.0}
        timeout: {result: none, cancel: 20 s}
    - log: Ring the alarm
"""


@pytest.mark.parametrize(
    ("takes", "ended_at", "told"),
    [
        (10.0, 10.0, "not done within 5 s"),
        (60.0, 25.0, "not done within 5 s; the end of A is not known"),
    ],
)
def test_timeout_waits_for_the_end_of_the_goal_it_stopped_but_not_for_ever(
    load: Load, network: VirtualNetwork, takes: float, ended_at: float, told: str
) -> None:
    script = Script(duration=takes)
    server = ScriptedServer(network, MoveRobot, "move_robot", script, faults=FAULTS)
    root = load(TIMEOUT)
    runner = VirtualRunner(root, network)
    assert runner.run() is Status.SUCCESS
    stopped = root.children[0]
    assert stopped.feedback_message == told
    number = runner.state.nodes[1].children[0]
    changes = [e for e in runner.events if isinstance(e, NodeChanged) and e.node == number]
    ends = [each.at.steady for each in changes if each.status is Status.FAILURE]
    assert ends == pytest.approx([ended_at], abs=0.5)
    assert len(runner.unaccounted) == len(server.live_goals) == (1 if "known" in told else 0)
