"""The watcher over the server of one endpoint: looks at discovery, questions, news for the goals.

The problem: a goal has to learn that its server has come, gone, or been replaced, though ROS sends
no such event, and a look at the graph is slow. Discovery is also wrong in both directions: a dead
server is shown until its lease runs out, and a living one may be out of sight after a stall of this
process.

The rule: the watcher decides when to look, and nothing else. A look is due every 50 ms while a goal
waits for the server or several servers are shown, every 200 ms while goals run, and once a second
at a server that is alone and ready, as long as the cheap count of servers stays the same. At each
look presence.py tells which servers live, and replies.py what that means for each goal; a goal
hears only of changes. The watcher takes arrived answers before it tells a goal that the server has
gone, because they may be the server's last words.

Why that is enough: a goal is sent only after a look that is a second old at most, and right after
the send the servers are counted anew, so a server that came in between is known to have the
request. A grace after a stall (stalls.py) keeps the watcher from taking silence for death.

The caller holds the host's lock.
"""

from __future__ import annotations

from bt_actions.goals.terms import NEVER, Event
from bt_actions.servers.presence import LEASE, Server
from bt_actions.traffic import handover, route
from bt_actions.traffic.admission import BESIDE
from bt_actions.traffic.driver import tell, tell_believed
from bt_actions.traffic.route import LOOK_WHILE_RUNNING
from bt_actions.traffic.stalls import ANSWERS_TAKE
from bt_actions.traffic.state import Endpoint, wake
from bt_actions.traffic.transport import ActionTransport

LOOK_WHILE_WAITING = 0.05
"""Seconds between two looks at a server that a goal waits for; otherwise LOOK_WHILE_RUNNING."""
LOOK_AT_REST = 1.0
"""Seconds between two looks at a server that is ready and alone, while the count of servers stays
the same."""
SILENT_FOR = 40.0
"""Seconds of silence of a server until an endpoint without a node leaves its goals to another one
that can look for the server: longer than a dead server is shown, or a question is kept
(DENIED_FOR_GOOD)."""


def look_if_due(endpoint: Endpoint, now: float) -> float:
    """Look, if a look is due; return the seconds until the next one."""
    if now >= endpoint.look_at:
        if _rests(endpoint):
            recent_state(endpoint, now)
        else:
            look(endpoint, now)
        handover.bound_the_lost(endpoint)
        waits = endpoint.has_unsent or endpoint.watch.state(now) is Server.UNCLEAR
        endpoint.look_at = now + (LOOK_WHILE_WAITING if waits else LOOK_WHILE_RUNNING)
    return endpoint.look_at - now


def _is_alone(endpoint: Endpoint) -> bool:
    """Return whether the last look found one server, and it was ready."""
    return endpoint.looked_like is Server.READY and not endpoint.watch.is_crowded


def _rests(endpoint: Endpoint) -> bool:
    """Return whether the server is alone, and no goal is held back from it."""
    return _is_alone(endpoint) and not any(endpoint.held_back)


def recent_state(endpoint: Endpoint, now: float) -> Server:
    """Return the server's state; look, unless the last look is recent and the count is the same.

    A server that has taken another's place since then is seen right after the send.
    """
    is_known = now - endpoint.looked_at < LOOK_AT_REST and _is_alone(endpoint)
    is_known &= endpoint.action not in endpoint.domain.lost  # left goals are canceled first
    if is_known and endpoint.participant.alive() and not _counts_others(endpoint):
        if _rests(endpoint):
            endpoint.look_at = max(endpoint.look_at, now + LOOK_WHILE_RUNNING)
        return Server.READY
    return look(endpoint, now)


def look_early(endpoint: Endpoint, now: float) -> float:
    """Look for a server that no goal wants yet; return the seconds until the next look.

    A first goal is held back from the first sight of its server on. An early look makes that one
    hold for all servers of a tree, which runs while the rest of the tree is set up.
    """
    scheduler, transport = endpoint.host.scheduler, endpoint.transport
    is_new = now - transport.seen_since < route.TOO_NEW and not transport.closed
    if is_new and (_counts_others(endpoint) or endpoint.counted):
        look(endpoint, now)
    if is_new and endpoint.looked_like is Server.ABSENT:
        scheduler.add(endpoint)
        scheduler.wake_by(now + LOOK_WHILE_WAITING)
    elif not endpoint.goals:
        scheduler.remove(endpoint)
    return LOOK_WHILE_WAITING


def _counts_others(endpoint: Endpoint) -> bool:
    """Return whether a server has come or gone since the last look, or our node was destroyed."""
    try:
        return endpoint.transport.count() != endpoint.counted
    except Exception:  # noqa: BLE001 - the middleware's: any
        return not endpoint.orphaned


