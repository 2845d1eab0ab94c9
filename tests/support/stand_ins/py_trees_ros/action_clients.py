"""Leaves that send a goal."""

from __future__ import annotations

from typing import Any

from action_msgs.msg import GoalStatus
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from rclpy.action import ActionClient


class FromConstant(Behaviour):
    """Sends the same goal at each visit, and asks for its cancel at an interruption."""

    def __init__(self, name: str, action_type: Any, action_name: str, action_goal: Any) -> None:
        super().__init__(name)
        self._type, self._server, self._goal = action_type, action_name, action_goal

    def setup(self, **kwargs: Any) -> None:
        self._client: Any = ActionClient(kwargs["node"], self._type, self._server)
        while not self._client.wait_for_server(timeout_sec=3.0):
            pass

    def initialise(self) -> None:
        self.goal_handle: Any = None
        self.result_message: Any = None
        self._client.send_goal_async(self._goal).add_done_callback(self._answered)

    def _answered(self, future: Any) -> None:
        self.goal_handle = future.result()
        if self.goal_handle.accepted:
            self.goal_handle.get_result_async().add_done_callback(self._ended)

    def _ended(self, future: Any) -> None:
        self.result_message = future.result()

    def update(self) -> Status:
        if self.goal_handle is not None and not self.goal_handle.accepted:
            return Status.FAILURE
        if self.result_message is None:
            return Status.RUNNING
        succeeded = self.result_message.status == GoalStatus.STATUS_SUCCEEDED
        return Status.SUCCESS if succeeded else Status.FAILURE

    def terminate(self, new_status: Status) -> None:
        if self.status is Status.RUNNING and new_status is Status.INVALID and self.goal_handle:
            self.goal_handle.cancel_goal_async()
