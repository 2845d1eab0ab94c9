"""A plain rclpy client of a server of trees, which is spun while it waits."""

from __future__ import annotations

from typing import Any

from action_msgs.srv import CancelGoal
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import Rejection
from bt_actions_interfaces.srv import CheckTree, ControlTree, ListTrees
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from tests.support.waiting import until

PATIENCE = 20.0


class TreeClient:
    """Sends RunTree goals to the server in a namespace, and calls its services."""

    def __init__(self, context: Any, space: str, server: str = "bt_actions_serve") -> None:
        self.node = Node("tree_client", context=context, namespace=space)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self._actions = ActionClient(self.node, RunTree, "run_tree")
        self._cancels = self.node.create_client(CancelGoal, "run_tree/_action/cancel_goal")
        self._services = {
            kind: self.node.create_client(kind, f"{server}/{name}")
            for kind, name in (
                (ListTrees, "list_trees"),
                (CheckTree, "check_tree"),
                (ControlTree, "control_tree"),
            )
        }
        self.rejections: list[Rejection] = []
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(
            Rejection, f"{server}/rejections", self.rejections.append, latched
        )

    def close(self) -> None:
        self.executor.shutdown()
        self._actions.destroy()
        self.node.destroy_node()

    def until(self, condition: Any, what: str = "", within: float = PATIENCE) -> Any:
        """Spin until a condition holds."""

        def spin() -> None:
            self.executor.spin_once(timeout_sec=0.05)

        return until(condition, within, what=what, meanwhile=spin)

    def begin(self, tree: str, inputs: str = "", goal_name: str = "") -> Any:
        """Send a goal, without waiting for its answer."""
        self.until(self._actions.server_is_ready, "the server of trees is there")
        goal = RunTree.Goal(tree=tree, inputs=inputs, goal_name=goal_name)
        sent = Sent()
        sent.request = self._actions.send_goal_async(
            goal, feedback_callback=lambda message: sent.feedback.append(message.feedback)
        )
        return sent

    def send(self, tree: str, inputs: str = "", goal_name: str = "") -> Sent:
        """Send a goal, and wait until it is accepted or rejected."""
        return self.accepted(self.begin(tree, inputs, goal_name))

    def accepted(self, sent: Sent) -> Sent:
        """Wait until a goal is accepted or rejected."""
        self.until(sent.request.done, "the goal is answered")
        sent.handle = sent.request.result()
        if sent.handle.accepted:
            sent.result_future = sent.handle.get_result_async()
        return sent

    def result(self, sent: Sent) -> tuple[int, RunTree.Result]:
        """Wait for the end of a goal; its status and result."""
        self.until(sent.result_future.done, "the goal has ended")
        answer = sent.result_future.result()
        return answer.status, answer.result

    def told(self, sent: Sent) -> tuple[int, int, bool]:
        """Status, error code, and whether it is settled, of a goal that ends."""
        status, result = self.result(sent)
        return status, result.error_code, result.settled

    def cancel(self, sent: Sent) -> int:
        """Ask to cancel a goal; how many are being canceled."""
        future = sent.handle.cancel_goal_async()
        self.until(future.done, "the cancel is answered")
        return len(future.result().goals_canceling)

    def begin_cancel(self, goal_id: bytes) -> Any:
        """Ask to cancel a goal by its id, without waiting for the answer."""
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(goal_id)
        return self._cancels.call_async(request)

    def call(self, kind: type, **fields: Any) -> Any:
        """Call a service."""
        future = self.begin_call(kind, **fields)
        self.until(future.done, "the call is answered")
        return future.result()

    def begin_call(self, kind: type, **fields: Any) -> Any:
        """Call a service, without waiting for its answer."""
        service = self._services[kind]
        self.until(service.service_is_ready, "the service is there")
        return service.call_async(kind.Request(**fields))  # type: ignore[attr-defined]


class Sent:
    """A goal that was sent."""

    def __init__(self) -> None:
        self.request: Any = None
        self.handle: Any = None
        self.result_future: Any = None
        self.feedback: list[RunTree.Feedback] = []

    @property
    def accepted(self) -> bool:
        return bool(self.handle.accepted)
