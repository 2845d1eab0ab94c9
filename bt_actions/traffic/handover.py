"""The handover of goals that were lost, or left, from one endpoint to another of the same action.

Each node discovers servers for itself. So a goal that lost its server belongs to the first node of
this process that sees the server again; that node cancels the goal before it sends another. The
caller holds the host's lock.
"""

from __future__ import annotations

from bt_actions.goals.terms import NEVER, Event
from bt_actions.servers.presence import LEASE, Server
from bt_actions.traffic.driver import retire, take_in, tell
from bt_actions.traffic.route import TOO_NEW
from bt_actions.traffic.state import Endpoint

LOST_KEPT = 100
"""Goals of one action, the newest, that are kept in case their server or their request turns up."""


def take_over(endpoint: Endpoint, now: float) -> None:
    """Take lost goals of other nodes whose server is in sight here; the server cancels them first.

    A goal moves where its server has gone for the other node, or where the other node takes a
    living server for a dead one, which is shown until its lease runs out. Where both endpoints see
    the same, the goal stays: otherwise the two would hand it to each other in turn.
    """
    watch = endpoint.watch
    if watch.state(now) is Server.ABSENT:
        return
    for handle in list(endpoint.domain.left):
        other, servers = handle.endpoint, handle.replies.sent_to
        not_others = other is endpoint or other.action != endpoint.action
        if not_others or not handle.goal.lost or not servers & watch.gids:
            continue
        taken_for_dead = watch.all_live(now) and not other.watch.all_live(now)
        if other.orphaned or other.watch.gone(now, servers) or taken_for_dead:
            retire(handle)
            take_in(endpoint, handle)


def adopt(endpoint: Endpoint) -> None:
    """Take goals that were lost, or left, at this action before, to cancel them first."""
    for handle in endpoint.domain.lost.pop(endpoint.action, []):
        saw_it = endpoint.participant.seen_since + TOO_NEW < handle.begun_at.steady
        if handle.endpoint.participant is not endpoint.participant and not saw_it:
            # A later node only has to discover the server
            until = endpoint.host.steady() + (LEASE if handle.not_gone_before == NEVER else TOO_NEW)
            handle.not_gone_before = max(handle.not_gone_before, until)
        take_in(endpoint, handle)


def park(endpoint: Endpoint, *, all_of_them: bool = False) -> None:
    """Leave goals that are lost, or hold nothing any more, or all, to the next endpoint."""
    for handle in endpoint.handles:
        goal = handle.goal
        if all_of_them or (goal.outcome is not None and not goal.claims_resources):
            tell(handle, Event.PARKED)
        if goal.lost:
            goal.deadlines.clear()  # nobody looks out for its server from now on
            endpoint.domain.lost[endpoint.action].append(handle)
            retire(handle)


def bound_the_lost(endpoint: Endpoint) -> None:
    """Give up the oldest of too many lost goals; keep those that a server may still decide on."""
    forgettable = [handle for handle in endpoint.handles if handle.accounted_for]
    for handle in forgettable[:-LOST_KEPT]:
        tell(handle, Event.ABANDONED)
        endpoint.host.record.strike(handle.goal.id)
