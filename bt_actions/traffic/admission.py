"""The admission of a goal: whether to send the request now, and the reason where not.

Admission reads known facts. Nothing here asks or sends. The caller holds the host's lock.
"""

from __future__ import annotations

from bt_actions.goals.policy import Busy, Outcome
from bt_actions.goals.terms import State
from bt_actions.servers.presence import Server
from bt_actions.traffic import route
from bt_actions.traffic.state import GoalHandle

IN_FLIGHT = 8
"""Goal requests under way at one server, of this process with all its nodes. The server's queue
holds 10, and drops the rest silently."""
BESIDE = 1.0
"""Seconds that a server may be in sight before a second one of its name is shown, though both were
there, or came back together (0.5 measured)."""


def finds_server(handle: GoalHandle, now: float) -> bool:
    """Return whether the goal waits for a server, and that server is ready, alone, and hears us."""
    endpoint = handle.endpoint
    return (
        handle.goal.state is State.WAITING_FOR_SERVER
        and not endpoint.orphaned
        and not route.holds_back(endpoint, now)
        and endpoint.watch.state(now) is Server.READY
        and not _may_overtake(handle)
    )


def left_near(handle: GoalHandle) -> list[GoalHandle]:
    """Return lost and released goals of this process that share a server or resource with `handle`.

    A goal that may still run bars the goals that must not run beside it. A lost goal holds no
    resource; should its server be back, the lost goal is canceled first.
    """
    goal, action = handle.goal, handle.endpoint.action
    return [
        each
        for each in handle.endpoint.domain.left
        if each.endpoint.action == action
        or each.goal.resources & (goal.exclusive if each.goal.outstanding else goal.resources)
    ]


def is_clear(handle: GoalHandle, now: float) -> bool:
    """Return whether the server has room, and no goal that was `left_near` bars this one."""
    endpoint = handle.endpoint
    at_server = [each for each in endpoint.domain.open if each.action == endpoint.action]
    in_flight = sum([each.goal.in_flight for one in at_server for each in one.goals.values()])
    just_came = now - endpoint.watch.in_sight_since < BESIDE  # another server may be shown later
    return in_flight < IN_FLIGHT and not any(
        each.goal.outstanding
        or (each.goal.lost and just_came and each.endpoint.action != endpoint.action)
        for each in left_near(handle)
    )


def why_not(handle: GoalHandle) -> str:
    """Say, as the end of a sentence, what kept back a goal that was given up unsent."""
    if handle.goal.outcome is Outcome.SERVER_BUSY:
        for other in handle.endpoint.domain.resources.holders(handle.goal.resources):
            if other.paused:
                return f": it is the turn of {other.name}, whose tree is paused"
            if other.goal.outcome is not None and not other.accounted_for:
                told = other.goal.cancel_said
                return f": goal {other.goal.id.hex()} of {other.name} has not ended there{told}"
        return ""  # the holder simply runs
    if any(each.goal.outstanding for each in left_near(handle)):
        return ": a goal on the same resources was given up, and both would run"
    if _may_overtake(handle):
        return ": the server has not answered another goal's request, and might run that one last"
    return handle.endpoint.participant.instead(*handle.endpoint.action)


def _may_overtake(handle: GoalHandle) -> bool:
    """Return whether the request of a goal that replaces this one, or is replaced by it, is open.

    Requests of two nodes arrive in any order, and the server runs the last one.
    """
    holders = handle.endpoint.domain.resources.holders(handle.goal.resources)
    at, action = holders.index(handle), handle.endpoint.action
    rivals = holders[:at] if handle.goal.busy is Busy.REPLACE else []
    rivals += [other for other in holders[at + 1 :] if other.goal.busy is Busy.REPLACE]
    return any(other.goal.request_pending and other.endpoint.action == action for other in rivals)
