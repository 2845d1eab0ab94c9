"""Leaves that wait: for some time, and for something to hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.connected import Countdown, limit
from bt_actions.expressions.expression import ExpressionError
from bt_actions.utilities.units import parse_duration


class Wait(Behaviour):
    """Succeeds after some seconds on the node's clock; `duration` may raise ValueError: failure."""

    def __init__(self, name: str, duration: Callable[[], object]) -> None:
        super().__init__(name)
        self._duration = duration
        self._countdown = Countdown()
        self._refused = ""

    def setup(self, **kwargs: Any) -> None:
        self._countdown.setup(kwargs.get("node"))

    def initialise(self) -> None:
        self._refused = ""
        try:
            self._countdown.start(parse_duration(self._duration()))
        except ValueError as error:
            self._refused = str(error)

    def update(self) -> Status:
        if self._refused:
            self.feedback_message = self._refused
            return Status.FAILURE
        left = self._countdown.left()
        self.feedback_message = f"{left:.1f} s left" if left > 0.0 else ""
        return Status.RUNNING if left > 0.0 else Status.SUCCESS

    def due_in(self) -> float | None:
        """Seconds until it is over."""
        return self._countdown.left()


class WaitUntil(Behaviour):
    """Succeeds as soon as a condition holds; fails after `timeout` seconds where one is given.

    What cannot be computed yet (a variable without a value) does not hold yet.
    """

    def __init__(
        self, name: str, condition: Callable[[], bool], timeout: float | None = None
    ) -> None:
        super().__init__(name)
        self._condition = condition
        self._timeout = limit(timeout)
        self._countdown = Countdown()

    def setup(self, **kwargs: Any) -> None:
        self._countdown.setup(kwargs.get("node"))

    def initialise(self) -> None:
        self._countdown.start(self._timeout)

    def update(self) -> Status:
        try:
            holds, self.feedback_message = self._condition(), "not yet"
        except ExpressionError as error:
            holds, self.feedback_message = False, error.message
        if holds:
            self.feedback_message = ""
            return Status.SUCCESS
        if self._countdown.left() <= 0.0:
            self.feedback_message = f"not within {self._timeout:g} s: {self.feedback_message}"
            return Status.FAILURE
        return Status.RUNNING

    def due_in(self) -> float | None:
        """Seconds until it fails."""
        return self._countdown.left()
