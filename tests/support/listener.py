"""A subscriber of a node's runs, as examples/watch_runs.py is one."""

from __future__ import annotations

from bt_actions_interfaces.msg import RunEvent, RunStates
from rclpy.node import Node

from examples.watch_runs import Watcher


class Listener(Watcher):
    """Keeps all that it hears."""

    def __init__(self, node: Node, watched: str) -> None:
        self.events: list[RunEvent] = []
        self.trees: list[RunStates] = []
        super().__init__(node, watched)

    def event(self, message: RunEvent) -> None:
        if not any(each is message for each in self.events):  # else it had to wait for a state
            self.events.append(message)
        super().event(message)

    def states(self, message: RunStates) -> None:
        self.trees.append(message)
        super().states(message)

    def follows(self, run: str, message: RunEvent) -> None:
        pass

    @property
    def numbers(self) -> list[int]:
        return [each.number for each in self.events]
