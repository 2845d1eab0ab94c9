"""Decorators that run their child more than once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.behaviours.connected import Countdown
from bt_actions.behaviours.decorators import Gate
from bt_actions.goals.policy import Retry
from bt_actions.utilities.plain_data import plain
from bt_actions.utilities.shorten import shorten

Number = Callable[[], object]


class RetryChild(Gate):
    """Ticks its child again when it has failed, after a pause.

    Args:
        name: as in py_trees.
        child: what to try.
        attempts: all tries; without limit where not given. May raise ValueError, which fails.
        backoff: seconds before the second try, on the node's clock.
        factor: each pause is this much longer than the one before.
        max_backoff: the longest pause in seconds.
    """

    def __init__(
        self,
        name: str,
        child: Behaviour,
        attempts: Number | int | None = None,
        *,
        backoff: float = 0.0,
        factor: float = 2.0,
        max_backoff: float = 60.0,
    ) -> None:
        super().__init__(name, child)
        self._attempts = attempts
        self._retry = Retry(backoff=backoff, factor=factor, max_backoff=max_backoff)
        self._pause = Countdown()
        self.failures = 0
        self.limit: int | None = None

    def setup(self, **kwargs: Any) -> None:
        self._pause.setup(kwargs.get("node"))

    def begin(self) -> None:
        self.failures = 0
        self._pause.start(0.0)
        self.limit = _whole(self._attempts, "attempts", 1)

    def gate(self) -> Status | None:
        return None if self._pause.left() <= 0.0 else Status.RUNNING

    def update(self) -> Status:
        of = "" if self.limit is None else f" of {self.limit}"
        if self.decorated.status is not Status.FAILURE:
            if self.decorated.status is Status.SUCCESS and self.failures:
                self.feedback_message = f"attempt {self.failures + 1}{of} succeeded"
            return self.decorated.status
        self.failures += 1
        self.feedback_message = f"attempt {self.failures}{of} failed"
        if self.limit is not None and self.failures >= self.limit:
            return Status.FAILURE
        self._pause.start(self._retry.pause(self.failures))
        return Status.RUNNING

    def due_in(self) -> float | None:
        """Seconds until the next try; None while one is under way."""
        return None if self.decorated.status is Status.RUNNING else self._pause.left()


class Repeat(Gate):
    """Ticks its child again when it has succeeded; fails as soon as it fails.

    Args:
        name: as in py_trees.
        child: what to repeat.
        times: how often in all; for ever where not given. May raise ValueError, which fails.
    """

    def __init__(self, name: str, child: Behaviour, times: Number | int | None = None) -> None:
        super().__init__(name, child)
        self._times = times
        self.successes = 0
        self.limit: int | None = None

    def begin(self) -> None:
        self.successes = 0
        self.limit = _whole(self._times, "times", 0)

    def gate(self) -> Status | None:
        return Status.SUCCESS if self.limit == 0 else None

    def update(self) -> Status:
        if self.decorated.status is not Status.SUCCESS:
            return self.decorated.status
        self.successes += 1
        of = "" if self.limit is None else f" of {self.limit}"
        self.feedback_message = f"{self.successes}{of} done"
        done = self.limit is not None and self.successes >= self.limit
        return Status.SUCCESS if done else Status.RUNNING

    def due_in(self) -> float | None:
        """Zero when the next round can begin at once."""
        return None if self.decorated.status is Status.RUNNING else 0.0


class ForEach(Gate):
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
        keep_going: bool = False,
    ) -> None:
        super().__init__(name, child)
        self._get_items = items
        self._write = begin
        self._keep_going = keep_going
        self._items: list[object] = []
        self.index = 0
        self.failures = 0

    def begin(self) -> None:
        self.index = self.failures = 0
        items = plain(self._get_items())
        if not isinstance(items, (list, tuple)):
            raise ValueError(f"a list is needed, not {shorten(items, 60)}")
        self._items = list(items)
        if self._items:
            self._hand_over()

    def gate(self) -> Status | None:
        return None if self._items else Status.SUCCESS

    def update(self) -> Status:
        status = self.decorated.status
        if status not in (Status.SUCCESS, Status.FAILURE):
            return status
        if status is Status.FAILURE:
            self.failures += 1
            if not self._keep_going:
                self.feedback_message = f"item {self.index} failed"
                return status
        self.index += 1
        self.feedback_message = f"{self.index} of {len(self._items)} done"
        if self.failures:
            self.feedback_message += f", {self.failures} failed"
        if self.index >= len(self._items):
            return Status.FAILURE if self.failures == len(self._items) else Status.SUCCESS
        try:
            self._hand_over()
        except ValueError as error:
            self.feedback_message, self.refused = str(error), True
            return Status.FAILURE
        return Status.RUNNING

    def _hand_over(self) -> None:
        """Put the next item where the child reads it. Raises ValueError."""
        try:
            self._write(self._items[self.index], self.index)
        except ValueError as error:
            raise ValueError(f"item {self.index}: {error}") from error

    def due_in(self) -> float | None:
        """Zero when the next item can begin at once."""
        return None if self.decorated.status is Status.RUNNING else 0.0


def _whole(given: Number | int | None, what: str, least: int) -> int | None:
    """A whole number, or None where none is given. Raises ValueError for anything else."""
    if given is None:
        return None
    try:
        value = given() if callable(given) else given
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        wanted = f"a whole number of at least {least}"
        raise ValueError(f"{what}: {wanted} is needed, not {shorten(value, 60)}")
    return value
