"""Whether what is of ROS is there, asked without the locks that rclpy holds as it calls back."""

from __future__ import annotations

from typing import Any

from rclpy.exceptions import InvalidHandle


def is_valid(node: Any) -> bool:
    """Whether the node is there, and its context was not shut down.

    Context.ok() would take the context's lock, which rclpy holds while it calls back on shutdown.
    """
    try:
        with node.handle, node.context.handle:
            return bool(node.context.handle.ok())
    except InvalidHandle:  # either was destroyed
        return False
