"""Which run sets up, or ticks, a tree on this thread: its goals tell it what becomes of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextvars import ContextVar

from bt_actions.goals.policy import End
from bt_actions.traffic.handle import Change, GoalHandle, Run
from bt_actions.traffic.host import Host

begun_in: ContextVar[Run | None] = ContextVar("begun_in", default=None)
"""None where nobody has said it, as in a loop of the user's."""


def waker() -> Callable[[], None]:
    """Return what has the run of this thread tick soon; that may be called on any thread."""
    run = begun_in.get()
    return (lambda: None) if run is None else (lambda: run.tell(None))


def wake(handles: Iterable[GoalHandle]) -> None:
    """Have the runs of these goals tick: something may be sent, or can be read."""
    for run in {handle.begun_in: None for handle in handles}:
        if run is not None:
            run.tell(None)


def note(host: Host, handle: GoalHandle) -> None:
    """Report a goal's change to the log, and to its run."""
    goal, log = handle.goal, host.log
    told, handle.told = handle.told, None if goal.outcome is None else goal.end
    if handle.told is End.UNKNOWN is not told:
        if told is End.SERVER_GONE:
            log.warning(f"{goal!r}: its server is back; canceling it, should it still run there")
        else:
            why = f"{goal.reason}{goal.cancel_said}"
            log.error(f"{goal!r}: not accounted for, it may still be running: {why}")
    elif told is End.UNKNOWN is not handle.told:
        log.info(f"{goal!r}: accounted for at last")
    if handle.begun_in is not None:
        handle.begun_in.tell(Change(handle, goal.state, goal.outcome, goal.end, goal.reason))
    host.changed.notify_all()
