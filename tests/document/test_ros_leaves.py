"""Services and topics in trees, on real rclpy: the servers are on the node that the tree uses."""

from __future__ import annotations

import time
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
    root = load(CALL.format(server=server, more=""))
    assert root.due_in()  # type: ignore[attr-defined]
    root.stop(Status.INVALID)  # before it is set up
    run(root, executor=executor)
    assert (root.status, asked) == (Status.SUCCESS, [True])
    assert tree_outputs(root) == {"said": "set to True"}


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


@pytest.fixture(scope="module")
def stranger(domain: int) -> Iterator[Any]:
    """A node in another participant: within one, rmw_fastrtps refuses a second type of a name."""
    from rclpy.context import Context
    from rclpy.node import Node

    from bt_actions.ros.workarounds.participant import close

    context = Context()
    context.init(domain_id=domain)
    node = Node("stranger", context=context)
    yield node
    close(node)


FOREIGN = [
    ("String", "default", "default", "{what} is std_msgs/msg/String, not std_msgs/msg/Bool"),
    ("Bool", "best_effort", "default", "{what} is best effort, write 'qos: best_effort'"),
    ("Bool", "default", "latched", "{what} is not latched, write 'qos: default'"),
]


@pytest.mark.parametrize(("kind", "theirs", "ours", "said"), FOREIGN)
def test_who_publishes_in_vain_is_told_where_no_message_comes(
    load: Load,
    run: Run,
    node: Any,
    stranger: Any,
    name: str,
    kind: str,
    theirs: str,
    ours: str,
    said: str,
) -> None:
    import std_msgs.msg

    from bt_actions.ros.connections import qos_profile

    cls = getattr(std_msgs.msg, kind)
    publisher = stranger.create_publisher(cls, f"{name}/door", qos_profile(theirs))
    until(lambda: node.count_publishers(f"{name}/door"))
    root = run(
        load(
            f"""
            tree: t
            root: {{wait_for_message: W, topic: {name}/door, type: std_msgs/msg/Bool,
                   timeout: 50 ms, qos: {ours}}}
            """
        )
    )
    stranger.destroy_publisher(publisher)
    why = said.format(what="what is published there")
    assert root.feedback_message == f"no such message on {name}/door within 0.05 s: {why}"


def test_a_topic_of_the_same_type_in_another_namespace_is_told(
    load: Load, run: Run, node: Any, name: str
) -> None:
    from std_msgs.msg import Bool

    publisher = node.create_publisher(Bool, f"{name}/left/door", 10)
    root = run(load(TOPICS.format(topic=f"{name}/door", more="", root="check: $door.data")))
    node.destroy_publisher(publisher)
    assert root.feedback_message == (
        f"no message has come on {name}/door yet ($door): nobody publishes on it; there is"
        f" {name}/left/door of that type"
    )


def test_a_service_of_another_type_or_in_another_namespace_is_told(
    load: Load, run: Run, node: Any, stranger: Any, name: str
) -> None:
    from std_srvs.srv import SetBool, Trigger

    others = [
        stranger.create_service(Trigger, f"{name}/a", lambda _request, response: response),
        stranger.create_service(SetBool, f"{name}/left/b", lambda _request, response: response),
    ]
    until(lambda: node.count_services(f"{name}/a") and node.count_services(f"{name}/left/b"))
    more = "timeout: {server: 300 ms}"
    a, b = (run(load(CALL.format(server=f"{name}/{each}", more=more))) for each in "ab")
    for other in others:
        stranger.destroy_service(other)
    assert a.feedback_message == (
        f"no service {name}/a within 0.3 s: what is there is std_srvs/srv/Trigger,"
        " not std_srvs/srv/SetBool"
    )
    assert b.feedback_message == (
        f"no service {name}/b within 0.3 s: nobody offers it; there is {name}/left/b of that type"
    )


LAMP = "tree: t\nroot: {{publish: {topic}, type: std_msgs/msg/Bool, message: {{data: true}}{more}}}"


@pytest.mark.parametrize(
    ("kind", "needed", "said"),
    [
        ("Bool", 2, "1 of 2 subscribers listen on {topic} after 0.1 s"),
        ("String", 1, f"0 of 1 subscribers listen on {{topic}} after 0.1 s: {FOREIGN[0][-1]}"),
    ],
)
def test_too_few_listeners_fail_in_time_and_are_counted(
    load: Load, run: Run, node: Any, stranger: Any, name: str, kind: str, needed: int, said: str
) -> None:
    import std_msgs.msg

    cls = getattr(std_msgs.msg, kind)
    listener = stranger.create_subscription(cls, name, lambda _message: None, 10)
    until(lambda: node.count_subscribers(name))
    root = run(load(LAMP.format(topic=name, more=f", subscribers: {needed}, timeout: 100 ms")))
    stranger.destroy_subscription(listener)
    said = said.format(topic=name, what="what is asked for there")
    assert (root.status, root.feedback_message) == (Status.FAILURE, said)


@pytest.mark.parametrize("acknowledged", [True, False])
def test_what_was_published_has_a_second_to_arrive_before_its_publisher_goes(
    node: Any, name: str, acknowledged: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    from std_msgs.msg import Bool

    from bt_actions.wiring import backend_of

    speaker: Any = backend_of(node).publisher(Bool, name, "default")
    answers = [True, False, False] if acknowledged else [False] * 1000
    monkeypatch.setattr(speaker._publisher, "wait_for_all_acked", lambda _limit: answers.pop())
    speaker.publish(Bool())
    published_at = time.monotonic()
    speaker.close()
    assert acknowledged == (not answers)
    assert acknowledged == (time.monotonic() - published_at < 0.9)


def test_a_message_that_nobody_listens_to_is_published_with_a_warning_when_the_node_is_not_new(
    load: Load, node: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bt_actions.ros import connections

    new = [0.5]
    monkeypatch.setattr(connections._Topic, "may_come", lambda _topic: new[0])
    hasty: Any = load(LAMP.format(topic=name, more=", subscribers: 1, timeout: 1 ns"))
    root: Any = load(LAMP.format(topic=name, more=""))
    hasty.setup(node=node)
    hasty.tick_once()
    hasty.tick_once()
    assert hasty.status is Status.RUNNING
    root.setup(node=node)
    root.tick_once()
    assert (root.status, root.warning) == (Status.RUNNING, "")
    new[0] = 0.0
    root.tick_once()
    hasty.tick_once()
    assert hasty.status is Status.FAILURE, "it does not wait for discovery any more"
    root.shutdown()
    hasty.shutdown()
    assert (root.status, root.warning) == (Status.SUCCESS, f"nobody listens on {name}")
    assert root.feedback_message == root.warning
