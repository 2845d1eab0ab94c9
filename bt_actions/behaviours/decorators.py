"""Decorators that decide before each tick whether to tick their child: `Gate`, and its kinds.

The kinds are a deadline and a guard, which stop their child, a tree inside a tree, and loops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from bt_actions.behaviours.asking import Asking, Number, Rounds, Tries, actions_below, still_ends
from bt_actions.behaviours.connected import Stopwatch
from bt_actions.behaviours.leaving import is_left_out, leave_out
from bt_actions.goals.policy import Retry
from bt_actions.utilities.plain_data import plain
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.units import parse_duration


class Gate(Asking, Decorator):
    """A decorator of py_trees, with a question before each tick.

    A subclass answers in `gate`: None ticks the child, RUNNING waits without a tick, SUCCESS and
    FAILURE end the node. `update` then turns the child's status into the node's, by default
    unchanged. A ValueError of these two, or of `initialise`, fails the visit with its text.
    """

    def gate(self) -> Status | None:
        """Decide what to do this time; called after `initialise`."""
        return None

    def update(self) -> Status:
        return self.decorated.status

    def without(self) -> Status:
        """Return the status that follows from a child that was left out.

        The node is left out with it.
        """
        return leave_out(self)

    def due_in(self) -> float | None:
        """Return the seconds until the child can begin anew; 0 without a pause.

        None while it runs.
        """
        return None if self.decorated.status is Status.RUNNING else self.left()

    def tick(self) -> Iterator[Behaviour]:
        self.refused = False
        status, child_failed = self._answer(self._ask), False
        if status is None:
            yield from self.decorated.tick()
            ended = self.decorated.status is not Status.RUNNING
            if ended and is_left_out(self.decorated):
                status = self._answer(self.without) or Status.INVALID
            else:
                child_failed = self.decorated.status is Status.FAILURE
                status = self._answer(self.update) or Status.INVALID
        fails = status is Status.FAILURE and not self.left_out
        self.refused = fails and (self.refused or not child_failed)
        if status is not Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

    def _ask(self) -> Status | None:
        if self.status is not Status.RUNNING:
            self._begin_visit()
        return self.gate()


class Deadline(Gate):
    """A decorator that stops its child after some seconds, and fails when the goals have ended.

    py_trees' Timeout fails at once, so that the next behaviour runs beside a goal that is still
    being canceled. This node waits for a stopped goal as long as its leaf does, until the goal's
    own deadlines have passed; the resources of a goal without an end stay taken.

    Args:
        name: as in py_trees.
        child: the child that may take only so long.
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
    """A decorator that ticks its child as long as a condition holds, then stops it and fails.

    Args:
        name: as in py_trees.
        child: what to do meanwhile.
        condition: asked before each tick; a ValueError counts as no.
    """

    def __init__(self, name: str, child: Behaviour, condition: Callable[[], bool]) -> None:
        super().__init__(name, child)
        self._condition = condition

    def gate(self) -> Status | None:
        if not self._condition():
            raise ValueError("the condition does not hold")
        return None


class Every(Gate):
    """A decorator that begins its child at once, and again that long after its last success.

    Until then the node is RUNNING, and does not tick the child. The period runs on after a success,
    and ends with a failure, or when the node is stopped. So the node holds its child back in a
    `Pipeline`, and in a `Repeat`.

    Args:
        name: as in py_trees.
        child: what to begin so often.
        period: seconds on the node's clock; None: once, until the node has failed or was stopped.
    """

    _since: Stopwatch | None = None
    """The time since the last success."""

    def __init__(self, name: str, child: Behaviour, period: float | None) -> None:
        super().__init__(name, child)
        self._period = math.inf if period is None else period

    def gate(self) -> Status | None:
        return Status.RUNNING if self._pause() > 0.0 else None

    def update(self) -> Status:
        if self.decorated.status is Status.SUCCESS:
            self._since = Stopwatch(self._now)
        return self.decorated.status

    def due_in(self) -> float | None:
        """Return the seconds until the child begins again; None while it runs, or never does."""
        pause = self._pause()
        return None if self.decorated.status is Status.RUNNING or math.isinf(pause) else pause

    def terminate(self, new_status: Status) -> None:
        if new_status is not Status.SUCCESS:
            self._since = None

    def _pause(self) -> float:
        if self._since is None or self.decorated.status is Status.RUNNING:
            return 0.0
        return max(0.0, self._period - self._since.passed())


