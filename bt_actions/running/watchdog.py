"""Cancels a run's goals where a tick does not return that should have been the last.

While a behaviour does not return from it nobody else can stop the tree. Run beside the endpoints
while any goal is wanted; has no thread of its own.
"""

from __future__ import annotations

import math
import sys
import threading

from py_trees.behaviour import Behaviour

from bt_actions.behaviours.places import path_of
from bt_actions.running.goals import RunGoals
from bt_actions.traffic.traffic import Traffic

GRACE = 1.0
"""Seconds for a tick to return when the tree is to end."""
LOOK = 0.2
"""Seconds between two looks."""


class Watchdog:
    """Guards one tree's runs, one after another."""

    def __init__(self, traffic: Traffic, goals: RunGoals) -> None:
        self._traffic, self._host, self._goals = traffic, traffic.host, goals
        self.ends_at = math.inf
        """When the run is to end (seconds, steady clock); an interrupt makes it earlier."""
        self.ticks_on: int | None = None
        """The thread, until the last tick is over and what behaviours do when they are stopped."""
        self.gave_up = False
        """Whether it was so in this run: what the tree says since is of no account."""

    def begin(self, ends_at: float) -> None:
        """A run begins on this thread, which is to end at `ends_at` (seconds, steady clock)."""
        self.ticks_on, self.ends_at, self.gave_up = threading.get_ident(), ends_at, False

    def is_overdue(self, now: float) -> bool:
        """Whether the last tick should have been over for long; safe in a signal handler."""
        return self.ticks_on is not None and now - self.ends_at >= GRACE

    def gives_up(self) -> bool:
        """Whether nobody waits for the rest of this thread's tick any more."""
        if self.is_overdue(self._host.steady()) and not self._goals.wanted:
            self._give_up()  # else it is for `run_due`, which bears with stalls
        return self.gave_up

    def run_due(self, now: float) -> float:
        """Cancel what is wanted where the last tick is overdue; return the seconds until a look.

        Is run no more, until it is scheduled again, where none is wanted.
        """
        wanted = self._goals.wanted
        if not wanted:
            self._host.scheduler.remove(self)
        elif self.is_overdue(now) and not self._host.stalls.answers_take(now):
            self._give_up()
            for handle in wanted:
                self._traffic.interrupt(handle)
        return LOOK

    def _give_up(self) -> None:
        """Warn, and name the innermost behaviour that the ticking thread is in; once."""
        if self.gave_up:
            return
        self.gave_up, stuck = True, "the tree"
        frame = sys._current_frames().get(self.ticks_on or 0)  # noqa: SLF001 - documented
        while frame is not None:
            if isinstance(behaviour := frame.f_locals.get("self"), Behaviour):
                stuck = "/".join(path_of(behaviour))
                break
            frame = frame.f_back
        self._host.log.warning(f"{stuck} does not return from its tick: canceling all goals")
