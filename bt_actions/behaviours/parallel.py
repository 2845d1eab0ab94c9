"""A composite that ticks its children beside each other; a finished one is not started again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel as PyTreesParallel


class Parallel(PyTreesParallel):
    """Succeeds when enough children have; fails as soon as that cannot happen any more.

    That is decided after each child: those that run are stopped then, and the children behind are
    not ticked. py_trees' own Parallel fails with the first child that
    does, whatever the policy, and starts finished children again unless told otherwise.

    Args:
        name: as in py_trees.
        at_least: how many children must succeed; all of them where not given.
    """

    passes_on = True

    def __init__(
        self, name: str, children: Sequence[Behaviour], *, at_least: int | None = None
    ) -> None:
        super().__init__(name, ParallelPolicy.SuccessOnAll(synchronise=True), list(children))
        self.at_least = at_least

    def tick(self) -> Iterator[Behaviour]:
        if self.status is not Status.RUNNING:
            for child in self.children:
                if child.status is not Status.INVALID:
                    child.stop(Status.INVALID)
            self.current_child = None
            self.initialise()
            self.status = Status.RUNNING  # should a child raise, `stop` is to reach the others
        needed = len(self.children) if self.at_least is None else self.at_least
        count = Counter(child.status for child in self.children)
        status = self._decide(count, needed)
        for child in self.children:
            if child.status not in (Status.SUCCESS, Status.FAILURE):
                yield from child.tick()
                count[child.status] += 1
                status = self._decide(count, needed)
            if status is not Status.RUNNING:
                break
        for child in self.children:
            if child.status is status:
                self.current_child = child
        if status is not Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

    def _decide(self, count: Counter[Status], needed: int) -> Status:
        """Return what follows from how many children have ended how."""
        done, failed = count[Status.SUCCESS], count[Status.FAILURE]
        self.feedback_message = f"{done} of {needed} succeeded, {failed} failed"
        enough, possible = done >= needed, len(self.children) - failed >= needed
        return Status.SUCCESS if enough else Status.RUNNING if possible else Status.FAILURE
