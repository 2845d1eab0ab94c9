"""A py_trees tree of your own, ticked by py_trees, with leaves of bt_actions beside your own.

In one terminal:    bt-actions sim       (a new one: the part must lie where the robot looks for it)
In another:         python examples/embed.py
"""

import threading

import py_trees
import rclpy
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor

from bt_actions import Gripper, MoveRobot, Retry, Timeouts, Var


class ChooseShelf(py_trees.behaviour.Behaviour):
    """A behaviour of your own: it decides where the part goes."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.blackboard = self.attach_blackboard_client()
        self.blackboard.register_key("shelf_at", py_trees.common.Access.WRITE)

    def update(self) -> py_trees.common.Status:
        """Choose at the last moment: the next leaf reads it when its goal is sent."""
        self.blackboard.shelf_at = 5.0
        return py_trees.common.Status.SUCCESS


def create_root() -> py_trees.behaviour.Behaviour:
    """Return the tree; no ROS is needed for that, so py-trees-render can draw it."""
    motion = {"timeout": Timeouts(result=30.0, feedback=2.0), "retry": Retry(3, backoff=0.5)}
    root = py_trees.composites.Sequence("Deliver the part", memory=True)
    root.add_children(
        [
            Gripper("Open", 100.0, timeout=10.0),
            MoveRobot("To the part", 2.0, **motion),
            Gripper("Grasp", 0.0, timeout=10.0, expect="result.stalled", retry=2),
            ChooseShelf("Choose a shelf"),
            MoveRobot("To the shelf", Var("shelf_at"), save={"at": "result.final_pose"}, **motion),
            Gripper("Release", 100.0, timeout=10.0),
        ]
    )
    return root


def main() -> int:
    """Tick the tree until it is done, and return an exit code."""
    rclpy.init()
    node = rclpy.create_node("embed")
    executor = MultiThreadedExecutor(num_threads=2)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()

    root = create_root()
    tree = py_trees.trees.BehaviourTree(root)
    tree.setup(node=node)

    def report(tree: py_trees.trees.BehaviourTree) -> None:
        print(py_trees.display.unicode_tree(root, show_status=True))
        if root.status is not py_trees.common.Status.RUNNING:
            tree.interrupt()

    try:
        tree.tick_tock(period_ms=100, post_tick_handler=report)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # in its pause, tick_tock() returns at Ctrl-C
    finally:
        tree.shutdown()  # cancels what still runs, and waits until it has ended
        executor.shutdown()
        spinning.join()
        node.destroy_node()
        rclpy.try_shutdown()
    for leaf in root.children:
        for attempt in getattr(leaf, "history", []):
            print(f"{leaf.name}: {attempt.outcome}, end {attempt.end}, {attempt.duration:.1f} s")
    return 0 if root.status is py_trees.common.Status.SUCCESS else 1


if __name__ == "__main__":
    raise SystemExit(main())
