"""The watchdog of a run, on the alarm's thread.

The watchdog notices a tick that lasts, and a run that shall end and does not.

While a behaviour does not return from its tick, no other code can stop the tree, or tell its state.
The alarm runs the watchdog beside the endpoints; the watchdog has no thread of its own.
"""

from __future__ import annotations

import math
import sys
import threading

from py_trees.behaviour import Behaviour

from bt_actions.behaviours.places import innermost, path_of
from bt_actions.events import TickLasts
from bt_actions.running.goals import RunGoals
from bt_actions.running.telling import TreeTeller
from bt_actions.traffic.traffic import Traffic

GRACE = 1.0
"""Seconds for a tick to return when the tree is to end."""
LASTS = 1.0
"""Seconds after which the tick of a node is told."""
LOOK = 0.2
"""Seconds between two looks."""


class Watchdog:
    """The guard of one tree's runs, one after another."""

    def __init__(self, traffic: Traffic, goals: RunGoals, teller: TreeTeller) -> None:
        self._traffic, self._host, self._goals = traffic, traffic.host, goals
        self._teller = teller
        self.ends_at = math.inf
        """The moment at which the run is to end (seconds, steady clock); an interrupt makes it
        earlier."""
        self.ticks_on: int | None = None
        """The thread of the run; None after the last tick and the stops that follow it."""
        self.gave_up = False
        """Whether the watchdog gave up in this run: later words of the tree do not count."""
        self.ticks_since: float | None = None
        """The beginning of the tree's present tick (seconds, steady clock), or the return of a
        seen node's tick within it; None between ticks."""
        self.seen = False
        """Whether the present tick of one node was seen."""
        self._lasting: Behaviour | None = None
        """The node whose tick was told to last."""
        self._sees_ticks = False

    def begin(self, ends_at: float) -> None:
        """Begin a run on this thread, which is to end at `ends_at` (seconds, steady clock)."""
        self.ticks_on, self.ends_at, self.gave_up = threading.get_ident(), ends_at, False

    def see_ticks(self) -> None:
        """Look at the ticks of the run, with or without wanted goals."""
        self._sees_ticks = True
        with self._host.lock:
            self._host.scheduler.add(self)

    def is_overdue(self, now: float) -> bool:
        """Return whether the last tick should have been over for long; safe in a signal handler."""
        return self.ticks_on is not None and now - self.ends_at >= GRACE

    def gives_up(self) -> bool:
        """Return whether the rest of this thread's tick is waited for no longer."""
        if self.is_overdue(self._host.steady()) and not self._goals.wanted:
            self._give_up()  # else `run_due` decides, which bears with stalls
        return self.gave_up

    def tick_returned(self) -> None:
        """Take note that a node's seen tick is over."""
        with self._host.lock:
            now, since = self._host.steady(), self.ticks_since
            if since is not None:
                self._tell(now, since, is_over=True)
            self._lasting, self.seen, self.ticks_since = None, False, now

    def run_due(self, now: float) -> float:
        """Tell lasting ticks and late feedback; cancel the goals of an overdue tick.

        Returns the seconds until a look. Without wanted goals, and without ticks to see, the
        watchdog takes itself off the schedule.
        """
        wanted = self._goals.wanted
        self._goals.tell_feedback()
        self._see(now)
        if not wanted and not (self._sees_ticks and self.ticks_on is not None):
            self._host.scheduler.remove(self)
        elif wanted and self.is_overdue(now) and not self._host.stalls.answers_take(now):
            self._give_up()
            for handle in wanted:
                self._traffic.interrupt(handle)
        return LOOK

    def _see(self, now: float) -> None:
        """Tell, once, the node whose tick has not returned for long."""
        since = self.ticks_since  # the ticking thread sets it without the lock
        if since is None or self._lasting is not None:
            return
        if not self.seen:
            self.seen = True
        elif now - since >= LASTS:
            self._lasting = self._innermost()
            self._tell(now, since)

    def _tell(self, now: float, since: float, *, is_over: bool = False) -> None:
        number = self._teller.numbers.get(self._lasting)
        if number is not None:
            self._teller.stream.add(TickLasts, number, now - since, is_over)

    def _give_up(self) -> None:
        """Warn, once, with the innermost behaviour that the ticking thread is in."""
        if not self.gave_up:
            self.gave_up, inside = True, self._innermost()
            stuck = "the tree" if inside is None else "/".join(path_of(inside))
            self._host.log.warning(f"{stuck} does not return from its tick: canceling all goals")

    def _innermost(self) -> Behaviour | None:
        """Return the innermost behaviour that the ticking thread is in."""
        return innermost(sys._current_frames().get(self.ticks_on or 0))  # noqa: SLF001 - documented
