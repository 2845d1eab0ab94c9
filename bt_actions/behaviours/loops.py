"""Decorators that run their child more than once."""

from __future__ import annotations

from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.connected import Timed
from bt_actions.behaviours.decorators import Gate
from bt_actions.goals.policy import Retry
from bt_actions.utilities.plain_data import plain
from bt_actions.utilities.shorten import shorten

Number = Callable[[], object] | None


class RetryChild(Timed, Gate):
    """Ticks its child again when it has failed, after a pause.

    Args:
        name: as in py_trees.
        child: what to try.
        attempts: all tries; without limit where not given. May raise ValueError, which fails.
        retry: the pauses, on the node's clock.
    """

    def __init__(self, name: str, child: Behaviour, attempts: Number, retry: Retry) -> None:
        super().__init__(name, child)
        self._attempts = attempts
        self._pauses = retry

    def begin(self) -> None:
        self._failures = 0
        self.give(0.0)
        self._limit, self._of = _whole(self._attempts, "attempts", 1)

    def gate(self) -> Status | None:
        return None if self.left() <= 0.0 else Status.RUNNING

    def update(self) -> Status:
        status: Status = self.decorated.status
        if status is Status.SUCCESS and self._failures:
            self.feedback_message = f"attempt {self._failures + 1}{self._of} succeeded"
        if status is not Status.FAILURE:
            return status
        self._failures += 1
        self.feedback_message = f"attempt {self._failures}{self._of} failed"
        if self._failures == self._limit:
            return Status.FAILURE
        self.give(self._pauses.pause(self._failures))
        return Status.RUNNING

    def due_in(self) -> float | None:
        """Seconds until the next try; None while one is under way."""
        return None if self.decorated.status is Status.RUNNING else self.left()


class Repeat(Gate):
    """Ticks its child again when it has succeeded; fails as soon as it fails.

    Args:
        name: as in py_trees.
        child: what to repeat.
        times: how often in all; for ever where not given. May raise ValueError, which fails.
    """

    def __init__(self, name: str, child: Behaviour, times: Number) -> None:
        super().__init__(name, child)
        self._times = times

    def begin(self) -> None:
        self._done = 0
        self._limit, self._of = _whole(self._times, "times", 0)

    def gate(self) -> Status | None:
        return Status.SUCCESS if self._limit == 0 else None

    def update(self) -> Status:
        status: Status = self.decorated.status
        return self.count() if status is Status.SUCCESS else status

    def count(self) -> Status:
        """Note that a round is done; SUCCESS after the last."""
        self._done += 1
        self.feedback_message = f"{self._done}{self._of} done"
        return Status.SUCCESS if self._done == self._limit else Status.RUNNING


class ForEach(Repeat):
    """Ticks its child once for each item of a list.

    Args:
        name: as in py_trees.
        child: what to do for each item.
        items: gives the list, when the node starts; may raise ValueError, which fails the node.
        begin: called with item and index before each round, to write them where the child reads;
            may raise ValueError, which fails the node.
        keep_going: whether an item that failed is left behind; the node then succeeds if any item
            did, or the list was empty.
    """

    def __init__(
        self,
        name: str,
        child: Behaviour,
        items: Callable[[], object],
        begin: Callable[[object, int], None],
        *,
        keep_going: bool,
    ) -> None:
        super().__init__(name, child, None)
        self._get_items = items
        self._write = begin
        self._keep_going = keep_going

    def begin(self) -> None:
        self._done = self._failures = 0
        items = plain(self._get_items())
        if not isinstance(items, (list, tuple)):
            raise ValueError(f"a list is needed, not {shorten(items, 60)}")
        self._items, self._limit, self._of = items, len(items), f" of {len(items)}"
        if items:
            self._hand_over()

    def update(self) -> Status:
        status: Status = self.decorated.status
        if status not in (Status.SUCCESS, Status.FAILURE):
            return status
        if status is Status.FAILURE:
            self._failures += 1
            if not self._keep_going:
                self.feedback_message = f"item {self._done} failed"
                return status
        status = self.count()
        if self._failures:
            self.feedback_message += f", {self._failures} failed"
        if status is Status.SUCCESS:
            return Status.FAILURE if self._failures == self._limit else status
        try:
            self._hand_over()
        except ValueError as error:
            self.feedback_message, self.refused = str(error), True
            return Status.FAILURE
        return status

    def _hand_over(self) -> None:
        """Put the next item where the child reads it. Raises ValueError."""
        try:
            self._write(self._items[self._done], self._done)
        except ValueError as error:
            raise ValueError(f"item {self._done}: {error}") from error


def _whole(given: Number, what: str, least: int) -> tuple[int | None, str]:
    """A whole number, and how it is told; None where none is given. May raise ValueError."""
    if given is None:
        return None, ""
    try:
        value = given()
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        wanted = f"a whole number of at least {least}"
        raise ValueError(f"{what}: {wanted} is needed, not {shorten(value, 60)}")
    return value, f" of {value}"
