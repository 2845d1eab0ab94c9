"""What is to be done for goals, as values, in the order in which it was decided.

A goal decides at once, whoever tells it something. What follows waits in one queue of its domain;
whoever runs it first carries out all, also what is decided meanwhile, which comes behind. So
nothing is done by recursion, and no effect overtakes an older one. Carries out nothing itself.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from enum import Enum

from bt_actions.goals.policy import Busy
from bt_actions.goals.terms import Command, State
from bt_actions.traffic.handle import GoalHandle, Standing


class Do(Enum):
    """What is done beside the goal's commands."""

    __hash__ = object.__hash__

    NOTE = "report that it has changed"
    WAKE_WAITING = "wake those whose goals may have waited for this"
    RECORD = "put what more is known of it on record, if it is there"
    STRIKE = "take it off the record"
    RETIRE = "see to it no more"
    REPLACE = "tell older goals on its resources that it has taken their place"


def what_follows(handle: GoalHandle, commands: Iterable[Command]) -> Iterator[Do | Command]:
    """Return what is to be done after a step of a goal, in order."""
    goal, before, now = handle.goal, handle.standing, Standing.of(handle)
    handle.standing = now
    if now.shown != before.shown:
        yield Do.NOTE
    if now.in_the_way != before.in_the_way:
        yield Do.WAKE_WAITING
    yield from commands
    if now.answered and not before.answered:
        yield Do.STRIKE
    elif not now.answered and now.lost != before.lost and goal.state is not State.DONE:
        yield Do.RECORD
    if goal.state is State.DONE and not before.done:
        yield Do.RETIRE
    newly = now.accepted and not before.accepted and goal.state is State.EXECUTING
    if newly and goal.busy is Busy.REPLACE:
        yield Do.REPLACE


class Effects:
    """The queue; the caller holds the host's lock."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._runs = False

    def put(self, carry_out: Callable[[], None]) -> None:
        """Have this carried out behind what was decided before."""
        self._waiting.append(carry_out)

    def run_all(self) -> None:
        """Carry out all, unless that is under way."""
        if self._runs:
            return
        self._runs = True
        try:
            while self._waiting:
                self._waiting.popleft()()
        finally:
            self._runs = False
