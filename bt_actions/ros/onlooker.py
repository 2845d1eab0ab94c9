"""A cleanup's view of a ROS domain: the actions in sight, their running goals, requests to cancel.

The view needs no action type, and knows of nobody's goals. Nobody spins the node: its messages are
taken by hand. Decides nothing (recovery/sweep.py).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from unique_identifier_msgs.msg import UUID

from bt_actions.ros.graph import servers
from bt_actions.ros.naming import passing_node

NODE = "bt_actions_cleanup"
STATUS = "/_action/status"
"""The end of the name of an action's status topic."""
DEPTH = 100
"""The depth of our ends: with 1, the status of one server would displace that of another."""


class ActionView:
    """One action, as one node sees it from now on; arrived messages are taken by hand."""

    def __init__(self, node: Node, action: str) -> None:
        self._node = node
        self._action = action
        # In this order: a server that drops us half-way answers nothing, rather than tell nothing.
        self._client = node.create_client(
            CancelGoal,
            f"{action}/_action/cancel_goal",
            qos_profile=QoSProfile(depth=DEPTH),
        )
        self._status = node.create_subscription(
            GoalStatusArray,
            action + STATUS,
            lambda _: None,
            QoSProfile(
                depth=DEPTH,
                durability=DurabilityPolicy.TRANSIENT_LOCAL,
            ),
        )

    def servers(self) -> frozenset[bytes]:
        """Return the GIDs of the servers in sight."""
        return servers(self._node, self._action)

    def statuses(self) -> Iterator[Any]:
        """Take the statuses that have arrived."""
        handle = self._status.handle
        with handle:
            while (taken := handle.take_message(GoalStatusArray, False)) is not None:
                yield taken[0]

    def answers(self) -> Iterator[tuple[int, int]]:
        """Take the answers that have arrived: the number of the question, and the return code.

        rclpy's futures hear the first answer alone, where each server gives one.
        """
        handle = self._client.handle
        with handle:
            while (taken := handle.take_response(CancelGoal.Response))[0] is not None:
                header, response = taken
                yield header.request_id.sequence_number, response.return_code

    def cancel(self, goal_id: bytes) -> int | None:
        """Ask all servers to cancel a goal; return the question's number, None without a server."""
        if not self._client.service_is_ready():
            return None
        request = CancelGoal.Request()
        request.goal_info.goal_id = UUID(uuid=list(goal_id))
        handle = self._client.handle
        with handle:
            return int(handle.send_request(request))


class CannotStart(RuntimeError):
    """ROS 2 that cannot start, for a domain id that is none, say."""


class Onlooker:
    """The sight of one participant."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.domain = int(node.context.get_domain_id())

    def actions(self) -> list[str]:
        """Return the names of the actions that anybody serves, or is a client of."""
        topics = [topic for topic, _types in self.node.get_topic_names_and_types()]
        return [topic.removesuffix(STATUS) for topic in topics if topic.endswith(STATUS)]


@contextlib.contextmanager
def onlooker() -> Iterator[Onlooker]:
    """Look from a node in a context of its own, whose names nothing remaps. Raises CannotStart."""
    with contextlib.ExitStack() as stack:
        try:
            node = stack.enter_context(passing_node(NODE, use_global_arguments=False))
        except (RuntimeError, OSError) as error:
            raise CannotStart(str(error).splitlines()[0]) from error
        yield Onlooker(node)
