"""Services and topics in trees, on real rclpy: the servers are on the node that the tree uses."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions import TreeRunner
from bt_actions.document import tree_outputs
from tests.support.simulated_time import SimulatedTime
from tests.support.waiting import holds_for, until

Load = Callable[..., Behaviour]
Run = Callable[..., Any]


@pytest.fixture
def switch(node: Any, name: str) -> Iterator[tuple[str, list[bool], list[bool]]]:
    """A service that tells what it was asked, and answers what it is told to."""
    from std_srvs.srv import SetBool

    asked: list[bool] = []
    answers: list[bool] = []

    def answer(request: Any, response: Any) -> Any:
        asked.append(request.data)
        response.success = answers.pop(0) if answers else True
        response.message = f"set to {request.data}"
        return response

    service = node.create_service(SetBool, f"{name}/switch", answer)
    yield f"{name}/switch", asked, answers
    node.destroy_service(service)


CALL = """
tree: t
inputs: {{on: {{type: bool, default: true}}}}
outputs: {{said: string}}
root:
  service: Switch
  type: std_srvs/srv/SetBool
  server: {server}
  request: {{data: $on}}
  expect: result.success
  save: {{said: result.message}}
  {more}
"""


def test_a_service_is_called_and_its_answer_saved(
    load: Load, run: Run, switch: Any, executor: str
) -> None:
    server, asked, _ = switch
    root = run(load(CALL.format(server=server, more="")), executor=executor)
    assert (root.status, asked) == (Status.SUCCESS, [True])
    assert tree_outputs(root) == {"said": "set to True"}


def test_a_message_that_does_not_fit_into_its_variable_is_not_the_one_waited_for(
    load: Load, run: Run, name: str
) -> None:
    """Anybody may send 300 where an int8 is kept; that ends no run."""
    root = run(
        load(
            f"""
            tree: t
            outputs: {{n: int8}}
            root:
              parallel: P
              children:
                - wait_for_message: Small
                  topic: {name}/count
                  type: std_msgs/msg/Int32
                  save: {{n: message.data}}
                  timeout: 500 ms
                  qos: latched
                - publish: {name}/count
                  type: std_msgs/msg/Int32
                  message: {{data: 300}}
                  qos: latched
            """
        )
    )
    assert root.status is Status.FAILURE
    assert root.children[0].feedback_message.startswith("no such message")


def test_an_answer_that_is_not_expected_fails_and_is_tried_again(
    load: Load, run: Run, switch: Any
) -> None:
    server, asked, answers = switch
    answers += [False, False]
    root = run(load(CALL.format(server=server, more="retry: 2")))
    assert (root.status, len(asked)) == (Status.FAILURE, 2)
    assert root.feedback_message == "the answer is not what was expected"
    answers += [False]
    root = run(load(CALL.format(server=server, more="retry: {attempts: 2, backoff: 10 ms}")))
    assert (root.status, len(asked)) == (Status.SUCCESS, 4)


def test_a_service_that_is_not_there_fails_in_time(load: Load, run: Run, name: str) -> None:
    more = "timeout: {server: 200 ms}"
    root = run(load(CALL.format(server=f"{name}/nobody", more=more)))
    assert root.status is Status.FAILURE
    assert root.feedback_message == f"no service {name}/nobody within 0.2 s: nobody offers it"


def test_a_service_that_does_not_answer_fails_in_time(
    load: Load, node: Any, name: str, run: Run
) -> None:
    from std_srvs.srv import SetBool

    over = threading.Event()

    def never(_request: Any, _response: Any) -> Any:
        over.wait(10.0)  # a server that hangs, until the test is over
        return _response

    service = node.create_service(SetBool, f"{name}/slow", never)
    threading.Timer(0.5, over.set).start()  # the executor waits for the callback to return
    root = run(load(CALL.format(server=f"{name}/slow", more="timeout: 100 ms")))
    assert root.status is Status.FAILURE
    assert root.feedback_message == "no answer within 0.1 s"
    node.destroy_service(service)


TOPICS = """
tree: t
topics:
  door: {{topic: {topic}, type: std_msgs/msg/Bool, qos: latched{more}}}
outputs: {{seen: bool}}
root:
  {root}
