"""When goals go out and results come in, seen at rclpy's C++ client, which both sides use."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.impl.implementation_singleton import rclpy_implementation

SUCCEEDED = GoalStatus.STATUS_SUCCEEDED


class Wire:
    """Keeps the moments of all clients in this process from now on."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        """Stand before the two methods."""
        self.sent: list[float] = []
        """When each goal was handed over."""
        self.taken: list[float] = []
        """When each result had been taken."""
        client = rclpy_implementation.ActionClient
        send, take = client.send_goal_request, client.take_result_response

        def send_goal_request(handle: Any, request: Any) -> Any:
            self.sent.append(clock())
            return send(handle, request)

        def take_result_response(handle: Any, kind: Any) -> Any:
            answer = take(handle, kind)
            if answer[1] is not None and answer[1].status == SUCCEEDED:
                self.taken.append(clock())
            return answer

        client.send_goal_request = send_goal_request
        client.take_result_response = take_result_response

    def figures(self, goals: int) -> dict[str, float]:
        """Milliseconds an action, without the first, which also waits for discovery; and the gaps.

        A gap is from a result's taking to the sending of the next goal.
        """
        assert len(self.sent) == len(self.taken) == goals
        pairs = zip(self.taken, self.sent[1:], strict=False)
        gaps = sorted(1e3 * (sent - taken) for taken, sent in pairs)
        return {
            "an action": 1e3 * (self.taken[-1] - self.taken[0]) / (goals - 1),
            "p50": gaps[len(gaps) // 2],
            "p99": gaps[int(len(gaps) * 0.99)],
        }
