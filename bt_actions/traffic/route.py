"""How one endpoint reaches its server: in its node's participant or, where that fails, in another.

Our participant may not see a server that runs (ros/rediscovery.py), or that server may not hear it
(servers/reachability.py). This tells the participant to have another one look, tries a transport in
that, and has the endpoint use it, and fall back when it is gone. Goals are told that their server
is to be asked anew, and given time for that. All under the host's lock.
"""

from __future__ import annotations

import contextlib

from bt_actions.goals.terms import NEVER, Event, State
from bt_actions.servers.presence import LEASE, Server
from bt_actions.servers.reachability import TWICE, Reachability
from bt_actions.traffic.handle import Endpoint
from bt_actions.traffic.host import Host
from bt_actions.traffic.stalls import ANSWERS_TAKE
from bt_actions.traffic.transport import ActionTransport, Opener, probe

LAST_WORD = 0.5
"""Seconds within which a server that is not busy answers."""
TOO_NEW = 3.0
"""Seconds for which a participant has dropped nobody: no lease that is useful is shorter.

After them it has discovered who was there."""
DISCOVERS = 1.0
"""Seconds that a participant, while it is new, takes to see all servers of a name: of two that had
been up for long, the second was seen up to 0.6 s after the first, on one machine."""
ON_TRIAL = 0
"""The number of a trial's probe, of which nobody is told."""


