"""The driver of goals: events go to a goal, and the driver carries out what the goal decides.

`tell` gives an event to a goal, which decides at once. The effects of the decision wait in one
queue of the domain, and `_do_in_order` carries them out in the order of decision, so that no effect
begins inside of another. Only a cancel checks again whether the goal still needs it. When a request
cannot be sent, the goal gets an event, too. The caller holds the host's lock.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from bt_actions.goals.policy import Busy, End, Outcome
from bt_actions.goals.terms import STATUS_SUCCEEDED, Command, Event, Now, State
from bt_actions.goals.unaccounted import report_of
from bt_actions.servers.replies import Told
from bt_actions.traffic import cancel_queue, route
from bt_actions.traffic.admission import why_not
from bt_actions.traffic.state import Ended, Endpoint, Entry, GoalHandle, Standing, wake
from bt_actions.traffic.transport import GOALS_KEPT

Effect = Callable[[GoalHandle], None]
"""One thing to do for a goal."""


# Events


def tell(handle: GoalHandle, event: Event, detail: Any = None) -> None:
    """Tell a goal what happened, and do what the goal decides."""
    with handle.endpoint.host.lock:
        endpoint = handle.endpoint
        if not endpoint.is_parents:
            _apply(handle, event, endpoint.participant.now(), detail)


def tell_believed(handle: GoalHandle, told: Told) -> None:
    """Tell a goal the event that Replies made of an answer or a look; None is no event."""
    if told is None:
        return
    event, detail = told
    if event is Event.RESULT and detail[0] != STATUS_SUCCEEDED and _rival_sent(handle):
        tell(handle, Event.REPLACED)  # the result has overtaken the rival's acceptance
    tell(handle, event, detail)
    if event is Event.SERVER_AMBIGUOUS and detail is not None:  # both have told how it ended
        tell(handle, Event.RESULT, detail)


def _rival_sent(handle: GoalHandle) -> bool:
    """Return whether a newer goal that replaces this one is on its way, or has arrived."""
    holders = handle.endpoint.domain.resources.holders(handle.goal.resources)
    newer = holders[holders.index(handle) + 1 :] if handle in holders else []
    return any(other.goal.busy is Busy.REPLACE and other.goal.sent for other in newer)


def apply_deadlines(handle: GoalHandle) -> None:
    """Let the goal's deadlines take effect, unless its tree is paused before sending.

    Arrived answers are taken in first: an answer that came in time is in time, though the executor
    was too busy to look. After a stall of the process the answer may be about to arrive. One moment
    decides both whether to take answers, and which deadlines have passed. An error here stops no
    other goal.
    """
    endpoint, goal = handle.endpoint, handle.goal
    with endpoint.host.lock:
        try:
            now = endpoint.participant.now()
            if endpoint.is_parents:
                return
            _give_back_time(handle, now.steady)
            if handle.paused:
                return
            due = goal.due_in(now)
            if due == 0.0:
                route.deliver_arrived(endpoint)
                now = endpoint.participant.now()
                _suspend_after_stall(handle, now)
                due = goal.due_in(now)
            endpoint.host.trace.shows_time(handle)
            for event in goal.due(now):
                _apply(handle, event, now)
            if due:
                endpoint.host.scheduler.wake_by(now.steady + due)
        except Exception as error:  # noqa: BLE001 - a mistake of ours: any
            endpoint.warn_once("a deadline could not be applied", error)


def _give_back_time(handle: GoalHandle, now: float) -> None:
    """Postpone the deadlines of an unsent goal by the time in which this side held it back."""
    if handle.held_back_since is not None and not handle.goal.sent:
        handle.goal.deadlines.postpone(now - handle.held_back_since)
    waits = handle.goal.state is State.WAITING_FOR_SERVER
    held_back = handle.paused or (waits and route.holds_back(handle.endpoint, now))
    handle.held_back_since = now if held_back else None


def _suspend_after_stall(handle: GoalHandle, now: Now) -> None:
    """Suspend deadlines that have passed while a stall may be the reason for the silence."""
    goal, endpoint, stalls = handle.goal, handle.endpoint, handle.endpoint.host.stalls
    waits = goal.state is State.WAITING_FOR_SERVER
    doubts = route.holds_back if waits else route.in_doubt
    in_doubt = route.LOOK_WHILE_RUNNING if doubts(endpoint, now.steady) else 0.0
    servers = stalls.servers_take(now.steady) if waits or goal.lost else 0.0
    goal.deadlines.suspend(max(stalls.answers_take(now.steady), servers, in_doubt), now)


def _apply(handle: GoalHandle, event: Event, now: Now, detail: Any = None) -> None:
    """Have the goal take a step, and do its effects."""
    goal, endpoint, host = handle.goal, handle.endpoint, handle.endpoint.host
    waited = goal.state in (State.QUEUED, State.WAITING_FOR_SERVER)
    host.trace.tells(handle, event)
    commands = goal.on(event, now, detail)
    host.trace.told(handle, event, detail, commands)
    if waited and goal.outcome in (Outcome.SERVER_UNAVAILABLE, Outcome.SERVER_BUSY):
        goal.reason += why_not(handle)
    elif event is Event.ACCEPT_DUE and (goal.planned, goal.outcome) == (
        Outcome.ACCEPT_TIMEOUT,
        None,
    ):
        goal.reason += endpoint.participant.unheard()
    if (due := goal.due_in(now)) is not None:
        host.scheduler.wake_by(now.steady + due)
    _do_in_order(handle, _what_follows(handle, commands))


def _what_follows(handle: GoalHandle, commands: Iterable[Command]) -> Iterator[Effect]:
    """Yield the effects of a goal's step, in order."""
    before, now = handle.standing, Standing.of(handle)
    handle.standing = now
    turned_lost = (now.state is State.LOST) != (before.state is State.LOST)
    if turned_lost:  # first: a process that is killed at the telling has the goal on record
        yield _update_record
    if now.shown != before.shown:
        yield report
    for command in commands:
        yield _COMMANDS[command]
    if now.in_the_way != before.in_the_way:
        if not handle.goal.claims_resources and handle.goal.id in handle.endpoint.goals:
            handle.endpoint.domain.left[handle] = None
        yield _wake_waiting
    if now.off_record != before.off_record and not turned_lost:
        yield _update_record
    if now.state is not before.state:
        if now.state is State.DONE:
            yield retire
        elif now.state is State.EXECUTING and handle.goal.busy is Busy.REPLACE:
            yield _replace


