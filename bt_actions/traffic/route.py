"""The route of one endpoint to its server: through its node's participant, or through another.

The node's participant may not see a running server (ros/rediscovery.py), or the server may not hear
that participant (servers/reachability.py). Then this file asks for another participant, and tries
its transport; `watcher.move_to` uses that transport as long as it lasts. No function here tells an
event to a goal. The caller holds the host's lock.
"""

from __future__ import annotations

import contextlib

from bt_actions.goals.terms import NEVER, State
from bt_actions.servers.presence import PROBES_KEPT, Server, ServerWatch
from bt_actions.servers.reachability import TWICE, Reachability
from bt_actions.traffic import cancel_queue
from bt_actions.traffic.state import Endpoint
from bt_actions.traffic.transport import ActionTransport, nobodys, send_probe

TOO_NEW = 3.0
"""Seconds for which a participant has dropped no server: no useful lease is shorter.

After them the participant has discovered every server that was there.
"""
DISCOVERS = 1.0
"""Seconds that a new participant takes to see all servers of a name: of two servers that had been
up for long, the second was seen up to 0.6 s after the first, on one machine."""
LAST_WORD = 0.5
"""Seconds within which a server that is not busy answers."""
ON_TRIAL = 0
"""The number of a trial's probe; the answers reach no goal."""
LOOK_WHILE_RUNNING = 0.2
"""Seconds between two looks at a server on which goals are open."""


# Sight, questions and answers


def is_absent(endpoint: Endpoint, now: float) -> bool:
    """Return whether no server was in sight at the last look or glance."""
    return endpoint.watch.state(now) is Server.ABSENT


def glance(endpoint: Endpoint) -> None:
    """Let the watch see the servers in sight; the consequences are for `watcher.look`."""
    with contextlib.suppress(Exception):
        if endpoint.transport.servers() != endpoint.watch.gids:
            endpoint.looked_at = NEVER
            ask_discovery(endpoint, endpoint.host.steady(), concludes=False)


def ask_discovery(endpoint: Endpoint, now: float, *, concludes: bool = True) -> None:
    """Let the watch see what discovery shows; raises where our node is gone."""
    transport = endpoint.transport
    endpoint.counted = transport.count()
    ready, servers = transport.ready(), transport.servers()
    endpoint.watch.see(now, ready, servers, concludes=concludes)


def probe(endpoint: Endpoint) -> None:
    """Ask the server a question whose only purpose is an answer."""
    number, now = next(endpoint.probes), endpoint.host.steady()
    endpoint.watch.probe_sent(now, nobodys(number))
    endpoint.transport.forget(nobodys(number - PROBES_KEPT))
    with contextlib.suppress(Exception):  # the next look finds out why it cannot be sent
        send_probe(endpoint.transport, number, now)


def deliver_arrived(endpoint: Endpoint) -> None:
    """Take arrived messages, whether or not an executor spins; an error in one stops nothing."""
    if endpoint.is_parents:
        return
    try:
        for transport in (endpoint.transport, *endpoint.former):
            transport.deliver_arrived()
    except Exception as error:  # noqa: BLE001 - the middleware's: any
        endpoint.warn_once("something that arrived could not be taken", error)
    cancel_queue.send_more(endpoint, endpoint.host.steady())


# Whether the server hears us


def holds_back(endpoint: Endpoint, now: float) -> bool:
    """Return whether to send nothing though a server is in sight: the server may be deaf, or two.

    A new participant may not have discovered the second of two servers yet. The first one may be
    the wrong one, or both robots may move.
    """
    if in_doubt(endpoint, now):
        return True
    seen_since = endpoint.transport.seen_since
    came_at = max(seen_since, endpoint.watch.in_sight_since)
    is_new = came_at - seen_since < TOO_NEW and now - came_at < DISCOVERS
    return is_new and not is_absent(endpoint, now)


def in_doubt(endpoint: Endpoint, now: float) -> bool:
    """Return whether a silent server may not have heard us, and another way may exist."""
    if endpoint.orphaned or is_absent(endpoint, now):
        return False
    return _reachability(endpoint, now).in_doubt(now) > 0.0


def take_question(endpoint: Endpoint, now: float) -> bool:
    """Return whether to ask the server a question for its answer alone; a True uses the turn up."""
    reachability = _reachability(endpoint, now)
    return not is_absent(endpoint, now) and reachability.take_question(now)