class Route:
    """How one endpoint reaches its server (a transport.Seeker)."""

    def __init__(self, endpoint: Endpoint, host: Host) -> None:
        self._endpoint, self._host, self.name = endpoint, host, endpoint.name
        self.elsewhere = False
        """The transport is not in our node's participant: nobody spins it."""
        self._long_stalls = endpoint.participant.long_stalls
        self._last_question_at = NEVER  # to a server that has answered another transport

    def holds_back(self, now: float) -> bool:
        """Whether nothing is sent though a server is in sight: it may not be heard, or be two.

        Of two, a new participant may not have discovered the second yet. The first one may be the
        wrong one, or both may move.
        """
        if self.in_doubt(now) > 0.0:
            return True
        seen_since = self._endpoint.transport.seen_since
        came_at = max(seen_since, self._endpoint.watch.in_sight_since)
        is_new = came_at - seen_since < TOO_NEW and now - came_at < DISCOVERS
        return is_new and not self._is_absent(now)

    # Does the server hear us?

    def in_doubt(self, now: float) -> float:
        """Return for how many seconds a server that is silent may not have heard us; or 0."""
        if self._endpoint.orphaned or self._is_absent(now):
            return 0.0  # there is no other way
        return self._reachability(now).in_doubt(now)

    def take_question(self, now: float) -> bool:
        """Whether to ask the server something now, just in order to be answered; takes the turn."""
        reachability = self._reachability(now)
        return not self._is_absent(now) and reachability.take_question(now)

    def _reachability(self, now: float) -> Reachability:
        """Return that of our transport, which knows of all stalls by now."""
        reachability, stalls = self._endpoint.transport.reachability, self._host.stalls
        stalls.lives(now)  # whoever asks may be the first to run again
        if stalls.long_times != self._long_stalls:
            self._long_stalls = stalls.long_times
            reachability.doubt(now)
        return reachability

    def seek(self) -> None:
        """Have another way looked for, where this one fails."""
        if self.misses():
            self._endpoint.participant.seek(self)

    # What whoever looks for it asks, and does

    def misses(self) -> bool:
        """Whether a server is wanted that may be there, though nothing shows all of it.

        Or it is shown, and does not answer. Not while answers may be under way: in a second, what
        runs on an absent server is lost.
        """
        endpoint, now = self._endpoint, self._host.steady()
        is_new = now - endpoint.participant.seen_since < TOO_NEW
        if endpoint.orphaned or is_new or not endpoint.goals:
            return False
        if endpoint.users <= 0 and all(handle.goal.lost for handle in endpoint.handles):
            return False  # nobody here wants it; it is remembered, as what is parked is
        known = endpoint.domain.ever_lost_sight or endpoint.action in endpoint.domain.known
        running = (State.SENDING, State.EXECUTING, State.REPLACED)
        still = all(handle.goal.state not in running for handle in endpoint.handles)
        return (known and self._is_absent(now) and still) or self._is_unresponsive(now)

    def _is_absent(self, now: float) -> bool:
        return self._endpoint.watch.state(now) is Server.ABSENT

    def _is_unresponsive(self, now: float) -> bool:
        """Whether a server is in sight that has not answered for long.

        Not where nobody has taken its answers.
        """
        endpoint = self._endpoint
        if self._is_absent(now) or not endpoint.transport.reachability.is_unresponsive(now):
            return False
        endpoint.deliver_arrived()
        return endpoint.transport.reachability.is_unresponsive(now)

    @property
    def has_unsent(self) -> bool:
        """Whether a goal is still to be sent."""
        return self._endpoint.has_unsent

    def try_in(self, participant: Opener) -> ActionTransport:
        """Return a transport like our own in another participant, on trial."""
        endpoint, now = self._endpoint, self._host.steady()
        transport = participant.open_transport(*endpoint.action, endpoint)
        transport.on_trial = True
        if not self._is_absent(now):
            endpoint.transport.reachability.tried(now)
            transport.reachability.doubt(now, TWICE)
            self._last_question_at = NEVER
        return transport

    def try_and_compare(self, transport: ActionTransport) -> bool:
        """Ask in this one, which is ready; whether it is heard where our own is not, or sees more.

        A server that answers nobody is busy; one that has just answered this one would answer our
        own as well, if it heard it.
        """
        now = self._host.steady()
        if self._is_absent(now):
            return True
        if not self._is_unresponsive(now):
            return False
        transport.deliver_arrived()
        if not transport.reachability.heard:
            if transport.reachability.take_question(now):
                with contextlib.suppress(Exception):
                    probe(transport, ON_TRIAL, now)
            return False
        if self._last_question_at == NEVER:
            self._last_question_at = now
            self._endpoint.probe()
        return now - self._last_question_at >= LAST_WORD

    def move_to(self, transport: ActionTransport) -> None:
        """Use a transport in a participant that sees the server; nobody spins that.

        What is under way in the old one is not heard there. A question for a result, or a cancel,
        is asked anew; of a goal request nobody knows whether it has arrived.
        """
        endpoint, now = self._endpoint, self._host.steady()
        blind, seen = self._is_absent(now), endpoint.watch.gids
        endpoint.deliver_arrived()
        if endpoint.transport.closed:  # by what came, and nobody used the endpoint
            transport.close()
            return
        transport.on_trial = False
        self.elsewhere = True
        endpoint.replace_transport(transport)
        if blind:
            self._host.log.info(
                f"{self.name}: out of sight of this node though it runs; a new one sees it"
            )
            return
        self._host.log.info(f"{self.name}: does not hear this node any more; a new one is heard")
        for handle in endpoint.handles:
            if handle.replies.sent_to & seen:  # it may be shown later than another of its name
                handle.not_gone_before = max(handle.not_gone_before, now + LEASE)
            handle.goal.deadlines.suspend(ANSWERS_TAKE, endpoint.participant.now())
            endpoint.tell(handle, Event.SERVER_CHANGED)

    def fall_back(self) -> bool:
        """Use our node's participant again, as the other is gone; return whether that is there."""
        endpoint = self._endpoint
        if not self.elsewhere:
            return endpoint.participant.alive()  # the next look may see more
        try:
            transport = endpoint.participant.open_transport(*endpoint.action, endpoint)
        except Exception:  # noqa: BLE001 - or it is gone by now, too
            return False
        self.elsewhere = False
        endpoint.replace_transport(transport)
        return True