"""
PUBLISH = "{{publish: {topic}, type: std_msgs/msg/Bool, message: {{data: true}}, qos: latched}}"


def test_a_message_that_is_published_is_read_as_a_variable(
    load: Load, run: Run, name: str, executor: str
) -> None:
    topic = f"{name}/door"
    children = [PUBLISH.format(topic=topic), "{wait_until: $door.data, timeout: 10 s}",
                "{set: {seen: $door.data}}"]  # fmt: skip
    text = TOPICS.format(
        topic=topic, more="", root=f"{{sequence: S, children: [{', '.join(children)}]}}"
    )
    root = run(load(text), executor=executor)
    assert (root.status, tree_outputs(root)) == (Status.SUCCESS, {"seen": True})


def test_a_topic_on_which_nothing_came_fails_a_check(load: Load, run: Run, name: str) -> None:
    root = run(load(TOPICS.format(topic=f"{name}/door", more="", root="check: $door.data")))
    assert root.status is Status.FAILURE
    assert root.feedback_message == f"nothing has come on {name}/door yet ($door)"


def test_a_message_that_is_too_old_fails_a_check(load: Load, run: Run, name: str) -> None:
    topic = f"{name}/door"
    children = [PUBLISH.format(topic=topic), "{wait_until: $door.data, timeout: 10 s}",
                "{wait: 1200 ms}", "{check: $door.data}"]  # fmt: skip
    text = TOPICS.format(
        topic=topic,
        more=", max_age: 1 s",
        root=f"{{sequence: S, children: [{', '.join(children)}]}}",
    )
    root = run(load(text))
    assert root.status is Status.FAILURE
    assert "s old ($door)" in root.children[-1].feedback_message


@pytest.fixture
def paced(context: Any, no_leaks: None) -> Iterator[tuple[SimulatedTime, Any]]:
    """Simulated time, and a node that goes by it as soon as somebody spins it."""
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    clock = SimulatedTime(context)
    by_it = [Parameter("use_sim_time", value=True)]
    node = Node("on_simulated_time", context=context, parameter_overrides=by_it)
    yield clock, node
    node.destroy_node()
    clock.close()


WATCHING = """{{sequence: S, children: [
  {publish}, {{wait_until: $door.data, timeout: 10 s}},
  {{while: $door.data, child: {{running: R}}}}]}}"""


def watching(load: Load, topic: str, max_age: str) -> Behaviour:
    """A tree that publishes a message, and runs until it has become too old."""
    root = WATCHING.format(publish=PUBLISH.format(topic=topic))
    return load(TOPICS.format(topic=topic, more=f", max_age: {max_age}", root=root))


def test_the_age_of_a_message_is_that_of_the_node_s_clock(
    load: Load, name: str, paced: tuple[SimulatedTime, Any]
) -> None:
    clock, node = paced
    root = watching(load, f"{name}/door", "60 s")
    with TreeRunner(root, node=node) as runner:
        runner.start()
        guard = root.children[-1]
        until(lambda: node.get_clock().now().nanoseconds > 0, what="simulated time has begun")
        until(lambda: guard.status is Status.RUNNING, what="a fresh message was seen")
        for jump in (0.0, 30.0, -1000.0, 10.0):  # one back makes it neither younger nor older
            clock.jump(jump)
            assert holds_for(lambda: guard.status is Status.RUNNING, 0.5)
        clock.jump(20.0)
        assert runner.wait(10.0) is Status.FAILURE
    assert "s old ($door)" in guard.feedback_message


def test_a_message_grows_no_older_while_simulated_time_is_paused(
    load: Load, name: str, paced: tuple[SimulatedTime, Any]
) -> None:
    clock, node = paced
    clock.rate = 0.0
    root = watching(load, f"{name}/door", "500 ms")
    with TreeRunner(root, node=node) as runner:
        runner.start()
        guard = root.children[-1]
        until(lambda: guard.status is Status.RUNNING, what="a fresh message was seen")
        assert holds_for(lambda: guard.status is Status.RUNNING, 1.0)
        clock.rate = 1.0
        assert runner.wait(10.0) is Status.FAILURE


def test_a_message_is_waited_for_and_kept(load: Load, run: Run, name: str) -> None:
    topic = f"{name}/count"
    root = run(
        load(
            f"""
            tree: t
            outputs: {{n: int32}}
            root:
              parallel: P
              children:
                - wait_for_message: Two
                  topic: {topic}
                  type: std_msgs/msg/Int32
                  until: message.data > 1
                  timeout: 10 s
                  save: {{n: message.data}}
                - repeat: R
                  times: 30
                  child:
                    sequence: S
                    children:
                      - publish: {topic}
                        type: std_msgs/msg/Int32
                        message: {{data: 1}}
                      - publish: {topic}
                        type: std_msgs/msg/Int32
                        message: {{data: 2}}
                      - wait: 20 ms
            """
        )
    )
    assert (root.status, tree_outputs(root)) == (Status.SUCCESS, {"n": 2})


def test_a_message_that_fits_is_found_though_others_follow_it_before_the_next_tick(
    node: Any, name: str
) -> None:
    from rclpy.executors import SingleThreadedExecutor
    from std_msgs.msg import Int32

    from bt_actions.behaviours.topics import WaitForMessage
    from bt_actions.ros.topics import KEPT, Latest

    waits = WaitForMessage("w", Int32, name, until=lambda message: message.data == 2)
    waits.setup(node=node)
    seen = Latest(node, Int32, name, "default")
    publisher = node.create_publisher(Int32, name, 10)
    until(lambda: publisher.get_subscription_count() == 2)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def publish(number: int) -> None:
        publisher.publish(Int32(data=number))
        until(
            lambda: all(
                getattr(topic.get()[0], "data", None) == number for topic in (seen, waits._latest)
            ),
            meanwhile=lambda: executor.spin_once(timeout_sec=0.01),
        )

    publish(2)  # before it waits
    waits.tick_once()
    for number in (1, 2, 3):
        publish(number)
    assert waits.status is Status.RUNNING
    waits.tick_once()
    assert waits.status is Status.SUCCESS
    publish(4)
    assert waits._latest is not None
    assert waits._latest.take() == [], "nobody waits any longer"
    seen.keep()
    for number in range(KEPT + 2):
        publish(number)
    assert [message.data for message in seen.take()] == list(range(2, KEPT + 2))
    executor.shutdown()
    node.executor = None
    seen.close()
    waits.shutdown()
    node.destroy_publisher(publisher)


def test_a_message_that_does_not_come_fails_in_time(load: Load, run: Run, name: str) -> None:
    text = (
        "tree: t\nroot: {wait_for_message: W, topic: %s, type: std_msgs/msg/Bool, timeout: 50 ms}"
    )
    root = run(load(text % f"{name}/door"))
    assert root.status is Status.FAILURE
    assert root.feedback_message == f"no such message on {name}/door within 0.05 s"


def test_timeout_waits_until_the_goal_it_stopped_has_ended(
    load: Load, node: Any, host: Any, name: str
) -> None:
    journal = host.open(name, "2:ignore_cancel")
    action = f"type: robot_control_interfaces/action/MoveRobot, server: {name}"
    root = load(
        f"""
        tree: t
        root:
          sequence: S
          children:
            - {{action: Find the server, {action}, goal: {{distance: 0.01}}, timeout: 30 s}}
            - timeout: T
              after: 500 ms
              child: {{action: A, {action}, goal: {{distance: 2.0}}}}
        """
    )
    stopped = root.children[1]
    drained: list[bool] = []

    def look(event: Any) -> None:
        if getattr(event, "node", None) is stopped and event.status is Status.FAILURE:
            drained.append(stopped.children[0].drained)  # type: ignore[attr-defined]

    with TreeRunner(root, node=node) as runner:
        runner.observe(look)
        runner.run(timeout=60)
    assert drained == [True]
    assert journal.events()[-1] == "succeeded"
    assert stopped.feedback_message == "not done within 0.5 s"
    host.close_server(name)


def test_timeout_does_not_wait_for_ever_for_a_goal_that_does_not_end(
    load: Load, node: Any, host: Any, name: str
) -> None:
    journal = host.open(name, "*:ignore_cancel", "*:stall")
    root = load(
        f"""
        tree: t
        root:
          fallback: F
          children:
            - timeout: T
              after: 5 s
              child:
                action: A
                type: robot_control_interfaces/action/MoveRobot
                server: {name}
                goal: {{distance: 10.0}}
                timeout: {{result: none, cancel: 500 ms}}
            - log: Ring the alarm
        """
    )
    stopped = root.children[0]
    with TreeRunner(root, node=node) as runner:
        assert runner.run(timeout=60) is Status.SUCCESS
        assert [report.server for report in runner.unaccounted] == [name]
    assert stopped.feedback_message == "not done within 5 s; the end of A is not known"
    assert journal.ends() == [None], "it still runs, as far as the server is concerned"
    host.close_server(name)
