"""The tree with a node and a timer."""

from __future__ import annotations

import os
from typing import Any

import py_trees
import rclpy
from py_trees.behaviour import Behaviour
from py_trees.common import Status


class BehaviourTree(py_trees.trees.BehaviourTree):
    """Ticks by a timer of its node. Unlike the original, the process ends with the tree."""

    def __init__(self, root: Behaviour) -> None:
        super().__init__(root)
        self.node: Any = rclpy.create_node("tree")

    def setup(self, timeout: float) -> None:  # type: ignore[override]
        super().setup(timeout=timeout, node=self.node)

    def tick_tock(self, period_ms: float) -> None:  # type: ignore[override]
        self.node.create_timer(period_ms / 1000.0, self._tick)

    def _tick(self) -> None:
        self.tick()
        if self.root.status is not Status.RUNNING:
            print(self.root.status, flush=True)
            os._exit(0)
