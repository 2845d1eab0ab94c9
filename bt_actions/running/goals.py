"""The goals of a tree's runs: which are its own, what is told of them, which are unaccounted for.

A goal is the tree's where its leaf, wherever that is by now, was last ticked in one of its ticks.
Changes are noted on any thread, and told on the one that ticks. Sends nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, TypeVar

from bt_actions.goals.policy import End
from bt_actions.goals.terms import State
from bt_actions.goals.unaccounted import GoalReport, report_of
from bt_actions.traffic.state import GoalHandle, Run, ticking_run

T = TypeVar("T")


class RunGoals:
    """The goals of one tree, until each is over."""

    def __init__(
        self,
        emit: Callable[..., None],
        wake: Callable[[], None],
        changed: Callable[[], None],
    ) -> None:
        """`emit` is called with what a GoalChanged is made of, `wake` where there is any.

        `changed` is called, under the lock of the traffic, where one of ours has changed.
        """
        self._emit, self._wake, self._changed = emit, wake, changed
        self._run = Run(self._note)
        self._changes: deque[tuple[GoalHandle, tuple[Any, ...]]] = deque()
        self._handles: dict[GoalHandle, None] = {}  # in the order in which they began
        self.run_goes_on = False
        """Between two runs only what earlier ones have left is of interest."""
        self.is_watched = True
        """Whether anybody but its leaf acts on what becomes of a goal."""

    def begun_in(self, step: Callable[[], T]) -> T:
        """Return what `step` does; what it sets up and ticks is ours."""
        before = ticking_run.set(self._run)
        try:
            return step()
        finally:
            ticking_run.reset(before)

    @property
    def not_over(self) -> list[GoalHandle]:
        """Those that something is left to wait for."""
        return [handle for handle in list(self._handles) if not handle.is_over]

    @property
    def wanted(self) -> list[GoalHandle]:
        """Those that a leaf waits for."""
        return [handle for handle in list(self._handles) if handle.goal.outcome is None]

    @property
    def unaccounted(self) -> list[GoalReport]:
        """Those whose end is UNKNOWN, by now."""
        return [
            report_of(handle.goal, handle.name)
            for handle in list(self._handles)
            if handle.goal.end is End.UNKNOWN
            and (handle.goal.outcome is not None or not self.run_goes_on)
        ]

    def close(self, now: float) -> None:
        """Take note of nothing any more, and tell what has only now become known."""
        self._run.notify = lambda handle: None
        self.tell(now)

    def _note(self, handle: GoalHandle | None) -> None:
        if handle is not None:
            goal = handle.goal
            is_news = handle in self._handles  # else its leaf is just beginning it
            self._handles[handle] = None
            said = goal.state.shown, handle.attempt, goal.outcome, goal.end, goal.reason
            self._changes.append((handle, (*said, goal.id.hex())))
            self._changed()
            may_be_sent = is_news and goal.state is State.WAITING_FOR_SERVER
            if not (self.is_watched or may_be_sent or goal.outcome is not None):
                return  # its leaf would do nothing
        elif not self.run_goes_on:
            return
        self._wake()

    def tell(self, now: float) -> None:
        """Tell what was noted, and forget what is over."""
        if not self._changes:
            return
        while self._changes:
            handle, change = self._changes.popleft()
            if handle.owner is not None:  # else its leaf was thrown away since
                self._emit(now, handle.owner, *change)
        for done in [each for each in list(self._handles) if each.is_over]:
            del self._handles[done]
