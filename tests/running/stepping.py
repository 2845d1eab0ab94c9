"""A loop that is stepped in time of its own, over a traffic without goals. No ROS."""

from __future__ import annotations

from typing import Any
from unittest.mock import MagicMock

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree

from bt_actions.events import Event
from bt_actions.running.loop import TickLoop
from bt_actions.traffic.backend import Backend
from bt_actions.utilities.stepping import Done


class Stepped:
    """Steps a loop, and lets as much time pass as it wants to be left alone for."""

    def __init__(self, tree: Behaviour | BehaviourTree, **given: Any) -> None:
        self.now = 0.0
        self.slept: list[float] = []
        self.told: list[Event] = []
        self.backend = MagicMock(spec=Backend, traffic=MagicMock())
        self.traffic = self.backend.traffic
        self.traffic.host.steady = self.traffic.host.wall = lambda: self.now
        self.traffic.host.new_goal_id = lambda: bytes(16)
        self.backend.stamp = lambda: int(self.now * 1e9)
        self.loop = TickLoop(
            tree if isinstance(tree, BehaviourTree) else BehaviourTree(tree),
            self.backend,
            **given,
        )
        self.loop.observe_events(self.told.append)

    def begin(self, timeout: float | None = None) -> None:
        self.loop.begin(self.now, timeout)

    def step(self) -> Status | None:
        """Step once; return the status at the end."""
        step = self.loop.step(self.now)
        if isinstance(step, Done):
            return step.result
        self.slept.append(step.seconds)
        self.now += step.seconds
        return None

    def run(self, timeout: float | None = None) -> Status:
        self.begin(timeout)
        while (status := self.step()) is None:
            pass
        return status
