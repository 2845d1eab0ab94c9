"""A tree offered as an action: each goal of `deliver` runs it, and a cancel request ends it.

In one terminal:    bt-actions sim       (a new one: the part must lie where the robot looks for it)
In another:         python examples/offer.py
In a third:         bt-actions send deliver MoveRobot distance=5.0
"""

from typing import Any

import py_trees
import rclpy
from py_trees.common import Status
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from robot_control_interfaces.action import MoveRobot as Deliver

from bt_actions import Gripper, MoveRobot, TreeRunner


def create_root(shelf_at: float) -> py_trees.behaviour.Behaviour:
    """Return a tree for one goal: no two runners may run the same behaviours."""
    root = py_trees.composites.Sequence("Deliver the part", memory=True)
    root.add_children(
        [
            Gripper("Open", 100.0, timeout=10.0),
            MoveRobot("To the part", 2.0, timeout=30.0),
            Gripper("Grasp", 0.0, timeout=10.0, expect="result.stalled"),
            MoveRobot("To the shelf", shelf_at, timeout=30.0),
            Gripper("Release", 100.0, timeout=10.0),
        ]
    )
    return root


class Deliverer:
    """Serves the action; of its goals as many run at a time as the executor has threads, but one.

    The callback waits for the tree, so another thread of the executor has to bring the answers.
    Where there is none, `start()` the tree in `handle_accepted_callback`, and have a done callback
    of `runner.future` call `goal_handle.execute()`.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._runners: dict[bytes, TreeRunner] = {}
        self._server = ActionServer(
            node,
            Deliver,
            "deliver",
            self._execute,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),  # a cancel request is heard meanwhile
        )

    def _cancel(self, goal_handle: Any) -> CancelResponse:
        """End the run, which cancels what it runs, and waits until that has ended."""
        runner = self._runners.get(bytes(goal_handle.goal_id.uuid))
        if runner is not None:
            runner.interrupt()
        return CancelResponse.ACCEPT

    def _execute(self, goal_handle: Any) -> Deliver.Result:
        """Run a tree, and answer as it ended; what it raises aborts the goal."""
        goal_id = bytes(goal_handle.goal_id.uuid)
        root = create_root(goal_handle.request.distance)
        with TreeRunner(root, node=self._node) as runner:
            self._runners[goal_id] = runner
            try:
                if goal_handle.is_cancel_requested:  # before there was a runner
                    runner.interrupt()
                status = runner.run()
            finally:
                del self._runners[goal_id]
        result = Deliver.Result(message=f"the tree ended with {status.value}")
        for leaf in root.iterate():
            if isinstance(leaf, MoveRobot) and leaf.result is not None:
                result.final_pose = leaf.result.final_pose
        if status is Status.SUCCESS:
            goal_handle.succeed()
        elif goal_handle.is_cancel_requested:
            result.status = result.STATUS_CANCELED
            goal_handle.canceled()
        else:
            result.status = result.STATUS_FAULT
            goal_handle.abort()
        return result

    def close(self) -> None:
        """End all runs."""
        for runner in list(self._runners.values()):
            runner.interrupt()


def main() -> None:
    """Serve until Ctrl-C."""
    rclpy.init()
    node = rclpy.create_node("offer")
    executor = MultiThreadedExecutor(num_threads=4)
    executor.add_node(node)
    deliverer = Deliverer(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        deliverer.close()


if __name__ == "__main__":
    main()
