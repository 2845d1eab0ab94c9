"""Publishers and subscriptions that may be destroyed while their node is spun.

rclpy's executor may have the event handlers of one in hand while another thread destroys it, and
its spin then ends with InvalidHandle: the whole process stops listening. rclpy #1150 mended that
where messages are taken, and not for event handlers. Not needed any more where
tests/ros/test_closable.py sees no InvalidHandle of a plain one. Knows of no topic.
"""

from __future__ import annotations

from typing import Any, TypeVar

from rclpy.exceptions import InvalidHandle

Entity = TypeVar("Entity")


def closable(entity: Entity) -> Entity:
    """Return the publisher or subscription, with event handlers that survive their destruction."""
    for handler in entity.event_handlers:  # type: ignore[attr-defined]
        handler.add_to_wait_set = _guarded(handler)
    return entity


def _guarded(handler: Any) -> Any:
    add = handler.add_to_wait_set

    def add_to_wait_set(wait_set: Any) -> None:
        try:
            add(wait_set)
        except InvalidHandle:
            handler._event_index = None  # noqa: SLF001 - or it would look at another's event

    return add_to_wait_set
