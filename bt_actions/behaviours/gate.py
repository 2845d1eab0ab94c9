"""A decorator that decides before each tick whether its child is ticked at all."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator


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
