"""What a participant of our own looks for, and how it is taken away."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.action import ActionServer
from rclpy.context import Context
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import String
from test_msgs.action import Fibonacci

from bt_actions import TreeRunner
from bt_actions.recovery.sweep import Cleanup
from bt_actions.ros.arguments import given_by
from bt_actions.ros.naming import server_names
from bt_actions.ros.node_participant import traffic_of
from bt_actions.ros.rediscovery import SecondParticipant
from bt_actions.ros.workarounds import participant
from tests.support.trees import Gate
from tests.support.waiting import holds_for, until


@pytest.fixture
def ours(domain: int) -> Iterator[Node]:
    context = Context()
    context.init(domain_id=domain)
    node = Node("ours", context=context)
    yield node
    participant.close(node)


@pytest.mark.skipif(
    get_rmw_implementation_identifier() != "rmw_fastrtps_cpp", reason="it is about Fast DDS"
)
def test_who_falls_silent_discovers_nobody_any_more(ours: Node, node: Any, name: str) -> None:
    before = node.create_publisher(String, f"{name}/before", 1)
    until(lambda: ours.count_publishers(f"{name}/before"))
    assert participant.fall_silent(ours)
    assert participant.fall_silent(ours), "again does no harm"
    after = node.create_publisher(String, f"{name}/after", 1)
    until(lambda: node.count_publishers(f"{name}/after"))
    assert holds_for(lambda: not ours.count_publishers(f"{name}/after"), 0.3)
    for each in (before, after):
        node.destroy_publisher(each)


def test_a_node_that_is_gone_need_not_fall_silent(domain: int) -> None:
    context = Context()
    context.init(domain_id=domain)
    node = Node("ours", context=context)
    participant.close(node)
    assert not context.ok()
    assert not participant.fall_silent(node)


def test_a_new_one_looks_for_servers_before_a_goal_wants_them(
    ours: Node, node: Any, name: str
) -> None:
    endpoint = traffic_of(ours).endpoint(Fibonacci, name)
    server = ActionServer(node, Fibonacci, name, lambda handle: Fibonacci.Result())
    until(lambda: endpoint.watch.gids)
    server.destroy()


def of_a_runner(_: int) -> None:
    with TreeRunner(Gate()):
        pass


def of_a_rediscovery(domain: int) -> None:
    SecondParticipant(domain, "/").close()


@pytest.mark.parametrize(
    ("come_and_go", "name"),
    [
        (of_a_runner, "bt_actions_"),
        (of_a_rediscovery, "bt_actions_rediscovery_"),
        (lambda _: Cleanup(look=0.1, patience=0.1, wanted=[]).run(), "bt_actions_cleanup"),
        (lambda _: given_by(["-p", "a:=1"], "bt_actions_a"), "bt_actions_"),
        (lambda _: server_names(["a"], "bt_actions_a"), "bt_actions_a"),
    ],
    ids=["runner", "rediscovery", "cleanup", "parameters", "names"],
)
def test_participants_of_our_own_fall_silent_before_they_go(
    monkeypatch: pytest.MonkeyPatch, domain: int, come_and_go: Callable[[int], object], name: str
) -> None:
    seen = list[str]()

    def fall_silent(node: Node) -> bool:
        seen.append(node.get_name())  # it is there
        return True

    monkeypatch.setattr(participant, "fall_silent", fall_silent)
    come_and_go(domain)
    [node] = seen
    assert node.startswith(name)
