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