def look(endpoint: Endpoint, now: float) -> Server:
    """Look at the server, tell the goals what that means for them, and return its state."""
    host, watch = endpoint.host, endpoint.watch
    alive = endpoint.participant.alive()
    if not alive:
        _orphan(endpoint)
    if watch.is_crowded:  # before silence is judged
        if host.stalls.answers_take(now):
            watch.stood_still(now)
        route.deliver_arrived(endpoint)
    if endpoint.transport.closed:  # a delivery ended the last goal of an unused endpoint
        return Server.ABSENT
    if not alive:
        if watch.is_crowded:  # probes tell which of the last shown servers live
            watch.see(now, True, watch.gids)
            _tell_goals(endpoint, now)
        return Server.ABSENT
    try:
        route.ask_discovery(endpoint, now)
    except Exception:  # noqa: BLE001 - the participant was destroyed since
        if not route.fall_back(endpoint):
            _orphan(endpoint)
        return Server.ABSENT
    handover.adopt(endpoint)
    handover.take_over(endpoint, now)
    _tell_goals(endpoint, now)
    before = endpoint.looked_like
    state = endpoint.looked_like = watch.state(now)
    endpoint.looked_at = now
    held_back = (now - watch.in_sight_since < BESIDE, route.holds_back(endpoint, now))
    if (state, held_back) != (before, endpoint.held_back):
        wake(endpoint.handles)  # goals that waited, or were held back, may be sent
    endpoint.held_back = held_back
    if state is not before:
        endpoint.domain.ever_lost_sight |= state is Server.ABSENT
        endpoint.domain.known.add(endpoint.action)
        is_there = state is not Server.ABSENT
        if is_there is (before is Server.ABSENT):
            for run in {handle.run: None for handle in endpoint.handles}:
                if run is not None:
                    run.sight(endpoint.name, is_there)
        if state is Server.AMBIGUOUS:
            host.log.warning(
                f"{endpoint.name}: two action servers answer to this name; no more is sent"
            )
    if route.misses(endpoint):
        endpoint.participant.seek(endpoint)
    return state


def _tell_goals(endpoint: Endpoint, now: float) -> None:
    """Ask who lives, if that is open, and tell each goal what is known of its server."""
    watch = endpoint.watch
    runs = any(handle.goal.sent and not handle.goal.lost for handle in endpoint.handles)
    if route.take_question(endpoint, now) or watch.wants_probe(now, runs=runs):
        route.probe(endpoint)
    for handle in endpoint.handles:
        gone = watch.gone(now, handle.replies.sent_to)
        if not gone:
            handle.not_gone_before = NEVER  # the server has been discovered
        if gone and now < handle.not_gone_before:
            continue  # the server is not discovered yet, though its status may have come
        in_sight = handle.replies.sent_to <= watch.gids and not gone
        if not in_sight and endpoint.host.stalls.servers_take(now) > 0.0:
            continue  # the process stood still
        if handle.goal.sent:
            if gone and not handle.goal.lost:
                route.deliver_arrived(endpoint)  # the server's last words
            tell_believed(handle, handle.replies.weigh_sight(watch, now))


def _orphan(endpoint: Endpoint) -> None:
    """Interrupt the goals of a node that is gone, or whose context is.

    No tree can want them any more.
    """
    host, now = endpoint.host, endpoint.host.steady()
    if not endpoint.orphaned:
        endpoint.orphaned, endpoint.heard_at = True, now
        endpoint.looked_like = Server.ABSENT
        if any(not handle.accounted_for for handle in endpoint.handles):
            if endpoint.participant.shut_down():
                host.log.info(f"{endpoint.name}: ROS is shut down; canceling its goals")
            else:
                host.log.warning(f"{endpoint.name}: the node is gone; canceling what it left")
    for handle in endpoint.handles:  # also a goal that was begun since
        handle.goal.deadlines.disarm(Event.LOOK_OUT_DUE)  # nobody here sees it come back
        if handle.goal.outcome is None:
            tell(handle, Event.INTERRUPTED)
    silent = now - endpoint.heard_at > SILENT_FOR
    if silent and not host.stalls.answers_take(now):
        handover.park(endpoint, all_of_them=True)


def move_to(endpoint: Endpoint, transport: ActionTransport) -> None:
    """Use a transport in a participant that sees the server; nobody spins that participant.

    Questions for a result, and cancels, are asked anew there. A goal request may have arrived or
    not, so the old transport goes on with it.
    """
    now, log = endpoint.host.steady(), endpoint.host.log
    blind, seen = route.is_absent(endpoint, now), endpoint.watch.gids
    route.deliver_arrived(endpoint)
    if endpoint.transport.closed:  # a delivery ended the last goal of an unused endpoint
        transport.close()
        return
    transport.beside_another = False
    endpoint.elsewhere = True
    route.replace_transport(endpoint, transport)
    if blind:
        log.info(f"{endpoint.name}: out of sight of this node though it runs; a new one sees it")
        return
    log.info(f"{endpoint.name}: does not hear this node any more; a new one is heard")
    for handle in endpoint.handles:
        if handle.replies.sent_to & seen:  # the server may be shown later than another of its name
            handle.not_gone_before = max(handle.not_gone_before, now + LEASE)
        handle.goal.deadlines.suspend(ANSWERS_TAKE, endpoint.participant.now())
        tell(handle, Event.SERVER_CHANGED)
