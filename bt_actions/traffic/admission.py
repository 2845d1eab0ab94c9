"""Whether a goal may be sent now, and what keeps it back.

Looks at what is known, and neither asks nor sends anything. All under the host's lock.
"""

from __future__ import annotations

from bt_actions.goals.policy import Busy, Outcome
from bt_actions.goals.terms import State
from bt_actions.servers.presence import Server
from bt_actions.traffic import route
from bt_actions.traffic.state import GoalHandle

IN_FLIGHT = 8
"""Goal requests of this process, of all its nodes, under way at a server; its queue holds 10, and
drops what is over silently."""
BESIDE = 1.0
"""Seconds for which a server may be in sight before another one that was there all the time, or
that came back with it; 0.5 measured."""


def finds_server(handle: GoalHandle, now: float) -> bool:
    """Whether the goal wants one, and it is there, alone, and hears us."""
    endpoint = handle.endpoint
    return (
        handle.goal.state is State.WAITING_FOR_SERVER
        and not endpoint.orphaned
        and not route.holds_back(endpoint, now)
        and endpoint.watch.state(now) is Server.READY
        and not _may_overtake(handle)
    )


def left_near(handle: GoalHandle) -> list[GoalHandle]:
    """Return the goals of this process that were lost, or have given up their resources.

    Those that share its server, or resources with it, which a goal that may still run must not
    where it may not run beside another. One that was lost holds nothing any more; should its server
    be back, it is canceled first.
    """
    goal, action = handle.goal, handle.endpoint.action
    return [
        each
        for each in handle.endpoint.domain.left
        if each.endpoint.action == action
        or each.goal.resources & (goal.exclusive if each.goal.outstanding else goal.resources)
    ]


def is_clear(handle: GoalHandle, now: float) -> bool:
    """Whether there is room at its server, and nothing that was `left_near` may run beside it."""
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
        return ""  # one that just runs has it
    if any(each.goal.outstanding for each in left_near(handle)):
        return ": what it would use still has a goal that was given up, and would run both"
    if _may_overtake(handle):
        return ": it has not answered another goal's request, and might run that one last"
    return handle.endpoint.participant.instead(*handle.endpoint.action)


def _may_overtake(handle: GoalHandle) -> bool:
    """Whether the request of a goal that it replaces, or that replaces it, is under way.

    From two nodes they arrive in any order, and the server runs the last one.
    """
    holders = handle.endpoint.domain.resources.holders(handle.goal.resources)
    at, action = holders.index(handle), handle.endpoint.action
    rivals = holders[:at] if handle.goal.busy is Busy.REPLACE else []
    rivals += [other for other in holders[at + 1 :] if other.goal.busy is Busy.REPLACE]
    return any(other.goal.request_pending and other.endpoint.action == action for other in rivals)
