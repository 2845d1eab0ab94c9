"""Composites beyond those of py_trees: a retry that recovers, a choice, a pipeline, turns.

These composites are py_trees' own kind, and work in any tree. `work` ticks one child after another:
the generator yields what their ticks yield, and returns the status that follows.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from bt_actions.behaviours.asking import Asking, Number, Tries, still_ends
from bt_actions.behaviours.leaving import is_left_out, leave_out
from bt_actions.goals.policy import Retry

Work = Generator[Behaviour, None, Status]
"""The ticks of children, and the status that follows."""


class Working(Asking, Composite):
    """A composite that stops running children at its end, and resets all children at its start."""

    def due_in(self) -> float | None:
        """Return None: a composite has no time of its own, unless it overrides this."""
        return None

    def work(self) -> Work:
        """Tick children, and return the status that follows; called after `initialise`."""
        raise NotImplementedError

    def tick(self) -> Iterator[Behaviour]:
        self.refused, status = False, None
        if self.status is not Status.RUNNING:
            self.current_child = None
            self._stop_children()
            self.status = Status.RUNNING  # should a child raise, `stop` is to reach the others
            status = self._answer(self._begin_visit)
        if status is None:
            status = yield from self.work()
        if status is not Status.RUNNING:
            for child in self.children:
                if child.status is Status.RUNNING:
                    child.stop(Status.INVALID)
            self.stop(status)
        self.status = status
        yield self

    def ticked(self, child: Behaviour) -> Work:
        """Tick a child, and return its status."""
        self.current_child = child
        yield from child.tick()
        return child.status

    def _stop_children(self) -> None:
        for child in self.children:
            if child.status is not Status.INVALID:
                child.stop(Status.INVALID)


class Recover(Tries, Working):
    """A composite that tries its child, and ticks `recover` after each failure but the last.

    The attempts follow each other in the same tick where nothing takes time, unless their number
    has no limit. A failure of `recover` is a failure of the node.

    Args:
        name: as in py_trees.
        child: the child to try.
        recover: the child to tick after a failure, when another attempt is to come.
        attempts: all tries, or a function that gives their number; None is without limit.
        retry: the pauses, between `recover` and the next attempt, on the node's clock.
    """

    passes_on = True
    in_words = "retry"

    def __init__(
        self,
        name: str,
        child: Behaviour,
        recover: Behaviour,
        attempts: Number = None,
        retry: Retry | None = None,
    ) -> None:
        super().__init__(name, [child, recover])
        self._times = attempts
        self._pauses = retry or Retry()

    def initialise(self) -> None:
        super().initialise()
        self._recovers = False

    def due_in(self) -> float | None:
        """Return the seconds until the next attempt; None while a child runs."""
        return None if any(each.status is Status.RUNNING for each in self.children) else self.left()

    def work(self) -> Work:
        child, recover = self.children
        while True:
            if self._recovers:
                status = yield from self.ticked(recover)
                if is_left_out(recover) and status is not Status.RUNNING:
                    status = Status.FAILURE
                if status is not Status.SUCCESS:
                    return status
                self._recovers = False
                self.give(self._pauses.pause(self._done))
                if self._limit is None:
                    return Status.RUNNING
            if self.left() > 0.0:
                return Status.RUNNING
            self.tell_round()
            status = yield from self.ticked(child)
            if status is not Status.RUNNING and is_left_out(child):
                return leave_out(self)
            if status is Status.SUCCESS:
                self.tell_success()
            if status is not Status.FAILURE or self.count() is Status.FAILURE:
                return status
            self._recovers = True


class If(Working):
    """A composite that ticks one of two children, as a condition says.

    Args:
        name: as in py_trees.
        condition: asked in each visit until it has an answer; a child that succeeds (yes) or fails
            (no), or a function that may raise ValueError, which fails the node.
        then: the child for yes.
        otherwise: the child for no; None fails.
        memory: whether the choice is kept to the end of the visit. Otherwise the condition is asked
            before each tick, and a child that is not chosen any more is stopped; the other child
            begins when the goals of the stopped one have ended.
    """

    def __init__(
        self,
        name: str,
        condition: Behaviour | Callable[[], bool],
        then: Behaviour,
        otherwise: Behaviour | None = None,
        *,
        memory: bool = True,
    ) -> None:
        asked = [condition] if isinstance(condition, Behaviour) else []
        branches = [each for each in (then, otherwise) if each is not None]
        super().__init__(name, [*asked, *branches])
        self._condition, self._then, self._otherwise = condition, then, otherwise
        self.memory = memory

    def initialise(self) -> None:
        self._chosen: Behaviour | None = None
        self._has_chosen = False
        self._ends: Behaviour | None = None
        """The stopped branch, whose goals may still run."""

    def work(self) -> Work:
        if not (self._has_chosen and self.memory):
            status = yield from self._ask()
            if isinstance(self._condition, Behaviour) and is_left_out(self._condition):
                return leave_out(self)
            if status is Status.RUNNING or self.refused:
                return status
            self._choose(self._then if status is Status.SUCCESS else self._otherwise)
        if self._ends is not None:
            self.feedback_message = still_ends(self._ends)
            if self.feedback_message:
                return Status.RUNNING
            self._ends = None
        if self._chosen is None:
            self.refused, self.feedback_message = True, "the condition does not hold"
            return Status.FAILURE
        status = yield from self.ticked(self._chosen)
        if status is not Status.RUNNING and is_left_out(self._chosen):
            return leave_out(self)
        return status

    def _ask(self) -> Work:
        asked = self._condition
        if isinstance(asked, Behaviour):
            return (yield from self.ticked(asked))

        def answer() -> Status:
            return Status.SUCCESS if asked() else Status.FAILURE

        return self._answer(answer) or Status.INVALID

    def _choose(self, chosen: Behaviour | None) -> None:
        before = self._chosen
        if before is not None and before is not chosen and before.status is Status.RUNNING:
            before.stop(Status.INVALID)
            self._ends = before
        self._chosen, self._has_chosen = chosen, True


class Pipeline(Working):
    """A composite that ticks its children in order, succeeded ones again while a later one runs.

    A tick goes up to the first RUNNING child at or behind the farthest place that the visit has
    reached; children before that may run, too. The node fails with any child, and succeeds with the
    last. A child that has succeeded begins again at each tick; `Every` holds it back.

    Args:
        name: as in py_trees.
        children: in order.
    """

    passes_on = True

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)

    def initialise(self) -> None:
        self._reached = 0

    def work(self) -> Work:
        left_out = 0
        for place, child in enumerate(self.children):
            status = yield from self.ticked(child)
            if status is Status.RUNNING:
                if place >= self._reached:
                    self._reached = place
                    return status
            elif is_left_out(child):
                left_out += 1
            elif status is Status.FAILURE:
                return status
        return leave_out(self) if left_out == len(self.children) else Status.SUCCESS


class _Placed(Working):
    """A composite that begins a visit with the child at its own place."""

    passes_on = True

    def __init__(self, name: str, children: Sequence[Behaviour]) -> None:
        super().__init__(name, children)
        self._next = 0

    def shutdown(self) -> None:
        self._next = 0


class InTurn(_Placed):
    """A fallback that begins behind the child that has succeeded last.

    A visit tries each child once, from there to the last and on from the first. The visit begins at
    the first child after all have failed, after a stop while it ran, and after `shutdown`.

    Args:
        name: as in py_trees.
        children: in order.
    """

    in_words = "fallback, in turn"

    def initialise(self) -> None:
        self._tried = self._left_out = 0

    def work(self) -> Work:
        while self._tried < len(self.children):
            child = self.children[self._next]
            status = yield from self.ticked(child)
            if status is Status.RUNNING:
                return status
            self._next = (self._next + 1) % len(self.children)
            self._tried += 1
            if is_left_out(child):
                self._left_out += 1
            elif status is Status.SUCCESS:
                return status
        self._next = 0
        return leave_out(self) if self._left_out == self._tried else Status.FAILURE

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID and self.status is Status.RUNNING:
            self._next = 0


class Resume(_Placed):
    """A sequence that goes on, after a failure or a stop, with the child that failed or ran.

    Args:
        name: as in py_trees.
        children: in order.
    """

    in_words = "sequence, resumed"

    def work(self) -> Work:
        while self._next < len(self.children):
            status = yield from self.ticked(self.children[self._next])
            if status is not Status.SUCCESS:
                return status
            self._next += 1
        self._next = 0
        return leave_out(self) if all(map(is_left_out, self.children)) else Status.SUCCESS
