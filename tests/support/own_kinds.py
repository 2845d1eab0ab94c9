"""Classes that trees of tests declare as kinds of their own."""

from __future__ import annotations

from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence
from py_trees.decorators import Inverter


class Multiply(Behaviour):
    """Gives `x` times `by`, at its second tick; fails where `by` is 0."""

    inputs: Any
    outputs: Any

    def update(self) -> Status:
        if self.status is not Status.RUNNING:
            self.outputs.product = self.outputs.word = -1.0
            return Status.RUNNING
        self.outputs.product = self.inputs.x * self.inputs.by
        self.outputs.word = self.name
        return Status.SUCCESS if self.inputs.by else Status.FAILURE


class Both(Sequence):
    """A sequence by another name."""

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, True, children)


class Not(Inverter):
    """An inverter by another name."""

    def __init__(self, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
