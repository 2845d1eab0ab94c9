"""Leaves that do something small and need no ROS: wait, check, set variables, write to the log."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.connected import Countdown, limit
from bt_actions.behaviours.variables import read
from bt_actions.expressions.expression import Expression, ExpressionError
from bt_actions.traffic.backend import LEVELS, Backend
from bt_actions.utilities.units import parse_duration
from bt_actions.wiring import backend_of


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


class Check(Behaviour):
    """Succeeds when an expression is true; fails when it is not, or cannot be computed.

    Args:
        name: as in py_trees.
        expression: what must hold, over variables alone (``$count < 3``).
        variable: looks a variable up, raising KeyError for one without a value; the blackboard's
            own keys where not given.

    Raises ExpressionError for a text that is no expression.
    """

    def __init__(
        self,
        name: str,
        expression: Expression | str,
        *,
        variable: Callable[[str], object] | None = None,
    ) -> None:
        super().__init__(name)
        if isinstance(expression, str):
            expression = Expression(expression, roots=())
        self.expression = expression
        self._variable = variable or read

    def update(self) -> Status:
        try:
            holds = self.expression.holds({}, self._variable)
        except ExpressionError as error:
            self.feedback_message = error.message
            return Status.FAILURE
        self.feedback_message = "" if holds else f"{self.expression.text.strip()} is false"
        return Status.SUCCESS if holds else Status.FAILURE


class SetValues(Behaviour):
    """Computes values and writes them, all or none; fails when one cannot be computed.

    Args:
        name: as in py_trees.
        values: gives the values by name; may raise ValueError.
        write: puts them where the tree reads them; may raise ValueError.
    """

    def __init__(
        self,
        name: str,
        values: Callable[[], Mapping[str, object]],
        write: Callable[[Mapping[str, object]], None],
    ) -> None:
        super().__init__(name)
        self._values = values
        self._write = write

    def update(self) -> Status:
        try:
            self._write(self._values())
        except ValueError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self.feedback_message = ""
        return Status.SUCCESS


class Log(Behaviour):
    """Writes a line to the node's log (Python's where there is no node), and succeeds.

    Args:
        name: as in py_trees.
        text: gives the line; may raise ValueError, which is logged instead and fails.
        level: one of `LEVELS`.
    """

    def __init__(self, name: str, text: Callable[[], object], level: str = "info") -> None:
        super().__init__(name)
        if level not in LEVELS:
            raise ValueError(f"level must be one of {', '.join(LEVELS)}, not {level!r}")
        self._text = text
        self._level = level
        self._backend: Backend | None = None

    def setup(self, **kwargs: Any) -> None:
        node = kwargs.get("node")
        self._backend = None if node is None else backend_of(node)

    def update(self) -> Status:
        try:
            line = str(self._text())
        except ValueError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self.feedback_message = line
        if self._backend is None:
            logging.getLogger("bt_actions").log(LEVELS[self._level], line)
        else:
            self._backend.log(self._level, line)
        return Status.SUCCESS
