"""How one endpoint reaches its server: in its node's participant or, where that fails, in another.

Our participant may be blind to a server that runs (ros/rediscovery.py), or that server deaf to it
(servers/reachability.py). This tells the rediscovery when, tries a client in the
participant that it makes, and has the endpoint go on with that one, and fall back when it is gone.
Of goals it decides nothing: they are told that their server is to be asked anew, and given time for
that. All under the one lock.
"""

from __future__ import annotations

import contextlib
import functools
import time
import uuid
from typing import TYPE_CHECKING, Any

from bt_actions.goals.terms import Event, State
from bt_actions.ros.action_client import ActionClient
from bt_actions.ros.alive import is_valid
from bt_actions.ros.graph import enclave, servers
from bt_actions.ros.log import log
from bt_actions.ros.rediscovery import SecondParticipant, look_for
from bt_actions.servers.presence import LEASE, Server
from bt_actions.servers.reachability import NEVER, TWICE, Reachability
from bt_actions.servers.stalls import ANSWERS_TAKE
from bt_actions.traffic import alarm

if TYPE_CHECKING:
    from bt_actions.traffic.endpoint import ActionEndpoint

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
    """The way of one endpoint to its server (rediscovery.Seeker)."""

    def __init__(self, endpoint: ActionEndpoint) -> None:
        self._endpoint = endpoint
        self.name = endpoint.name
        self.second: SecondParticipant | None = None
        """Where the endpoint's client lives, if not in its node's participant."""
        self._remapped = _remapped(endpoint.traffic.node, endpoint.name)
        self._long_stalls = endpoint.traffic.long_stalls
        self._last_question_at = NEVER  # to a server that has answered another client

    def __repr__(self) -> str:
        return f"<Route to {self.name}, {'its own' if self.second is None else 'another'}>"

    def shown(self) -> frozenset[bytes]:
        """Return the GIDs of the servers in sight; raises where the participant is gone."""
        if self.second is not None:
            return self.second.shows(self.name)
        return servers(self._endpoint.traffic.node, self.name)

    def holds_back(self, now: float) -> bool:
        """Whether nothing is sent though a server is in sight: it may not be heard, or be two."""
        return self.in_doubt(now) > 0.0 or self._discovers(now)

    def _discovers(self, now: float) -> bool:
        """Whether a second server may be there that a new participant has not discovered yet.

        The first one may be the wrong one, or both may move.
        """
        made_at = self._endpoint.traffic.seen_since if self.second is None else self.second.made_at
        came_at = max(made_at, self._endpoint.in_sight_since)
        is_new = came_at - made_at < TOO_NEW and now - came_at < DISCOVERS
        return is_new and not self._is_absent(now)

    # Does the server hear us?

    def in_doubt(self, now: float) -> float:
        """Return for how many seconds a server that is silent may not have heard us; or 0."""
        if self._endpoint.orphaned or self._is_absent(now):
            return 0.0  # there is no other way
        return self._hearing(now).in_doubt(now)

    def wants_question(self, now: float) -> bool:
        """Whether to ask the server something now, just in order to be answered."""
        reachability = self._hearing(now)
        return not self._is_absent(now) and reachability.take_question(now)

    def _hearing(self, now: float) -> Reachability:
        """Return that of our client, which knows of all stalls by now."""
        reachability = self._endpoint.client.reachability
        if alarm.stalls.long_times != self._long_stalls:
            self._long_stalls = alarm.stalls.long_times
            reachability.doubt(now)
        return reachability

    def seek(self, now: float) -> None:
        """Have another way looked for, where this one fails."""
        if self.misses():
            domain = self._endpoint.traffic.domain
            look_for(self, domain.number, self._enclave, at_once=self.in_doubt(now) > 0.0)

    @functools.cached_property
    def _enclave(self) -> str:
        return enclave(self._endpoint.traffic.node)

    # What the rediscovery asks, and does

    def misses(self) -> bool:
        """Whether a server is wanted that may be there, though nothing shows all of it.

        Or it is shown, and does not answer. Not while answers may be under way: in a second, what
        runs on an absent server is lost. And not where remapping rules give our node another server
        than a new participant would find.
        """
        endpoint, now = self._endpoint, time.monotonic()
        if endpoint.orphaned or not endpoint.goals or self._remapped:
            return False
        if now - endpoint.traffic.seen_since < TOO_NEW:
            return False
        if endpoint.users <= 0 and all(handle.goal.lost for handle in endpoint.goals.values()):
            return False  # nobody here wants it; it is remembered, as what is put away is
        domain = endpoint.traffic.domain
        known = domain.lost_sight or (self.name, endpoint.action_type) in domain.known
        running = (State.SENDING, State.EXECUTING, State.REPLACED)
        still = all(handle.goal.state not in running for handle in endpoint.goals.values())
        return (known and self._is_absent(now) and still) or self._is_unresponsive(now)

    def _is_absent(self, now: float) -> bool:
        return self._endpoint.watch.state(now) is Server.ABSENT

    def _is_unresponsive(self, now: float) -> bool:
        """Whether a server is in sight that has not answered for long.

        Not where nobody has taken its answers.
        """
        endpoint = self._endpoint
        if self._is_absent(now) or not endpoint.client.reachability.is_unresponsive(now):
            return False
        endpoint.pump()
        return endpoint.client.reachability.is_unresponsive(now)

    def is_waited_for(self) -> bool:
        """Whether a goal is still to be sent."""
        return any(not handle.goal.sent for handle in self._endpoint.goals.values())

    def client_in(self, second: SecondParticipant) -> ActionClient:
        """Return a client like our own in another participant, on trial."""
        endpoint, now = self._endpoint, time.monotonic()
        client = ActionClient(second.node, endpoint.action_type, self.name, endpoint)
        client.on_trial = True
        if not self._is_absent(now):
            endpoint.client.reachability.tried(now)
            client.reachability.doubt(now, TWICE)
            self._last_question_at = NEVER
        return client

    def prefers(self, client: ActionClient) -> bool:
        """Whether this client, which is ready, is heard where our own is not, or sees the server.

        A server that answers nobody is busy; one that has just answered this client would answer
        our own as well, if it heard it.
        """
        now = time.monotonic()
        if self._is_absent(now):
            return True
        if not self._is_unresponsive(now):
            return False
        client.pump()
        if not client.reachability.heard:
            if client.reachability.take_question(now):
                ask(client, ON_TRIAL)
            return False
        if self._last_question_at == NEVER:
            self._last_question_at = now
            self._endpoint.probe()
        return now - self._last_question_at >= LAST_WORD

    def move_to(self, second: SecondParticipant, client: ActionClient) -> None:
        """Go on with a client in a participant that sees the server; the alarm takes its answers.

        What is under way in the old one is not heard there. A question for a result, or a cancel,
        is asked anew; of a goal request nobody knows whether it has arrived.
        """
        endpoint, now = self._endpoint, time.monotonic()
        blind, seen = self._is_absent(now), endpoint.watch.gids
        endpoint.pump()
        if endpoint.client.closed:  # by what came, and nobody used the endpoint
            client.destroy()
            return
        second.users.add(self)
        client.on_trial = False
        self._go_on_with(client, second)
        if blind:
            log.info(f"{self.name}: out of sight of this node though it runs; a new one sees it")
            return
        log.info(f"{self.name}: does not hear this node any more; a new one is heard")
        for handle in list(endpoint.goals.values()):
            if handle.replies.sent_to & seen:  # it may be shown later than another of its name
                handle.not_gone_before = max(handle.not_gone_before, now + LEASE)
            handle.goal.hold(ANSWERS_TAKE, endpoint.traffic.clocks.now())
            endpoint.tell(handle, Event.SERVER_CHANGED)

    # There, and back

    def fall_back(self) -> bool:
        """Go on in our node's participant, as the other is gone; return whether that is there."""
        endpoint = self._endpoint
        if self.second is None:
            return is_valid(endpoint.traffic.node)  # the next look may see more
        try:
            client = ActionClient(endpoint.traffic.node, endpoint.action_type, self.name, endpoint)
        except Exception:  # noqa: BLE001 - or it is gone by now, too
            return False
        self._go_on_with(client, None)
        return True

    def _go_on_with(self, client: ActionClient, second: SecondParticipant | None) -> None:
        self._endpoint.close()
        self.second = second
        self._endpoint.open(client)

    def leave(self) -> None:
        """Need the other participant no more."""
        if self.second is not None:
            self.second.left_by(self)
            self.second = None


def ask(client: ActionClient, probe: int) -> None:
    """Ask just in order to be answered."""
    with contextlib.suppress(Exception):  # the next look finds out why it cannot be sent
        client.probe(probe, uuid.uuid4().bytes)


def _remapped(node: Any, name: str) -> bool:
    """Whether rules of this node lead any part of an action elsewhere."""
    topics = [f"{name}/_action/{part}" for part in ("status", "feedback")]
    services = [f"{name}/_action/{part}" for part in ("send_goal", "cancel_goal", "get_result")]
    return any(node.resolve_topic_name(topic) != topic for topic in topics) or any(
        node.resolve_service_name(service) != service for service in services
    )
