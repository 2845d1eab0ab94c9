"""Small leaves without ROS: wait, check, set variables, write to the log.

A ValueError of a given function fails the leaf, with its text.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from py_trees.common import Status

from bt_actions.behaviours.connected import Leaf, Limited
from bt_actions.events.kinds import Logged
from bt_actions.events.snapshot import HIDDEN
from bt_actions.events.teller import current_teller
from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from bt_actions.traffic.backend import LEVELS
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.units import parse_duration


def stood_for(expression: Expression, variable: Callable[[str], object]) -> str:
    """Say behind a colon the values of the variables in a condition; or ""."""
    seen = expression.seen({}, variable).items()
    stood = ", ".join(f"{name} is {shorten(value, 60)}" for name, value in seen)
    return f": {stood}" if stood else ""


class Wait(Leaf):
    """A leaf that succeeds after some seconds on the node's clock."""

    def __init__(self, name: str, duration: Callable[[], object]) -> None:
        super().__init__(name)
        self._duration = duration

    def do(self) -> Status:
        if self.status is not Status.RUNNING:  # the first tick of a visit
            self.give(parse_duration(self._duration()))
        return Status.SUCCESS if self.left() <= 0.0 else Status.RUNNING


class WaitUntil(Limited):
    """A leaf that succeeds as soon as a condition holds, and fails after `timeout` seconds.

    A condition that cannot be computed yet (a variable without a value) does not hold yet.
    """

    def __init__(self, name: str, condition: Callable[[], bool], timeout: float | None) -> None:
        super().__init__(name)
        self._condition = condition
        self._timeout = timeout

    def do(self) -> Status:
        why = "not yet"
        try:
            if self._condition():
                return Status.SUCCESS
        except ExpressionError as error:
            why = error.message
        if self.left() <= 0.0:
            raise ValueError(f"not within {self._timeout:g} s: {why}")
        self.feedback_message = why
        return Status.RUNNING


class Check(Leaf):
    """A leaf that succeeds when an expression over variables is true; `variable` looks them up."""

    def __init__(
        self, name: str, expression: Expression, variable: Callable[[str], object]
    ) -> None:
        super().__init__(name)
        self.expression = expression
        self._variable = variable

    def do(self) -> Status:
        if not self.expression.holds({}, self._variable):
            text = self.expression.text.strip()
            raise ValueError(f"{text} is false{stood_for(self.expression, self._variable)}")
        return Status.SUCCESS


class SetValues(Leaf):
    """A leaf that computes values and writes them with `write`; all or none."""

    in_words = "set"

    def __init__(self, name: str, write: Callable[[], None]) -> None:
        super().__init__(name)
        self._write = write

    def do(self) -> Status:
        self._write()
        return Status.SUCCESS


class Log(Leaf):
    """A leaf that writes a line to the node's log (Python's without a node), and succeeds.

    Args:
        name: as in py_trees.
        text: gives the line.
        level: one of `LEVELS`.
    """

    def __init__(self, name: str, text: Callable[[], str], level: str) -> None:
        super().__init__(name)
        self._text = text
        self._level = level

    def do(self) -> Status:
        self.feedback_message = line = self._text()
        if self._backend is None:
            logging.getLogger("bt_actions").log(LEVELS[self._level], line)
        else:
            self._backend.log(self._level, line)
        if (teller := current_teller.get()) is not None:
            told = HIDDEN if teller.reads_secret else line
            teller.tell(Logged, self, self._level, told)
        return Status.SUCCESS
