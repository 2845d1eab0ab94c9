"""Decorators that stop their child: a deadline, and a guard."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.connected import Countdown
from bt_actions.behaviours.gate import Gate
from bt_actions.expressions.expression import ExpressionError
from bt_actions.utilities.units import parse_duration


class Deadline(Gate):
    """Stops its child after some seconds, and fails when what it stopped has ended.

    py_trees' Timeout fails at once, so that whatever comes next runs beside a goal that is still
    being canceled. A goal that does not end within its own deadlines is waited for no longer, as a
    leaf waits for it no longer; its resources stay taken.

    Args:
        name: as in py_trees.
        child: what may take only so long.
        after: seconds on the node's clock; may raise ValueError, which fails.
    """

    def __init__(self, name: str, child: Behaviour, after: Callable[[], object]) -> None:
        super().__init__(name, child)
        self._after = after
        self._countdown = Countdown()
        self._expired = False
        self._limit = 0.0

    def setup(self, **kwargs: Any) -> None:
        self._countdown.setup(kwargs.get("node"))

    def begin(self) -> None:
        self._expired = False
        self._limit = parse_duration(self._after())
        self._countdown.start(self._limit)

    def gate(self) -> Status | None:
        if not self._expired and self._countdown.left() <= 0.0:
            self._expired = True
            self.decorated.stop(Status.INVALID)
        if not self._expired:
            return None
        below = [node for node in self.decorated.iterate() if isinstance(node, ActionBehaviour)]
        stopping = [node.name for node in below if node.draining]
        if stopping:
            self.feedback_message = f"{self._limit:g} s are over; waiting for {stopping[0]} to end"
            return Status.RUNNING
        self.feedback_message = f"not done within {self._limit:g} s"
        unknown = [node.name for node in below if not node.drained]
        if unknown:
            self.feedback_message += f"; the end of {', '.join(unknown)} is not known"
        return Status.FAILURE

    def due_in(self) -> float | None:
        """Seconds until the deadline."""
        return None if self._expired else self._countdown.left()


class While(Gate):
    """Ticks its child as long as a condition holds; stops it and fails when it does not.

    Args:
        name: as in py_trees.
        child: what to do meanwhile.
        condition: asked before each tick; raising ExpressionError counts as no.
    """

    def __init__(self, name: str, child: Behaviour, condition: Callable[[], bool]) -> None:
        super().__init__(name, child)
        self._condition = condition

    def gate(self) -> Status | None:
        try:
            holds, why = self._condition(), "the condition does not hold"
        except ExpressionError as error:
            holds, why = False, error.message
        if holds:
            self.feedback_message = ""
            return None
        self.feedback_message = why
        return Status.FAILURE
