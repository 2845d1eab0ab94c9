"""Whether what is of ROS is there, asked without the locks that rclpy holds as it calls back."""

from __future__ import annotations

from typing import Any

from rclpy.exceptions import InvalidHandle


def is_valid(node: Any) -> bool:
    """Whether the node is there, and its context was not shut down."""
    try:
        with node.handle:
            return is_open(node.context)
    except InvalidHandle:  # it was destroyed
        return False


def is_open(context: Any) -> bool:
    """Whether the context was initialised, and not shut down.

    Context.ok() would take the context's lock, which rclpy holds while it calls back on shutdown.
    """
    handle = context.handle
    if handle is None:
        return False
    try:
        with handle:
            return bool(handle.ok())
    except InvalidHandle:
        return False