def _do_in_order(handle: GoalHandle, effects: Iterable[Effect]) -> None:
    """Do these effects behind those decided before; effects decided meanwhile come last.

    Where effects are being done already, the caller further up does these as well.
    """
    domain = handle.endpoint.domain
    domain.effects.extend([(effect, handle) for effect in effects])
    if domain.does_effects:
        return
    domain.does_effects = True
    try:
        while domain.effects:
            effect, whose = domain.effects.popleft()
            effect(whose)
    finally:
        domain.does_effects = False


# Commands of a goal


def _release(handle: GoalHandle) -> None:
    for next_one in handle.endpoint.domain.resources.release(handle):
        tell(next_one, Event.GRANTED)


def _send(handle: GoalHandle) -> None:
    """Count the receivers, put the goal on record, and send the request."""
    endpoint, goal, replies = handle.endpoint, handle.goal, handle.replies
    try:
        replies.count_receivers(endpoint.watch)
        _put_on_record(handle)
        endpoint.transport.send(goal.id, goal.message)
        known = replies.sent_to
        route.glance(endpoint)
        replies.count_receivers(endpoint.watch)  # a server that opened since got the request, too
        if replies.sent_to != known:
            _put_on_record(handle)
    except Exception as error:  # noqa: BLE001 - the handle's, or TypeError of a wrong message
        tell(handle, Event.SEND_FAILED, error)


def _ask_result(handle: GoalHandle) -> None:
    try:
        handle.endpoint.transport.ask_result(handle.goal.id)
    except Exception as error:  # noqa: BLE001 - the middleware's: any; a later step asks again
        handle.endpoint.warn_once("ASK_RESULT could not be sent", error)


def _cancel(handle: GoalHandle) -> None:
    if handle.goal.state is State.DONE:  # and nothing is sent after that
        cancel_queue.send_cancel(handle.endpoint, handle.goal.id)
    else:
        cancel_queue.ask_to_cancel(handle.endpoint, handle.goal.id)


_COMMANDS: dict[Command, Effect] = {
    Command.RELEASE: _release,
    Command.SEND: _send,
    Command.ASK_RESULT: _ask_result,
    Command.CANCEL: _cancel,
}


# Effects of a step


