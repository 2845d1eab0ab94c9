"""Sees, under one deadline, to goals that nobody wants any more until they are accounted for.

It cancels them, takes what is answered, and gives up in the end: no goal is waited for twice. What
becomes of a goal is for goals/goal.py to decide, and when to ask anew, too. `Drain` never waits;
`drain` does, on the host's condition.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.terms import Event, State
from bt_actions.traffic.handle import Endpoint, GoalHandle
from bt_actions.traffic.host import Host

JUST_PAST = 0.1
"""Seconds by which a drain outlasts the goals' own deadlines, so that they take effect in it."""
LAST_REQUESTS = 0.4
"""Seconds, at most, in which cancel requests go out that waited for room when it was given up."""
LOOKS_OUT_AT_MOST = 30.0
"""Seconds for which servers are looked out for though this process stands still again and again."""
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
    while not hurry():
        with host.lock:
            if drains.step():
                break
            host.changed.wait(LOOK)
    until = host.steady() + LAST_REQUESTS
    with host.lock:
        while drains.has_requests and host.steady() < until:
            drains.pump()
            host.changed.wait(LOOK)
        return drains.finish()


class Drain:
    """The drain of some goals; each step is for who holds the lock.

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
                handle.endpoint.tell(handle, Event.INTERRUPTED)
            self._waits = [
                each for each in self._wanted if not each.is_over and not each.goal.waited_for
            ]
            self._deadline = 0.0
            self._began = host.steady()
            self._lost: set[GoalHandle] = set()
            self._were_back: set[GoalHandle] = set()
            self._allow({handle for handle in self._waits if not handle.looked_out_for})

    def step(self) -> bool:
        """Take what has come and do what is due; return whether to wait no longer."""
        if self._is_over():
            return True
        self.pump()
        for handle in self._waits:
            handle.endpoint.mind(handle)
        self._waits = [handle for handle in self._waits if not handle.is_over]
        return not self._waits

    def pump(self) -> None:
        """Take what has come."""
        for endpoint in self._endpoints:
            endpoint.pump()

    @property
    def has_requests(self) -> bool:
        """Whether cancel requests still wait for room: whoever drains may end the process now."""
        return any(each.endpoint.cancels.has_request(each.goal.id) for each in self._waits)

    def finish(self) -> list[GoalHandle]:
        """Wait no longer; return the goals whose end is UNKNOWN, or may be."""
        for handle in self._waits:  # all at once, though a server's queue drops what is too much
            handle.endpoint.cancels.send_now(handle.goal.id)
        for handle in self._waits:
            handle.endpoint.tell(handle, Event.DRAINED)
        return [handle for handle in self._wanted if not handle.is_over]

    @property
    def _endpoints(self) -> list[Endpoint]:
        return list(dict.fromkeys(handle.endpoint for handle in self._waits))

    def _is_over(self) -> bool:
        """Whether nobody waits any longer."""
        now = self._host.steady()
        doubts = (handle.endpoint.in_doubt(now) for handle in self._waits)
        if max(self._host.stalls.answers_take(now), *doubts, 0.0) > 0.0:
            self._deadline = max(self._deadline, now + ASK_AGAIN)
        self._lost.update(handle for handle in self._waits if handle.goal.lost)
        back = {each for each in self._lost if each.goal.state not in (State.LOST, State.DONE)}
        self._allow(back - self._were_back)  # once: else one that comes and goes had no end
        self._lost, self._were_back = self._lost - back, self._were_back | back
        looks_out = any(handle.looked_out_for for handle in self._waits)
        if looks_out and now < self._began + LOOKS_OUT_AT_MOST:
            return False
        return not self._waits or now >= self._deadline

    def _allow(self, handles: set[GoalHandle]) -> None:
        """Give these goals the time that their cancel may take."""
        if handles:
            within = max(handle.goal.drains_within for handle in handles)
            self._deadline = max(self._deadline, self._host.steady() + within + JUST_PAST)
