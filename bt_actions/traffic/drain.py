"""The drain: cancel unwanted goals, and wait until they are accounted for, in bounded time.

A drain cancels its goals, takes answers, and gives up at its deadline: no goal is waited for twice.
goals/goal.py decides when to ask a server again, and when a goal has ended. `Drain` never waits;
`drain` waits on the host's condition.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.terms import Event, State
from bt_actions.traffic import cancel_queue
from bt_actions.traffic.driver import apply_deadlines, tell
from bt_actions.traffic.route import deliver_arrived, in_doubt
from bt_actions.traffic.state import GoalHandle, Host
from bt_actions.utilities.stepping import Done, Sleep

JUST_PAST = 0.1
"""Seconds by which a drain outlasts the goals' own deadlines, so that these take effect within it.
"""
LAST_REQUESTS = 0.4
"""Seconds, at most, after the drain gives up, for cancel requests that waited for room."""
LOOK = 0.005
"""Seconds between two looks, where nothing wakes the drain."""


def drain(
    host: Host, handles: Iterable[GoalHandle], hurry: Callable[[], bool] = lambda: False
) -> list[GoalHandle]:
    """Cancel these goals and wait until each is accounted for, under one deadline.

    The drain takes answers itself, so that a spinning executor, a valid context and a certain
    thread are not needed. `hurry` is called again and again without the lock; True ends the wait
    early. Returns the goals whose end is UNKNOWN, or may be.
    """
    drains = Drain(host, handles)
    while isinstance(step := drains.step(host.steady(), hurry=hurry()), Sleep):
        with host.lock:
            host.wait(step.seconds)
    return step.result


class Drain:
    """The drain of some goals, step by step.

    Its deadline is the largest `timeout.cancel` of the goals, plus `timeout.accept` (twice, if that
    is more) where the acceptance is open. After a stall of this process the drain leaves time for
    answers that are about to arrive, and for one more question. After a server went away in silence
    the drain leaves time for its return: the server may only have stood still, and a goal that runs
    there is canceled then.
    """

    def __init__(self, host: Host, handles: Iterable[GoalHandle]) -> None:
        """Cancel the goals."""
        self._host = host
        with host.lock:
            self._wanted = [
                handle
                for handle in handles
                if handle.goal.state is not State.DONE and not handle.endpoint.is_parents
            ]
            for handle in self._wanted:
                tell(handle, Event.INTERRUPTED)
            self._waits = [
                handle
                for handle in self._wanted
                if _may_end(handle) and not handle.goal.asking.in_vain
            ]
            self._gives_up_at: float | None = None
            self._lost: set[GoalHandle] = set()
            self._until: dict[tuple[GoalHandle, bool], float] = {}
            self._not_before = 0.0
            self._allow(host.steady())

    def step(self, now: float, *, hurry: bool = False) -> Sleep | Done[list[GoalHandle]]:
        """Take answers and do what is due (`now`: seconds, steady clock).

        `hurry` ends the wait; cancel requests that wait for room still go out, because the process
        may end now. The last step returns the goals whose end is UNKNOWN, or may be.
        """
        with self._host.lock:
            if self._gives_up_at is None:
                if not hurry and not self._is_over(now):
                    self._deliver_arrived()
                    for handle in self._waits:
                        apply_deadlines(handle)
                    self._waits = [handle for handle in self._waits if _may_end(handle)]
                    if self._waits:
                        return Sleep(LOOK)
                self._gives_up_at = now + LAST_REQUESTS
            requests = (each.goal.id in each.endpoint.cancels.waiting for each in self._waits)
            if now < self._gives_up_at and any(requests):
                self._deliver_arrived()
                return Sleep(LOOK)
            for each in self._waits:  # all at once, though a server's full queue drops some
                cancel_queue.send_now(each.endpoint, each.goal.id)
            for each in self._waits:
                tell(each, Event.DRAIN_GAVE_UP)
            return Done([each for each in self._wanted if not each.is_over])

    def _deliver_arrived(self) -> None:
        for endpoint in dict.fromkeys(handle.endpoint for handle in self._waits):
            deliver_arrived(endpoint)

    def _is_over(self, now: float) -> bool:
        """Return whether no goal is waited for any longer."""
        if not self._waits:
            return True
        doubtful = any(in_doubt(handle.endpoint, now) for handle in self._waits)
        if doubtful or self._host.stalls.answers_take(now):
            self._not_before = now + ASK_AGAIN
        self._allow(now)
        looks_out = any(handle.looked_out_for for handle in self._waits)
        return not looks_out and now >= max(self._not_before, *self._until.values())

    def _allow(self, now: float) -> None:
        """Give each goal the time that its cancel may take, and again when its server is back."""
        for handle in self._waits:
            is_back = handle in self._lost and not handle.goal.lost
            if not handle.looked_out_for:
                self._until.setdefault(
                    (handle, is_back), now + handle.goal.drains_within + JUST_PAST
                )
            if handle.goal.lost:
                self._lost.add(handle)


def _may_end(handle: GoalHandle) -> bool:
    """Return whether the goal's end is unknown and may become known; a DONE goal tells no more."""
    return not handle.is_over and handle.goal.state is not State.DONE
