"""Looks at a run from the alarm's thread: at a tick that lasts, and at one that was to be the last.

While a behaviour does not return from its tick, nobody else can stop the tree, or tell of it. Run
beside the endpoints; has no thread of its own.
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
"""Seconds from which on the tick of a node is told of."""
LOOK = 0.2
"""Seconds between two looks."""


class Watchdog:
    """Guards one tree's runs, one after another."""

    def __init__(self, traffic: Traffic, goals: RunGoals, teller: TreeTeller) -> None:
        self._traffic, self._host, self._goals = traffic, traffic.host, goals
        self._teller = teller
        self.ends_at = math.inf
        """When the run is to end (seconds, steady clock); an interrupt makes it earlier."""
        self.ticks_on: int | None = None
        """The thread, until the last tick is over and what behaviours do when they are stopped."""
        self.gave_up = False
        """Whether it was so in this run: what the tree says since is of no account."""
        self.ticks_since: float | None = None
        """When the present tick of the tree began (seconds, steady clock), or within it the tick
        of a node returned that was seen; None between ticks."""
        self.seen = False
        """Whether the present tick of one node was seen."""
        self._lasting: Behaviour | None = None
        """Whose tick was told to last."""
        self._sees_ticks = False

    def begin(self, ends_at: float) -> None:
        """A run begins on this thread, which is to end at `ends_at` (seconds, steady clock)."""
        self.ticks_on, self.ends_at, self.gave_up = threading.get_ident(), ends_at, False

    def see_ticks(self) -> None:
        """Look at the ticks of the run, wanted goals or not."""
        self._sees_ticks = True
        with self._host.lock:
            self._host.scheduler.add(self)

    def is_overdue(self, now: float) -> bool:
        """Whether the last tick should have been over for long; safe in a signal handler."""
        return self.ticks_on is not None and now - self.ends_at >= GRACE

    def gives_up(self) -> bool:
        """Whether nobody waits for the rest of this thread's tick any more."""
        if self.is_overdue(self._host.steady()) and not self._goals.wanted:
            self._give_up()  # else it is for `run_due`, which bears with stalls
        return self.gave_up

    def tick_returned(self) -> None:
        """Take note that a node's tick is over that was seen."""
        with self._host.lock:
            now, since = self._host.steady(), self.ticks_since
            if since is not None:
                self._tell(now, since, is_over=True)
            self._lasting, self.seen, self.ticks_since = None, False, now

    def run_due(self, now: float) -> float:
        """Tell what lasts, and feedback that came too soon; cancel what an overdue tick leaves.

        Returns the seconds until a look. Is run no more where no goal is wanted and no tick is to
        be seen, until it is scheduled again.
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
        """Tell, once, whose tick has not returned for long."""
        since = self.ticks_since  # which the ticking thread sets without the lock
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
        """Warn, and name the innermost behaviour that the ticking thread is in; once."""
        if not self.gave_up:
            self.gave_up, inside = True, self._innermost()
            stuck = "the tree" if inside is None else "/".join(path_of(inside))
            self._host.log.warning(f"{stuck} does not return from its tick: canceling all goals")

    def _innermost(self) -> Behaviour | None:
        """Return the innermost behaviour that the ticking thread is in."""
        return innermost(sys._current_frames().get(self.ticks_on or 0))  # noqa: SLF001 - documented
