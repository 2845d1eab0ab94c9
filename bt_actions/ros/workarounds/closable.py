"""Publishers, subscriptions and services that may be destroyed while their node is spun.

rclpy's executor may have the event handlers of one in hand, or be about to send an answer, while
another thread destroys it. The spin then ends with InvalidHandle: the whole process stops
listening. rclpy #1150 mended that where messages are taken, and nowhere else. Not needed any more
where tests/ros/test_closable.py sees no InvalidHandle of a plain one. Knows of no topic.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, TypeVar

from rclpy.exceptions import InvalidHandle

Entity = TypeVar("Entity")


def closable(entity: Entity) -> Entity:
    """Return the publisher or subscription, with event handlers that survive their destruction."""
    for handler in entity.event_handlers:  # type: ignore[attr-defined]
        handler.add_to_wait_set = _guarded(handler)
    return entity


def closable_service(service: Any, silent: Callable[[], bool]) -> Any:
    """Return the service, which answers nobody once it is destroyed, nor while it is `silent`.

    rclpy has no way of its own to leave a request unanswered.
    """
    send = service.send_response

    def send_response(*answer: Any) -> None:
        with contextlib.suppress(InvalidHandle):
            if not silent():
                send(*answer)

    service.send_response = send_response
    return service


def _guarded(handler: Any) -> Any:
    add = handler.add_to_wait_set

    def add_to_wait_set(wait_set: Any) -> None:
        try:
            add(wait_set)
        except InvalidHandle:
            handler._event_index = None  # noqa: SLF001 - or it would look at another's event

    return add_to_wait_set
