"""An action server out of plain services, that answers as neither rclpy's nor rclcpp's would.

It accepts every goal, publishes that it executes, and has neither feedback nor an end of its own: a
goal runs until it is canceled.
"""

from __future__ import annotations

import threading
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default
from robot_control_interfaces.action import MoveRobot

LIVE, CANCELED = GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELED


class HandWrittenServer:
    """Serves on a node and a thread of its own until it is closed.

    `answer` is the status that it gives at once to a question for the result of a goal that runs:
    EXECUTING, or 0 for "no such goal".
    """

    def __init__(self, context: Any, name: str, answer: int) -> None:
        self.statuses: dict[bytes, int] = {}
        self.asked = 0
        self.most_live = 0
        self._answer = answer
        self._node = Node("hand_written", context=context)
        services = {
            "send_goal": (MoveRobot.Impl.SendGoalService, self._goal),
            "cancel_goal": (CancelGoal, self._cancel),
            "get_result": (MoveRobot.Impl.GetResultService, self._result),
        }
        for word, (kind, callback) in services.items():
            self._node.create_service(kind, f"{name}/_action/{word}", callback)
        self._node.create_publisher(MoveRobot.Impl.FeedbackMessage, f"{name}/_action/feedback", 10)
        self._publisher = self._node.create_publisher(
            GoalStatusArray, f"{name}/_action/status", qos_profile_action_status_default
        )
        self._timer = self._node.create_timer(0.2, self._publish)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def close(self) -> None:
        """Serve no more."""
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()

    def _goal(self, request: Any, response: Any) -> Any:
        self.statuses[bytes(request.goal_id.uuid)] = LIVE
        live = sum(status == LIVE for status in self.statuses.values())
        self.most_live = max(self.most_live, live)
        response.accepted = True
        return response

    def _cancel(self, request: Any, response: Any) -> Any:
        goal_id = bytes(request.goal_info.goal_id.uuid)
        if self.statuses.get(goal_id) == LIVE:
            self.statuses[goal_id] = CANCELED
            response.goals_canceling = [request.goal_info]
            self._publish()
        return response

    def _result(self, request: Any, response: Any) -> Any:
        self.asked += 1
        status = self.statuses.get(bytes(request.goal_id.uuid), 0)
        response.status = self._answer if status == LIVE else status
        return response

    def _publish(self) -> None:
        message = GoalStatusArray()
        for goal_id, status in self.statuses.items():
            entry = GoalStatus(status=status)
            entry.goal_info.goal_id.uuid = list(goal_id)
            message.status_list.append(entry)
        self._publisher.publish(message)
