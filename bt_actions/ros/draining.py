"""Waits, under one deadline, until goals that nobody wants any more are accounted for.

It cancels them, takes what is answered, and gives up in the end: no goal is waited for twice. What
becomes of a goal is for goals/goal.py to decide, and when to ask anew, too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from bt_actions.goals.goal import ASK_AGAIN
from bt_actions.goals.terms import Event, State
from bt_actions.ros import alarm
from bt_actions.ros.shared import Ticket, changed, lock
from bt_actions.servers.stalls import AT_MOST

JUST_PAST = 0.1
"""Seconds by which a drain outlasts the goals' own deadlines, so that they take effect in it."""
LAST_REQUESTS = 0.4
"""Seconds, at most, in which cancel requests go out that waited for room when it was given up."""
LOOKS_OUT_AT_MOST = 30.0
"""Seconds for which servers are looked out for though this process stands still again and again."""
LOOK = 0.005
"""Seconds between two looks, where nothing wakes it."""


def drain(tickets: Iterable[Ticket], hurry: Callable[[], bool] = lambda: False) -> list[Ticket]:
    """Cancel these goals and wait until each is accounted for, under one deadline.

    The deadline is the largest `timeout.cancel` among them, plus `timeout.accept` (twice, if that
    is more) where the acceptance is open. Where this process stood still, it leaves time for what
    is about to arrive, and for one more question; and where a server went away in silence, for its
    return, as it may only have stood still: what it still runs is canceled then. Answers are taken
    here too, so it does not matter whether anybody spins, whether the context is valid, or on which
    thread this runs. `hurry` is called again and again without the lock, and ends the wait early
    when it says so. No goal is waited for a second time. Returns the goals whose end is UNKNOWN, or
    may be.
    """
    with lock:
        wanted = [
            ticket
            for ticket in tickets
            if ticket.goal.state is not State.DONE and not ticket.line.is_parents
        ]
        for ticket in wanted:
            ticket.line.tell(ticket, Event.INTERRUPTED)
        waits = [t for t in wanted if not t.is_over and not t.goal.waited_for]
        patience = _Patience(waits)
    while waits and not hurry():
        with lock:
            if patience.is_over(waits):
                break
            for line in {ticket.line for ticket in waits}:
                line.pump()
            for ticket in waits:
                ticket.line.mind(ticket)
            waits = [ticket for ticket in waits if not ticket.is_over]
            if waits:
                changed.wait(LOOK)
    _send_what_waits(waits)
    with lock:
        for ticket in waits:
            if ticket.looked_out_for:
                ticket.goal.waited_for = True
            else:
                ticket.line.tell(ticket, Event.DRAINED)
    return [ticket for ticket in wanted if not ticket.is_over]


class _Patience:
    """The deadline of a drain; the caller holds the lock."""

    def __init__(self, waits: list[Ticket]) -> None:
        self._deadline = 0.0
        self._first, self._began = alarm.standstill.times, time.monotonic()
        self._lost: set[Ticket] = set()
        self._were_back: set[Ticket] = set()
        self._allow({ticket for ticket in waits if not ticket.looked_out_for})

    def is_over(self, waits: list[Ticket]) -> bool:
        """Whether nobody waits any longer for these goals."""
        still, now = alarm.standstill, time.monotonic()
        doubts = (ticket.line.way.in_doubt(now) for ticket in waits)
        held = max(still.answers_take(now), *doubts)
        if held > 0.0 and still.times - self._first <= AT_MOST:
            self._deadline = max(self._deadline, now + ASK_AGAIN)
        self._lost.update(ticket for ticket in waits if ticket.goal.lost)
        back = {ticket for ticket in self._lost if not ticket.goal.lost}
        self._allow(back - self._were_back)  # once: else one that comes and goes had no end
        self._lost, self._were_back = self._lost - back, self._were_back | back
        looks_out = any(ticket.looked_out_for for ticket in waits)
        if looks_out and now < self._began + LOOKS_OUT_AT_MOST:
            return False
        return now >= self._deadline

    def _allow(self, tickets: set[Ticket]) -> None:
        """Give these goals the time that their cancel may take."""
        if tickets:
            within = max(ticket.goal.drains_within for ticket in tickets)
            self._deadline = max(self._deadline, time.monotonic() + within + JUST_PAST)


def _send_what_waits(waits: list[Ticket]) -> None:
    """Send the cancel requests that still wait for room: whoever drains may end the process now.

    As fast as answers make room for them, as long as that takes no time worth mentioning; then all
    at once, though a server's queue drops what is too much for it.
    """
    until = time.monotonic() + LAST_REQUESTS
    with lock:
        while _has_requests(waits) and time.monotonic() < until:
            for line in {ticket.line for ticket in waits}:
                line.pump()
            changed.wait(LOOK)
        for ticket in waits:
            ticket.line.cancels.send_now(ticket.goal.id)


def _has_requests(waits: list[Ticket]) -> bool:
    return any(ticket.line.cancels.has_request(ticket.goal.id) for ticket in waits)
