"""Decorators: one that decides before each tick whether its child is ticked, and what it is for.

A deadline and a guard, which stop their child, and a tree inside a tree. Those that run their child
more than once are in loops.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.behaviours.connected import Timed
from bt_actions.expressions.expression import ExpressionError
from bt_actions.utilities.units import parse_duration


class Gate(Decorator):
    """Like py_trees' Decorator, with a question asked first.

    A subclass says in `gate` what to do: None ticks the child, RUNNING waits without ticking it,
    SUCCESS and FAILURE end the node. `update` then says what the child's status means: itself,
    where nothing else is said. Where `begin` raises ValueError, the visit fails with its text.
    """

    refused = False
    """Whether it failed by itself: its child did not, or was not ticked this time, or `update` says
    so."""

    _wrong = ""

    def begin(self) -> None:
        """Begin a visit; may raise ValueError."""

    def initialise(self) -> None:
        self.feedback_message = self._wrong = ""
        try:
            self.begin()
        except ValueError as error:
            self.feedback_message = self._wrong = str(error)

    def gate(self) -> Status | None:
        """What to do this time; called after `begin`."""
        return None

    def update(self) -> Status:
        status: Status = self.decorated.status
        return status

    def due_in(self) -> float | None:
        """Zero when the child can begin anew at once."""
        return None if self.decorated.status is Status.RUNNING else 0.0

    def tick(self) -> Iterator[Behaviour]:
        if self.status is not Status.RUNNING:
            self.initialise()
        self.refused = False
        decided, child_failed = Status.FAILURE if self._wrong else self.gate(), False
        if decided is None:
            yield from self.decorated.tick()
            child_failed = self.decorated.status is Status.FAILURE
            decided = self.update()
        self.refused = decided is Status.FAILURE and (self.refused or not child_failed)
        if decided is not Status.RUNNING:
            self.stop(decided)
        self.status = decided
        yield self


class Deadline(Timed, Gate):
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

    def begin(self) -> None:
        self._expired = False
        self.give(parse_duration(self._after()))

    def gate(self) -> Status | None:
        if not self._expired and self.left() <= 0.0:
            self._expired = True
            self.decorated.stop(Status.INVALID)
        if not self._expired:
            return None
        below = [node for node in self.decorated.iterate() if isinstance(node, ActionBehaviour)]
        stopping = [node.name for node in below if node.draining]
        if stopping:
            self.feedback_message = (
                f"{self._seconds:g} s are over; waiting for {stopping[0]} to end"
            )
            return Status.RUNNING
        self.feedback_message = f"not done within {self._seconds:g} s"
        unknown = [node.name for node in below if not node.drained]
        if unknown:
            self.feedback_message += f"; the end of {', '.join(unknown)} is not known"
        return Status.FAILURE

    def due_in(self) -> float | None:
        """Seconds until the deadline."""
        return None if self._expired else self.left()


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
            holds = self._condition()
            self.feedback_message = "" if holds else "the condition does not hold"
        except ExpressionError as error:
            holds, self.feedback_message = False, error.message
        return None if holds else Status.FAILURE


class Subtree(Gate):
    """Ticks another tree with inputs of its own.

    Args:
        name: as in py_trees.
        child: the root of the tree.
        begin: writes the inputs, each time the tree starts; raises ValueError for one that has no
            value or does not fit, which fails the subtree before its first tick.
        end: gives back the outputs, when the tree has succeeded or failed; raises ValueError for
            one that does not fit, which fails the subtree.
    """

    def __init__(
        self, name: str, child: Behaviour, begin: Callable[[], None], end: Callable[[], None]
    ) -> None:
        super().__init__(name, child)
        self._begin = begin
        self._end = end

    def begin(self) -> None:
        try:
            self._begin()
        except ValueError:
            self.decorated.stop(Status.INVALID)
            raise

    def update(self) -> Status:
        status = self.decorated.status
        self.feedback_message = self.decorated.feedback_message
        if status in (Status.SUCCESS, Status.FAILURE):
            try:
                self._end()
            except ValueError as error:
                failed = self.feedback_message if status is Status.FAILURE else ""
                self.feedback_message = f"{failed}; {error}" if failed else str(error)
                return Status.FAILURE
        return status
