"""Watches over the server of one endpoint: looks at discovery, asks, and tells the goals.

Decides when to look. Who is alive is for servers/presence.py to say, and what follows for a goal
for servers/replies.py. All under the host's lock.
"""

from __future__ import annotations

import contextlib

from bt_actions.goals.terms import NEVER, Event
from bt_actions.servers.presence import Server
from bt_actions.traffic import handover
from bt_actions.traffic.route import TOO_NEW, Route
from bt_actions.traffic.state import Endpoint, Host, wake

LOOK_WHILE_WAITING = 0.05
LOOK_WHILE_RUNNING = 0.2
LOOK_AT_REST = 1.0
DELIVER_EVERY = 0.01
"""Seconds between two looks at a server: somebody waits for it; goals are open on it; it is ready
and alone, so that it does to count those in sight meanwhile, every LOOK_WHILE_RUNNING. The last:
between two takes of answers, where nobody spins."""
SILENT_FOR = 40.0
"""Seconds without a word of their server until goals whose node is gone are left to whoever can see
whether it is there: longer than a dead one is shown, or a question is kept (DENIED_FOR_GOOD)."""
BESIDE = 1.0
"""Seconds for which a server may be in sight before another one that was there all the time, or
that came back with it; 0.5 measured."""


class Watcher:
    """The watch over one endpoint's server."""

    def __init__(self, endpoint: Endpoint, host: Host, route: Route) -> None:
        self._endpoint, self._host, self._route = endpoint, host, route
        self._look_at = 0.0
        self._looked_at = NEVER  # and told
        self._counted = 0  # at the last look
        self._looked_like = Server.ABSENT
        self._held_back = (True, True)  # as a server has just come; by `Route.holds_back`

    def run_due(self, now: float) -> float:
        """Look, send and apply deadlines as far as due; return the seconds until there is more."""
        endpoint = self._endpoint
        if not endpoint.goals:
            return self.look_early(now)
        if now >= self._look_at:
            (self.recent_state if self._rests else self.observe_and_tell)(now)
            handover.bound_the_lost(endpoint, self._host)
            waits = endpoint.has_unsent or endpoint.watch.state(now) is Server.UNCLEAR
            self._look_at = now + (LOOK_WHILE_WAITING if waits else LOOK_WHILE_RUNNING)
        wait = self._look_at - now
        endpoint.cancels.send_more(now)
        if endpoint.orphaned or self._route.elsewhere:
            endpoint.deliver_arrived()
            if not all(handle.accounted_for for handle in endpoint.handles):
                wait = min(wait, DELIVER_EVERY)
        for handle in endpoint.handles:
            endpoint.apply_deadlines(handle)
        return wait

    @property
    def _is_alone(self) -> bool:
        """Whether one server was there at the last look, and ready."""
        return self._looked_like is Server.READY and not self._endpoint.watch.is_crowded

    @property
    def _rests(self) -> bool:
        """Whether it was so, and nothing is held back from it."""
        return self._is_alone and not any(self._held_back)

    def recent_state(self, now: float) -> Server:
        """Return the server's state; look, unless that was done lately, and the count is as then.

        Who has taken another's place since is seen right after a send.
        """
        endpoint = self._endpoint
        is_new = now - self._looked_at < LOOK_AT_REST and self._is_alone
        is_new &= endpoint.action not in endpoint.domain.lost  # what was left is canceled first
        if is_new and endpoint.participant.alive() and not self._counts_others():
            if self._rests:
                self._look_at = max(self._look_at, now + LOOK_WHILE_RUNNING)
            return Server.READY
        return self.observe_and_tell(now)

    def look_early(self, now: float) -> float:
        """Look for a server that no goal wants yet; return the seconds until the next look.

        A first goal is held from the first sight of its server on. So the hold is one for all
        servers of a tree, and runs while the rest of it is set up.
        """
        endpoint, scheduler = self._endpoint, self._host.scheduler
        is_new = now - endpoint.transport.seen_since < TOO_NEW and not endpoint.transport.closed
        if is_new and (self._counts_others() or self._counted):
            self.observe_and_tell(now)
        if is_new and self._looked_like is Server.ABSENT:
            scheduler.add(endpoint)
            scheduler.wake_by(now + LOOK_WHILE_WAITING)
        elif not endpoint.goals:
            scheduler.remove(endpoint)
        return LOOK_WHILE_WAITING

    def _counts_others(self) -> bool:
        """Whether a server has come or gone since the last look, or our node was destroyed."""
        try:
            return self._endpoint.transport.count() != self._counted
        except Exception:  # noqa: BLE001 - the middleware's: any
            return not self._endpoint.orphaned

    def rest(self) -> None:
        """Look at once when there is a goal again."""
        self._look_at = 0.0

    def begin_anew(self) -> None:
        """Nothing of what was seen counts any more."""
        self._looked_like = Server.ABSENT
        self._look_at, self._looked_at = 0.0, NEVER

    def observe_and_tell(self, now: float) -> Server:
        """Observe the server, tell the goals what that means for them, and return its state."""
        endpoint, watch = self._endpoint, self._endpoint.watch
        alive = endpoint.participant.alive()
        if not alive:
            self._orphan()
        if watch.is_crowded:  # before silence is judged
            if self._host.stalls.answers_take(now):
                watch.stood_still(now)
            endpoint.deliver_arrived()
        if endpoint.transport.closed:  # by what came, and nobody used the endpoint
            return Server.ABSENT
        if not alive:
            if watch.is_crowded:  # of those shown when the node went, asking tells who lives
                watch.observe(now, True, watch.gids)
                self._tell_goals(now)
            return Server.ABSENT
        try:
            self._ask_discovery(now)
        except Exception:  # noqa: BLE001 - the participant was destroyed since
            if not self._route.fall_back():
                self._orphan()
            return Server.ABSENT
        handover.adopt(endpoint, self._host)
        handover.take_over(endpoint, now)
        self._tell_goals(now)
        before = self._looked_like
        state = self._looked_like = watch.state(now)
        self._looked_at = now
        held_back = (now - watch.in_sight_since < BESIDE, self._route.holds_back(now))
        if (state, held_back) != (before, self._held_back):
            wake(endpoint.handles)  # what waits for it, or was held back, may be sent
        self._held_back = held_back
        if state is not before:
            endpoint.domain.ever_lost_sight |= state is Server.ABSENT
            endpoint.domain.known.add(endpoint.action)
            if state is Server.AMBIGUOUS:
                self._host.log.warning(
                    f"{endpoint.name}: two action servers answer to this name; no more is sent"
                )
        self._route.seek()
        return state

    def _tell_goals(self, now: float) -> None:
        """Ask who lives, if that is open, and tell each goal what is known of its server."""
        endpoint, watch = self._endpoint, self._endpoint.watch
        runs = any(handle.goal.sent and not handle.goal.lost for handle in endpoint.handles)
        if self._route.take_question(now) or watch.wants_probe(now, runs=runs):
            endpoint.probe()
        for handle in endpoint.handles:
            gone = watch.gone(now, handle.replies.sent_to)
            if not gone:
                handle.not_gone_before = NEVER  # it has been discovered
            if gone and now < handle.not_gone_before:
                continue  # it has not been discovered yet, though its status may have come already
            in_sight = handle.replies.sent_to <= watch.gids and not gone
            if not in_sight and self._host.stalls.servers_take(now) > 0.0:
                continue  # as this process stood still
            if handle.goal.sent:
                if gone and not handle.goal.lost:
                    endpoint.deliver_arrived()  # its last words
                endpoint.pass_on(handle, handle.replies.looked(watch, now))

    def observe(self) -> None:
        """Observe who is in sight; what follows is for `observe_and_tell` to say."""
        watch = self._endpoint.watch
        with contextlib.suppress(Exception):
            if self._endpoint.transport.servers() != watch.gids:
                self._looked_at = NEVER
                self._ask_discovery(self._host.steady(), concludes=False)

    def _ask_discovery(self, now: float, *, concludes: bool = True) -> None:
        """Let the watch see what discovery shows; raises where our node is gone."""
        transport = self._endpoint.transport
        self._counted = transport.count()
        ready, servers = transport.ready(), transport.servers()
        self._endpoint.watch.observe(now, ready, servers, concludes=concludes)

    def _orphan(self) -> None:
        """Our node is gone, or its context: nobody can want these goals any more."""
        endpoint, now = self._endpoint, self._host.steady()
        if not endpoint.orphaned:
            endpoint.orphaned, endpoint.heard_at = True, now
            self._looked_like = Server.ABSENT
            if any(not handle.accounted_for for handle in endpoint.handles):
                if endpoint.participant.shut_down():
                    self._host.log.info(f"{endpoint.name}: ROS is shut down; canceling its goals")
                else:
                    self._host.log.warning(
                        f"{endpoint.name}: the node is gone; canceling what it left"
                    )
        for handle in endpoint.handles:  # also one that was begun since
            handle.goal.deadlines.disarm(Event.LOOK_OUT_DUE)  # from here nobody sees it come back
            if handle.goal.outcome is None:
                endpoint.tell(handle, Event.INTERRUPTED)
        silent = now - endpoint.heard_at > SILENT_FOR
        if silent and not self._host.stalls.answers_take(now):
            handover.park(endpoint, all_of_them=True)
