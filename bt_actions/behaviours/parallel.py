"""A composite that ticks its children beside each other; a finished one is not started again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel as PyTreesParallel

from bt_actions.behaviours.leaving import is_left_out, leave_out

_OVER = (Status.SUCCESS, Status.FAILURE)


class Parallel(PyTreesParallel):
    """A composite that succeeds when enough children have, and fails as soon as that cannot happen.

    The decision is made after each child: running children are stopped then, and the children
    behind are not ticked. py_trees' own Parallel fails with the first failed child, whatever the
    policy, and starts finished children again unless told otherwise.

    Args:
        name: as in py_trees.
        at_least: how many children must succeed; all of them where not given.
        fails_after: after how many failures it fails, though it might still succeed.
    """

    passes_on = True

    left_out = False

    def __init__(
        self,
        name: str,
        children: Sequence[Behaviour],
        *,
        at_least: int | None = None,
        fails_after: int | None = None,
    ) -> None:
        super().__init__(name, ParallelPolicy.SuccessOnAll(synchronise=True), list(children))
        self.at_least, self.fails_after = at_least, fails_after

    def tick(self) -> Iterator[Behaviour]:
        if self.status is not Status.RUNNING:
            for child in self.children:
                if child.status is not Status.INVALID:
                    child.stop(Status.INVALID)
            self.current_child = None
            self.left_out = False
            self.initialise()
            self.status = Status.RUNNING  # should a child raise, `stop` is to reach the others
        needed = len(self.children) if self.at_least is None else self.at_least
        count = Counter(child.status for child in self.children if not is_left_out(child))
        status, left_out = self._decide(count, needed, 0), 0
        for child in self.children:
            if child.status not in _OVER or is_left_out(child):  # left-out ones are asked again
                yield from child.tick()
                if child.status in _OVER and is_left_out(child):
                    left_out += 1
                else:
                    count[child.status] += 1
                status = self._decide(count, needed, left_out)
            if status is not Status.RUNNING:
                break
        self.left_out = left_out == len(self.children)
        if self.left_out:
            status = leave_out(self)
        for child in self.children:
            if child.status is status:
                self.current_child = child
        if status is not Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

    def _decide(self, count: Counter[Status], needed: int, left_out: int) -> Status:
        """Return the status that follows from the counts of ended children."""
        done, failed = count[Status.SUCCESS], count[Status.FAILURE]
        self.feedback_message = f"{done} of {needed} succeeded, {failed} failed"
        if done >= needed or (self.at_least is None and done + left_out >= needed):
            return Status.SUCCESS
        impossible = len(self.children) - failed < needed or failed == self.fails_after
        return Status.FAILURE if impossible else Status.RUNNING
