"""Whether a goal may be sent now, and what keeps it back.

It sends nothing. But before it says yes it observes the servers at which goals were lost, so that
what is back is canceled first; for that it may open endpoints. All under the host's lock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from bt_actions.goals.policy import Busy, Outcome
from bt_actions.goals.terms import State
from bt_actions.servers.presence import Server
from bt_actions.traffic.handle import Domain, Endpoint, GoalHandle
from bt_actions.traffic.host import Host
from bt_actions.traffic.watcher import BESIDE

IN_FLIGHT = 8
"""Goal requests of this process, of all its nodes, under way at a server; its queue holds 10, and
drops what is over silently."""


class Admission:
    """For the goals of one node."""

    def __init__(
        self,
        host: Host,
        domain: Domain,
        endpoints: Mapping[str, Endpoint],
        open_to: Callable[[Any, str], Endpoint],
    ) -> None:
        """`endpoints` are this node's, by name; `open_to` opens one more, to a type and a name."""
        self._host, self._domain, self._endpoints, self._open_to = host, domain, endpoints, open_to

    def may_send(self, handle: GoalHandle) -> bool:
        """Whether to send it now. If nothing else speaks against it, see to lost goals first."""
        endpoint, now = handle.endpoint, self._host.steady()
        if handle.goal.state is not State.WAITING_FOR_SERVER:
            return False
        if self._host.closing or endpoint.orphaned or not endpoint.participant.alive():
            return False
        if endpoint.holds_back(now) or endpoint.watch.state(now) is not Server.READY:
            return False
        if self._may_overtake(handle):
            return False
        left = self._left_near(handle)
        if self._cancel_what_is_back(handle, left):
            left = self._left_near(handle)
        at_server = (each for each in self._domain.open if each.action == endpoint.action)
        in_flight = sum(each.goal.in_flight for one in at_server for each in one.goals.values())
        return in_flight < IN_FLIGHT and not any(
            each.goal.outstanding or _may_come_back_for(each, handle, now) for each in left
        )

    def why_not(self, handle: GoalHandle) -> str:
        """Say, as the end of a sentence, what kept back a goal that was given up unsent."""
        endpoint = handle.endpoint
        if handle.goal.outcome is Outcome.SERVER_BUSY:
            return self._in_use(handle)
        if any(each.goal.outstanding for each in self._left_near(handle)):
            return ": what it would use still has a goal that was given up, and would run both"
        if self._may_overtake(handle):
            return ": it has not answered another goal's request, and might run that one last"
        return endpoint.participant.instead(endpoint.action_type, endpoint.name)

    def _in_use(self, handle: GoalHandle) -> str:
        """Say who has what the goal waited for, where that is not a goal that just runs."""
        for other in self._domain.resources.holders(handle.goal.resources):
            if other.paused:
                return f": it is the turn of {other.name}, whose tree is paused"
            if other.goal.outcome is not None and not other.accounted_for:
                told = other.goal.cancel_said
                return f": goal {other.goal.id.hex()} of {other.name} has not ended there{told}"
        return ""

    def _may_overtake(self, handle: GoalHandle) -> bool:
        """Whether the request of a goal that it replaces, or that replaces it, is under way.

        From two nodes they arrive in any order, and the server runs the last one.
        """
        holders = self._domain.resources.holders(handle.goal.resources)
        at = holders.index(handle)
        rivals = holders[:at] if handle.goal.busy is Busy.REPLACE else []
        rivals += [other for other in holders[at + 1 :] if other.goal.busy is Busy.REPLACE]
        action = handle.endpoint.action
        return any(
            other.goal.request_pending and other.endpoint.action == action for other in rivals
        )

    def _left_near(self, handle: GoalHandle) -> list[GoalHandle]:
        """Return the goals of this process that were lost, or have given up their resources.

        Those that share a server, or what this one must have for itself. One that was lost holds
        nothing any more; should its server be back, it is canceled first.
        """
        action, exclusive = handle.endpoint.action, handle.goal.exclusive
        return [
            each
            for each in self._domain.handles()
            if (each.goal.lost or not each.goal.claims_resources)
            and (each.endpoint.action == action or each.goal.resources & exclusive)
        ]

    def _cancel_what_is_back(self, handle: GoalHandle, near: list[GoalHandle]) -> bool:
        """Observe each server at which goals were lost that this one might run beside.

        Should it be back, they are canceled. Opens an endpoint where this node has none. Returns
        whether there was anything to observe.
        """
        to_see = dict.fromkeys(each.endpoint for each in near if each.goal.lost)
        left = {each.action: None for each in to_see}
        for (name, action_type), lost in list(self._domain.lost.items()):
            if any(each.goal.resources & handle.goal.exclusive for each in lost):
                left[name, action_type] = None
                if name not in self._endpoints:  # a server that nobody speaks to any more
                    self._open_to(action_type, name)
        for name, action_type in left:
            ours = self._endpoints.get(name)
            if ours is not None and ours.action == (name, action_type):
                to_see[ours] = None
        now = self._host.steady()
        for endpoint in to_see:  # all of them first: one may see what another has lost
            endpoint.observe_and_tell(now)
        return bool(to_see)


def _may_come_back_for(left: GoalHandle, handle: GoalHandle, now: float) -> bool:
    """Whether it was lost, and its server may only be shown later than that of this one.

    It is canceled first where its server is seen in time.
    """
    elsewhere = left.endpoint.action != handle.endpoint.action
    return left.goal.lost and elsewhere and now - handle.endpoint.watch.in_sight_since < BESIDE
