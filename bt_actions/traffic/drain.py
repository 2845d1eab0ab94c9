"""Waits, under one deadline, until goals that nobody wants any more are accounted for.

It cancels them, takes what is answered, and gives up in the end: no goal is waited for twice. What
becomes of a goal is for goals/goal.py to decide, and when to ask anew, too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.terms import Event, State
from bt_actions.traffic import alarm
from bt_actions.traffic.shared import GoalHandle, changed, lock

JUST_PAST = 0.1
"""Seconds by which a drain outlasts the goals' own deadlines, so that they take effect in it."""
LAST_REQUESTS = 0.4
"""Seconds, at most, in which cancel requests go out that waited for room when it was given up."""
LOOKS_OUT_AT_MOST = 30.0
"""Seconds for which servers are looked out for though this process stands still again and again."""
LOOK = 0.005
"""Seconds between two looks, where nothing wakes it."""


def drain(
    handles: Iterable[GoalHandle], hurry: Callable[[], bool] = lambda: False
) -> list[GoalHandle]:
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
            handle
            for handle in handles
            if handle.goal.state is not State.DONE and not handle.endpoint.is_parents
        ]
        for handle in wanted:
            handle.endpoint.tell(handle, Event.INTERRUPTED)
        waits = [t for t in wanted if not t.is_over and not t.goal.waited_for]
        patience = _Patience(waits)
    while waits and not hurry():
        with lock:
            if patience.is_over(waits):
                break
            for endpoint in {handle.endpoint for handle in waits}:
                endpoint.pump()
            for handle in waits:
                handle.endpoint.mind(handle)
            waits = [handle for handle in waits if not handle.is_over]
            if waits:
                changed.wait(LOOK)
    _send_what_waits(waits)
    with lock:
        for handle in waits:
            handle.endpoint.tell(handle, Event.DRAINED)
    return [handle for handle in wanted if not handle.is_over]


class _Patience:
    """The deadline of a drain; the caller holds the lock."""

    def __init__(self, waits: list[GoalHandle]) -> None:
        self._deadline = 0.0
        self._began = time.monotonic()
        self._lost: set[GoalHandle] = set()
        self._were_back: set[GoalHandle] = set()
        self._allow({handle for handle in waits if not handle.looked_out_for})

    def is_over(self, waits: list[GoalHandle]) -> bool:
        """Whether nobody waits any longer for these goals."""
        now = time.monotonic()
        doubts = (handle.endpoint.route.in_doubt(now) for handle in waits)
        if max(alarm.stalls.answers_take(now), *doubts) > 0.0:
            self._deadline = max(self._deadline, now + ASK_AGAIN)
        self._lost.update(handle for handle in waits if handle.goal.lost)
        back = {each for each in self._lost if each.goal.state not in (State.LOST, State.DONE)}
        self._allow(back - self._were_back)  # once: else one that comes and goes had no end
        self._lost, self._were_back = self._lost - back, self._were_back | back
        looks_out = any(handle.looked_out_for for handle in waits)
        if looks_out and now < self._began + LOOKS_OUT_AT_MOST:
            return False
        return now >= self._deadline

    def _allow(self, handles: set[GoalHandle]) -> None:
        """Give these goals the time that their cancel may take."""
        if handles:
            within = max(handle.goal.drains_within for handle in handles)
            self._deadline = max(self._deadline, time.monotonic() + within + JUST_PAST)


def _send_what_waits(waits: list[GoalHandle]) -> None:
    """Send the cancel requests that still wait for room: whoever drains may end the process now.

    As fast as answers make room for them, as long as that takes no time worth mentioning; then all
    at once, though a server's queue drops what is too much for it.
    """
    until = time.monotonic() + LAST_REQUESTS
    with lock:
        while _has_requests(waits) and time.monotonic() < until:
            for endpoint in {handle.endpoint for handle in waits}:
                endpoint.pump()
            changed.wait(LOOK)
        for handle in waits:
            handle.endpoint.cancels.send_now(handle.goal.id)


def _has_requests(waits: list[GoalHandle]) -> bool:
    return any(handle.endpoint.cancels.has_request(handle.goal.id) for handle in waits)