def report(handle: GoalHandle) -> None:
    """Report a goal's change to the log, and to its run."""
    goal, log = handle.goal, handle.endpoint.host.log
    told, handle.end_logged = handle.end_logged, None if goal.outcome is None else goal.end
    if handle.end_logged is End.UNKNOWN is not told:
        if told is End.SERVER_GONE:
            back = "its server is back; canceling it, should it still run there"
            log.warning(f"{handle.name} on {goal.server}, goal {goal.id.hex()}: {back}")
        else:
            log.error(report_of(goal, handle.name).alarm)
    elif told is End.UNKNOWN is not handle.end_logged:
        log.info(f"accounted for at last: {report_of(goal, handle.name)}")
    if handle.run is not None:
        handle.run.notify(handle)
    handle.endpoint.host.notify_all()


def _wake_waiting(handle: GoalHandle) -> None:
    """Wake the runs of all nodes whose goals may have waited for this one.

    The server may have room now, or a conflict may be over.
    """
    endpoint, resources = handle.endpoint, handle.goal.resources
    unsent = endpoint.domain.unsent
    for each in [each for each in unsent if each.goal.sent or each.goal.state is State.DONE]:
        del unsent[each]
    wake(e for e in unsent if e.endpoint.name == endpoint.name or e.goal.resources & resources)


def _replace(handle: GoalHandle) -> None:
    """Tell older goals on the same resources that this goal has taken their place."""
    for older in handle.endpoint.domain.resources.holders(handle.goal.resources):
        if older is handle:
            break
        tell(older, Event.REPLACED, handle.goal.server)


def _update_record(handle: GoalHandle) -> None:
    """Take the goal off the record, or add to the record what is known by now."""
    record = handle.endpoint.host.record
    if handle.standing.off_record:
        record.strike(handle.goal.id)
    elif handle.goal.state is not State.DONE and handle.goal.id in record:
        _put_on_record(handle)


def _put_on_record(handle: GoalHandle) -> None:
    goal, endpoint = handle.goal, handle.endpoint
    servers, accept = handle.replies.sent_to, goal.timeouts.accept or 0.0
    entry = Entry(endpoint.name, endpoint.participant.domain, servers, accept, goal.lost)
    endpoint.host.record.enter(goal.id, entry)


# The places of goals


def take_in(endpoint: Endpoint, handle: GoalHandle) -> None:
    """Hand this goal to the endpoint, which may take it from another one."""
    if handle.endpoint is not endpoint:
        handle.endpoint = endpoint
        handle.replies.taken_over()
    endpoint.goals[handle.goal.id] = handle
    if not handle.goal.claims_resources:
        endpoint.domain.left[handle] = None
    endpoint.domain.open[endpoint] = None
    if not handle.goal.sent:
        endpoint.domain.unsent[handle] = None
    endpoint.host.scheduler.add(endpoint)


def retire(handle: GoalHandle) -> None:
    """Take this goal from its endpoint; without goals, the endpoint stops to watch its server."""
    goal, endpoint = handle.goal, handle.endpoint
    if endpoint.goals.get(goal.id) is handle:  # and not the goal that has turned up again
        del endpoint.goals[goal.id]
        endpoint.domain.left.pop(handle, None)
        endpoint.transport.forget(goal.id)
        if goal.end is End.UNKNOWN:
            cancel_queue.send_now(endpoint, goal.id)  # nobody will ask again
        cancel_queue.forget(endpoint, goal.id)
        if goal.sent and goal.state is State.DONE:
            _keep_ended(handle)
    route.close_former(endpoint)
    if not endpoint.goals:
        endpoint.domain.open.pop(endpoint, None)
        endpoint.host.scheduler.remove(endpoint)
        endpoint.look_soon()  # when there is a goal again
        close_if_unused(endpoint)


def _keep_ended(handle: GoalHandle) -> None:
    """Keep the facts of a DONE goal that endpoint.py needs."""
    goal, endpoint = handle.goal, handle.endpoint
    endpoint.ended[goal.id] = Ended(
        goal.timeouts, goal.resources, goal.busy,
        None if handle.owner is None else weakref.ref(handle.owner),
        handle.name, handle.run, handle.attempt,
        goal.accepted, handle.replies.sent_to, endpoint.host.steady(),
    )  # fmt: skip
    if len(endpoint.ended) > GOALS_KEPT:
        oldest = next(iter(endpoint.ended))
        del endpoint.ended[oldest]
        endpoint.transport.forget(oldest)


def close_if_unused(endpoint: Endpoint) -> None:
    """Close the transport of an endpoint that has no user and no open goal.

    The transport first delivers all it has: a second server may have taken the last goal, too.
    """
    unused = endpoint.users <= 0 and not endpoint.goals and not endpoint.transport.has_more
    if unused and endpoint.of_node.get(endpoint.name) is endpoint:
        del endpoint.of_node[endpoint.name]
        endpoint.transport.close()
