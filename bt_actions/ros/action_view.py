"""One action as a cleanup sees it: who serves it, what it says it runs, and requests to cancel.

Needs no action type, and knows of nobody's goals. Decides nothing: cleanup.py does.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from unique_identifier_msgs.msg import UUID

from bt_actions.ros.graph import servers

STATUS = "/_action/status"
"""What the name of an action's status topic ends with."""
DEPTH = 100
"""Of our ends: with a depth of 1 the status of one server would displace that of another."""


class ActionView:
    """One action, as one node sees it; what has come in is taken by hand, nobody spins."""

    def __init__(self, node: Node, action: str) -> None:
        self._node = node
        self._action = action
        # In this order: a server that drops us half-way answers nothing, rather than tell nothing.
        self._client = node.create_client(
            CancelGoal,
            f"{action}/_action/cancel_goal",
            qos_profile=QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE),
        )
        self._status = node.create_subscription(
            GoalStatusArray,
            action + STATUS,
            lambda _: None,
            QoSProfile(
                depth=DEPTH,
                reliability=ReliabilityPolicy.RELIABLE,
                durability=DurabilityPolicy.TRANSIENT_LOCAL,
            ),
        )

    def servers(self) -> frozenset[bytes]:
        """Return the GIDs of the servers that are shown."""
        return servers(self._node, self._action)

    def is_published(self) -> bool:
        """Whether a status is; where it is not, there are mere clients."""
        return bool(self._node.count_publishers(self._action + STATUS))

    def statuses(self) -> Iterator[Any]:
        """Take the statuses that have come in."""
        handle = self._status.handle
        with handle:
            for _ in range(DEPTH):
                taken = handle.take_message(GoalStatusArray, False)
                if taken is None:
                    return
                yield taken[0]

    def answers(self) -> Iterator[tuple[int, int]]:
        """Take the answers that have come in: the number of the question, and the return code.

        rclpy's futures hear the first answer alone, where each server gives one.
        """
        handle = self._client.handle
        with handle:
            for _ in range(DEPTH):
                header, response = handle.take_response(CancelGoal.Response)
                if header is None:
                    return
                yield header.request_id.sequence_number, response.return_code

    def cancel(self, goal_id: bytes) -> int | None:
        """Ask all servers to cancel this goal; return the question's number, None: nobody hears."""
        if not self._client.service_is_ready():
            return None
        request = CancelGoal.Request()
        request.goal_info.goal_id = UUID(uuid=list(goal_id))
        handle = self._client.handle
        with handle:
            return int(handle.send_request(request))
