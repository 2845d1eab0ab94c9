"""What is destroyed while the executor has it in hand."""

from __future__ import annotations

from typing import Any

import pytest


@pytest.mark.parametrize("kind", ["publisher", "subscription"])
def test_event_handlers_survive_the_destruction_of_what_they_watch(
    node: Any, name: str, kind: str
) -> None:
    from rclpy.exceptions import InvalidHandle
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from std_msgs.msg import Empty

    from bt_actions.ros.workarounds.closable import closable

    def make() -> Any:
        if kind == "publisher":
            return node.create_publisher(Empty, f"{name}/topic", 1)
        return node.create_subscription(Empty, f"{name}/topic", lambda message: None, 1)

    def in_hand_while_destroyed(entity: Any) -> Any:
        handler = entity.event_handlers[0]
        wait_set = rclpy_implementation.WaitSet(0, 0, 0, 0, 0, 1, node.context.handle)
        with handler:
            handler.add_to_wait_set(wait_set)
        getattr(node, f"destroy_{kind}")(entity)
        wait_set.clear_entities()
        handler.add_to_wait_set(wait_set)
        return handler.is_ready(wait_set)

    with pytest.raises(InvalidHandle):
        in_hand_while_destroyed(make())
    assert not in_hand_while_destroyed(closable(make()))


@pytest.mark.ros
def test_an_action_server_survives_its_destruction(node: Any, name: str) -> None:
    from rclpy.action.server import ActionServer, RCLError
    from rclpy.exceptions import InvalidHandle
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from test_msgs.action import Fibonacci

    from bt_actions.ros.workarounds.action_server import ClosableActionServer

    def taken_from_while_destroyed(server: Any) -> Any:
        wait_set = rclpy_implementation.WaitSet(0, 20, 20, 20, 20, 20, node.context.handle)
        wait_set.clear_entities()
        server.destroy()
        server.add_to_wait_set(wait_set)
        assert not server.is_ready(wait_set)
        return server.take_data()

    with pytest.raises((InvalidHandle, RCLError)):
        taken_from_while_destroyed(ActionServer(node, Fibonacci, f"{name}/plain", print))
    assert not taken_from_while_destroyed(ClosableActionServer(node, Fibonacci, f"{name}/ours"))


@pytest.mark.ros
def test_a_service_that_is_destroyed_answers_nobody(node: Any, name: str) -> None:
    from rclpy.exceptions import InvalidHandle
    from std_srvs.srv import Trigger

    from bt_actions.ros.workarounds.closable import closable_service

    def answer_after_its_destruction(service: Any) -> None:
        node.destroy_service(service)
        service.send_response(Trigger.Response(), None)

    service = node.create_service(Trigger, f"{name}/plain", print)
    with pytest.raises(InvalidHandle):
        answer_after_its_destruction(service)
    service = node.create_service(Trigger, f"{name}/ours", print)
    answer_after_its_destruction(closable_service(service, lambda: False))