def _reachability(endpoint: Endpoint, now: float) -> Reachability:
    """Return the transport's reachability, after it was told of all stalls by now."""
    reachability, stalls = endpoint.transport.reachability, endpoint.host.stalls
    stalls.lives(now)  # this call may be the first sign of life after a stall
    if stalls.long_times != endpoint.long_stalls:
        endpoint.long_stalls = stalls.long_times
        reachability.doubt(now)
    return reachability


# Another way


def misses(endpoint: Endpoint) -> bool:
    """Return whether a wanted server may be there, though it is not shown whole, or is silent.

    Goals under way come first: a goal on an absent server counts as lost within a second.
    """
    now = endpoint.host.steady()
    is_new = now - endpoint.participant.seen_since < TOO_NEW
    if endpoint.orphaned or is_new or not endpoint.goals:
        return False
    if endpoint.users <= 0 and all(handle.goal.lost for handle in endpoint.handles):
        return False  # nobody here wants the server; its goals are kept, as parked ones are
    known = endpoint.domain.ever_lost_sight or endpoint.action in endpoint.domain.known
    running = (State.SENDING, State.EXECUTING, State.REPLACED)
    still = all(handle.goal.state not in running for handle in endpoint.handles)
    return (known and is_absent(endpoint, now) and still) or is_unresponsive(endpoint, now)


def is_unresponsive(endpoint: Endpoint, now: float) -> bool:
    """Return whether a server in sight has been silent for long, with its arrived answers taken."""
    if is_absent(endpoint, now) or not endpoint.transport.reachability.is_unresponsive(now):
        return False
    deliver_arrived(endpoint)
    return endpoint.transport.reachability.is_unresponsive(now)


def begin_trial(endpoint: Endpoint, transport: ActionTransport) -> None:
    """Try a second transport, which was opened in another participant."""
    transport.beside_another = True
    now = endpoint.host.steady()
    if not is_absent(endpoint, now):
        endpoint.transport.reachability.tried(now)
        transport.reachability.doubt(now, TWICE)
        endpoint.compared_at = NEVER


def is_better(endpoint: Endpoint, transport: ActionTransport) -> bool:
    """Return whether the second transport is heard where our own is not, or sees more.

    The caller asks again and again until an answer has had time to come. A server that answers
    neither transport is busy. A server that has just answered the second one would answer our own
    as well, if it heard that.
    """
    now = endpoint.host.steady()
    if is_absent(endpoint, now):
        return True
    if not is_unresponsive(endpoint, now):
        return False
    transport.deliver_arrived()
    if not transport.reachability.heard:
        if transport.reachability.take_question(now):
            with contextlib.suppress(Exception):
                send_probe(transport, ON_TRIAL, now)
        return False
    if endpoint.compared_at == NEVER:
        endpoint.compared_at = now
        probe(endpoint)
    return now - endpoint.compared_at >= LAST_WORD


def replace_transport(endpoint: Endpoint, transport: ActionTransport) -> None:
    """Use another transport, with nothing known yet.

    The old transport stays open for the goal requests that are under way: on a link that loses
    requests the middleware sends them again, as long as their sender is there.
    """
    pending = [each for each in endpoint.handles if each.goal.request_pending]
    endpoint.transport.beside_another = True
    endpoint.former[endpoint.transport] = pending
    close_former(endpoint)
    endpoint.transport, endpoint.watch = transport, ServerWatch()
    endpoint.looked_like, endpoint.looked_at = Server.ABSENT, NEVER
    endpoint.look_soon()
    endpoint.host.scheduler.wake_by(endpoint.host.steady())


def close_former(endpoint: Endpoint) -> None:
    """Close the replaced transports that have no goal request under way any more."""
    for transport, sent in list(endpoint.former.items()):
        if not any(handle.goal.request_pending for handle in sent):
            del endpoint.former[transport]
            transport.close()


def fall_back(endpoint: Endpoint) -> bool:
    """Use our node's participant again, as the other is gone; return whether ours is there."""
    if not endpoint.elsewhere:
        return endpoint.participant.alive()  # the next look may see more
    try:
        transport = endpoint.participant.open_transport(*endpoint.action, endpoint)
    except Exception:  # noqa: BLE001 - our node is gone by now, too
        return False
    endpoint.elsewhere = False
    endpoint.transport.close()
    replace_transport(endpoint, transport)
    return True
