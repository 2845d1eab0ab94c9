"""Simulated time for tests: /clock, published by a thread, at any pace."""

from __future__ import annotations

import threading
import time
from typing import Any


class SimulatedTime:
    """Publishes /clock, so many simulated seconds a second, from a thread of its own."""

    def __init__(self, context: Any) -> None:
        from rclpy.node import Node
        from rosgraph_msgs.msg import Clock

        self._clock_type = Clock
        self._node = Node("simulated_time", context=context)
        self._publisher = self._node.create_publisher(Clock, "/clock", 10)
        self._now = 5000.0
        self.rate = 1.0
        self.seen_by: Any = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def __repr__(self) -> str:
        seen = "nobody's" if self.seen_by is None else self.seen_by.get_clock().now().nanoseconds
        return f"<SimulatedTime {self._now:.2f} s; the node's, by now: {seen} ns>"

    def _publish(self) -> None:
        last = time.monotonic()
        while not self._over.wait(0.01):
            now = time.monotonic()
            self._now += (now - last) * self.rate
            last = now
            message = self._clock_type()
            message.clock.sec, fraction = int(self._now), self._now % 1.0
            message.clock.nanosec = int(fraction * 1e9)
            self._publisher.publish(message)

    def jump(self, seconds: float) -> None:
        self._now += seconds

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._node.destroy_node()
