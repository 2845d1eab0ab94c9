"""Decorators: one that decides before each tick whether its child is ticked, and what it is for.

A deadline and a guard, which stop their child, a tree inside a tree, and loops.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from bt_actions.behaviours.asking import Asking, Number, Rounds, Tries, actions_below, still_ends
from bt_actions.goals.policy import Retry
from bt_actions.utilities.plain_data import plain
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.units import parse_duration


class Gate(Asking, Decorator):
    """Like py_trees' Decorator, with a question asked first.

    A subclass says in `gate` what to do: None ticks the child, RUNNING waits without ticking it,
    SUCCESS and FAILURE end the node. `update` then says what the child's status means: itself,
    where nothing else is said. Where one of them or `initialise` raises ValueError, the visit fails
    with its text.
    """

    def gate(self) -> Status | None:
        """Decide what to do this time; called after `initialise`."""
        return None

    def update(self) -> Status:
        return self.decorated.status

    def due_in(self) -> float | None:
        """Return the seconds until the child can begin anew; 0 without a pause; None if it runs."""
        return None if self.decorated.status is Status.RUNNING else self.left()

    def tick(self) -> Iterator[Behaviour]:
        self.refused = False
        status, child_failed = self._answer(self._ask), False
        if status is None:
            yield from self.decorated.tick()
            child_failed = self.decorated.status is Status.FAILURE
            status = self._answer(self.update) or Status.INVALID
        self.refused = status is Status.FAILURE and (self.refused or not child_failed)
        if status is not Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

    def _ask(self) -> Status | None:
        if self.status is not Status.RUNNING:
            self._begin_visit()
        return self.gate()


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

    in_words = "timeout"

    def __init__(self, name: str, child: Behaviour, after: Callable[[], object]) -> None:
        super().__init__(name, child)
        self._after = after

    def initialise(self) -> None:
        self._expired = False
        self.give(parse_duration(self._after()))

    def gate(self) -> Status | None:
        if not self._expired and self.left() <= 0.0:
            self._expired = True
            self.decorated.stop(Status.INVALID)
        if not self._expired:
            return None
        if waits_for := still_ends(self.decorated):
            self.feedback_message = f"{self._seconds:g} s are over; {waits_for}"
            return Status.RUNNING
        below = actions_below(self.decorated)
        unknown = ", ".join(node.name for node in below if not node.drained)
        told = f"; the end of {unknown} is not known" if unknown else ""
        raise ValueError(f"not done within {self._seconds:g} s{told}")

    def left_to_run(self) -> float | None:
        return self.due_in()

    def due_in(self) -> float | None:
        """Return the seconds until the deadline."""
        return None if self._expired else self.left()


class While(Gate):
    """Ticks its child as long as a condition holds; stops it and fails when it does not.

    Args:
        name: as in py_trees.
        child: what to do meanwhile.
        condition: asked before each tick; raising ValueError counts as no.
    """

    def __init__(self, name: str, child: Behaviour, condition: Callable[[], bool]) -> None:
        super().__init__(name, child)
        self._condition = condition

    def gate(self) -> Status | None:
        if not self._condition():
            raise ValueError("the condition does not hold")
        return None


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

    passes_on = True

    def __init__(
        self, name: str, child: Behaviour, begin: Callable[[], None], end: Callable[[], None]
    ) -> None:
        super().__init__(name, child)
        self._begin = begin
        self._end = end

    def initialise(self) -> None:
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


class Repeat(Rounds, Gate):
    """Ticks its child again when it has succeeded; fails as soon as it fails.

    Args:
        name: as in py_trees.
        child: what to repeat.
        times: how often in all; for ever where not given. May raise ValueError, which fails.
    """

    passes_on = True

    def __init__(self, name: str, child: Behaviour, times: Number) -> None:
        super().__init__(name, child)
        self._times = times

    def gate(self) -> Status | None:
        if self._limit == 0:
            return Status.SUCCESS
        if self.left() > 0.0:
            return Status.RUNNING
        self.tell_round()
        return None

    def update(self) -> Status:
        status = self.decorated.status
        return self.count() if status is self._again else status


class RetryChild(Tries, Repeat):
    """Ticks its child again when it has failed, after a pause.

    Args:
        name: as in py_trees.
        child: what to try.
        attempts: all tries; without limit where not given. May raise ValueError, which fails.
        retry: the pauses, on the node's clock.
    """

    passes_on = True
    in_words = "retry"

    def __init__(self, name: str, child: Behaviour, attempts: Number, retry: Retry) -> None:
        super().__init__(name, child, attempts)
        self._pauses = retry

    def update(self) -> Status:
        if self.decorated.status is Status.SUCCESS:
            self.tell_success()
        return super().update()


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

    passes_on = True

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

    def initialise(self) -> None:
        super().initialise()
        self._failures = 0
        items = plain(self._get_items())
        if not isinstance(items, (list, tuple)):
            raise ValueError(f"a list is needed, not {shorten(items, 60)}")
        self._items, self._limit, self._of = items, len(items), f" of {len(items)}"
        if items:
            self._hand_over()

    @property
    def item(self) -> object:
        return self._items[self._done]

    def update(self) -> Status:
        status = self.decorated.status
        if status not in (Status.SUCCESS, Status.FAILURE):
            return status
        if status is Status.FAILURE:
            self._failures += 1
            if not self._keep_going:
                self.feedback_message = f"item {self._done + 1}{self._of} failed"
                return status
        status = self.count()
        if self._failures:
            self.feedback_message += f", {self._failures} failed"
        if status is Status.SUCCESS:
            return Status.FAILURE if self._failures == self._limit else status
        self._hand_over()
        return status

    def _hand_over(self) -> None:
        """Put the next item where the child reads it. Raises ValueError."""
        try:
            self._write(self._items[self._done], self._done)
        except ValueError as error:
            raise ValueError(f"item {self._done + 1}{self._of}: {error}") from error