class Subtree(Gate):
    """A decorator that ticks another tree with inputs of its own.

    Args:
        name: as in py_trees.
        child: the root of the tree.
        begin: writes the inputs, each time the tree starts; raises ValueError for an input that has
            no value or does not fit, which fails the subtree before its first tick.
        end: gives back the outputs, when the tree has succeeded or failed; raises ValueError for
            an output that does not fit, which fails the subtree.
        pass_on: writes the inputs that have changed, before each tick but the first.
    """

    passes_on = True

    def __init__(
        self,
        name: str,
        child: Behaviour,
        begin: Callable[[], None],
        end: Callable[[], None],
        pass_on: Callable[[], None] | None = None,
    ) -> None:
        super().__init__(name, child)
        self._begin = begin
        self._end = end
        self._pass_on = pass_on
        if pass_on is not None:
            self.asks = True  # the inputs are computed at each tick

    def initialise(self) -> None:
        try:
            self._begin()
        except ValueError:
            self.decorated.stop(Status.INVALID)
            raise

    def gate(self) -> Status | None:
        if self._pass_on is not None and self.status is Status.RUNNING:
            self._pass_on()
        return None

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
    """A decorator that ticks its child again after a success, and fails with the child.

    Args:
        name: as in py_trees.
        child: what to repeat.
        times: how often in all; for ever where not given. May raise ValueError, which fails.
        until: asked after each round that has succeeded: where it holds, the node succeeds, and
            when no round is left, the node fails. May raise ValueError, which fails.
    """

    passes_on = True

    def __init__(
        self,
        name: str,
        child: Behaviour,
        times: Number,
        until: Callable[[], bool] | None = None,
    ) -> None:
        super().__init__(name, child)
        self._times = times
        self._until = until

    def initialise(self) -> None:
        super().initialise()
        self._idle = False

    def gate(self) -> Status | None:
        if self._limit == 0:
            return Status.SUCCESS
        if self.left() > 0.0:
            return Status.RUNNING
        self._idle = False
        self.tell_round()
        return None

    def without(self) -> Status:
        if self._limit is not None:
            return leave_out(self)
        self._idle = True
        return Status.RUNNING

    def due_in(self) -> float | None:
        """Return the seconds until the next round; None while the child runs, or is left out."""
        return None if self._idle else super().due_in()

    def update(self) -> Status:
        status = self.decorated.status
        if status is not self._again:
            return status
        if self._until is None:
            return self.count()
        if self._until():
            return status
        if self.count() is status:
            raise ValueError(f"the condition does not hold after {self._done} rounds")
        return Status.RUNNING


class RetryChild(Tries, Repeat):
    """A decorator that ticks its child again after a failure and a pause.

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

    def without(self) -> Status:
        return leave_out(self)


class ForEach(Repeat):
    """A decorator that ticks its child once for each item of a list.

    Args:
        name: as in py_trees.
        child: what to do for each item.
        items: gives the list, when the node starts; may raise ValueError, which fails the node.
        begin: called with item and index before each round, to write them where the child reads;
            may raise ValueError, which fails the node.
        keep_going: whether the loop goes on after an item that failed; the node then succeeds if
            any item did, or the list was empty.
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
        self._failures = self._left = 0
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
            done = self._done - self._left
            return Status.FAILURE if self._failures == done else status
        self._hand_over()
        return status

    def without(self) -> Status:
        self._left += 1
        status = self.count()
        if status is not Status.SUCCESS:
            self._hand_over()
        elif self._left == self._limit:
            return leave_out(self)
        elif self._failures == self._done - self._left:
            return Status.FAILURE
        return status

    def _hand_over(self) -> None:
        """Put the next item where the child reads it. Raises ValueError."""
        try:
            self._write(self._items[self._done], self._done)
        except ValueError as error:
            raise ValueError(f"item {self._done + 1}{self._of}: {error}") from error
