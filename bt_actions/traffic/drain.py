"""Sees, under one deadline, to goals that nobody wants any more until they are accounted for.

It cancels them, takes what is answered, and gives up in the end: no goal is waited for twice. What
becomes of a goal is for goals/goal.py to decide, and when to ask anew, too. `Drain` never waits;
`drain` does, on the host's condition.
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
"""Seconds by which a drain outlasts the goals' own deadlines, so that they take effect in it."""
LAST_REQUESTS = 0.4
"""Seconds, at most, in which cancel requests go out that waited for room when it was given up."""
LOOK = 0.005
"""Seconds between two looks, where nothing wakes it."""


def drain(
    host: Host, handles: Iterable[GoalHandle], hurry: Callable[[], bool] = lambda: False
) -> list[GoalHandle]:
    """Cancel these goals and wait until each is accounted for, under one deadline.

    Answers are taken here too, so it does not matter whether anybody spins, whether the context is
    valid, or on which thread this runs. `hurry` is called again and again without the lock, and
    ends the wait early when it says so. Returns the goals whose end is UNKNOWN, or may be.
    """
    drains = Drain(host, handles)
    while isinstance(step := drains.step(host.steady(), hurry=hurry()), Sleep):
        with host.lock:
            host.wait(step.seconds)
    return step.result


class Drain:
    """The drain of some goals, step by step.

    Its deadline is the largest `timeout.cancel` among them, plus `timeout.accept` (twice, if that
    is more) where the acceptance is open. Where this process stood still, it leaves time for what
    is about to arrive, and for one more question; and where a server went away in silence, for its
    return, as it may only have stood still: what it still runs is canceled then.
    """

    def __init__(self, host: Host, handles: Iterable[GoalHandle]) -> None:
        """Cancel them."""
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
        """Take what has come and do what is due (`now`: seconds, steady clock).

        With `hurry`, wait no longer for ends; cancel requests that wait for room still go out,
        because whoever drains may end the process now. In the end returns the goals whose end is
        UNKNOWN, or may be.
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
            for each in self._waits:  # all at once, though a server's queue drops what is too much
                cancel_queue.send_now(each.endpoint, each.goal.id)
            for each in self._waits:
                tell(each, Event.DRAIN_GAVE_UP)
            return Done([each for each in self._wanted if not each.is_over])

    def _deliver_arrived(self) -> None:
        for endpoint in dict.fromkeys(handle.endpoint for handle in self._waits):
            deliver_arrived(endpoint)

    def _is_over(self, now: float) -> bool:
        """Whether nobody waits any longer."""
        if not self._waits:
            return True
        doubtful = any(in_doubt(handle.endpoint, now) for handle in self._waits)
        if doubtful or self._host.stalls.answers_take(now):
            self._not_before = now + ASK_AGAIN
        self._allow(now)
        looks_out = any(handle.looked_out_for for handle in self._waits)
        return not looks_out and now >= max(self._not_before, *self._until.values())

    def _allow(self, now: float) -> None:
        """Give each goal the time that its cancel may take, and once more when it is back."""
        for handle in self._waits:
            is_back = handle in self._lost and not handle.goal.lost
            if not handle.looked_out_for:
                self._until.setdefault(
                    (handle, is_back), now + handle.goal.drains_within + JUST_PAST
                )
            if handle.goal.lost:
                self._lost.add(handle)


def _may_end(handle: GoalHandle) -> bool:
    """Whether its end is not known and may become known: nothing more comes of what is done."""
    return not handle.is_over and handle.goal.state is not State.DONE
