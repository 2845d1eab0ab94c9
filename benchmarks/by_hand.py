"""What people write without us: rclpy's own clients, goal upon goal, from callbacks."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from test_msgs.action import Fibonacci

THREADS = 4
PATIENCE = 60.0


@contextlib.contextmanager
def spun_node() -> Iterator[Node]:
    """A node in a MultiThreadedExecutor that is spun on another thread."""
    rclpy.init()
    node = Node("by_hand")
    executor = MultiThreadedExecutor(THREADS)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    try:
        yield node
    finally:
        executor.shutdown()
        spinning.join()
        node.destroy_node()
        rclpy.shutdown()


class Chain:
    """Sends goals to its clients, one after the other."""

    def __init__(self, node: Node, actions: Sequence[str], feedback: Any = None) -> None:
        """Goals go to the actions by turns."""
        self._clients = [ActionClient(node, Fibonacci, action) for action in dict.fromkeys(actions)]
        by_name = dict(zip(dict.fromkeys(actions), self._clients, strict=True))
        self._turns = [by_name[action] for action in actions]
        self._feedback = feedback
        for client in self._clients:
            if not client.wait_for_server(PATIENCE):
                raise RuntimeError("no server")

    def run(self, orders: Sequence[int], finished: Callable[[], None]) -> None:
        """Send a goal of each order; `finished` is called with the last result."""
        left = [*enumerate(orders)]

        def send() -> None:
            number, order = left.pop(0)
            client = self._turns[number % len(self._turns)]
            goal = Fibonacci.Goal(order=order)
            sent = client.send_goal_async(goal, feedback_callback=self._feedback)
            sent.add_done_callback(accepted)

        def accepted(future: Any) -> None:
            future.result().get_result_async().add_done_callback(done)

        def done(_future: Any) -> None:
            if left:
                send()
            else:
                finished()

        send()

    def run_all(self, orders: Sequence[int], seconds: float = PATIENCE) -> None:
        """Send them, and wait for the last result; raises where one is lost."""
        over = threading.Event()
        self.run(orders, over.set)
        if not over.wait(seconds):
            raise RuntimeError("a goal was lost")

    def close(self) -> None:
        """Destroy the clients."""
        for client in self._clients:
            client.destroy()
