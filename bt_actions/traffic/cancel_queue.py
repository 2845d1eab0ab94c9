"""The queue of cancel requests to one server, with a bound on requests under way.

A server keeps the last ten requests of all its clients together, and drops the others silently. If
sixty goals were canceled in one moment, fifty of them would run on until the next cancel, a second
later. So further requests wait until an earlier one has its answer, or has waited long enough;
first come, first served, over all endpoints to the server. goals/goal.py decides which goal to
cancel, and when to cancel again. The caller holds the host's lock.
"""

from __future__ import annotations

from bt_actions.traffic.state import Endpoint

AT_MOST = 8
"""Requests of this process without an answer at one server: two places of ten are left to others.
"""
ANSWERED_WITHIN = 1.0
"""Seconds until a request counts as lost, or its server as busy, and the next request goes out."""


def ask_to_cancel(endpoint: Endpoint, goal_id: bytes) -> None:
    """Ask the server to cancel a goal, as soon as its queue has room."""
    endpoint.cancels.waiting[goal_id] = endpoint
    send_more(endpoint, endpoint.host.steady())


def make_room(endpoint: Endpoint, goal_id: bytes, now: float) -> None:
    """Take note of an answer (`now`: seconds, steady clock), and send what waited for its place."""
    endpoint.cancels.asked.pop(goal_id, None)
    send_more(endpoint, now)


def forget(endpoint: Endpoint, goal_id: bytes) -> None:
    """Drop the requests for this goal."""
    endpoint.cancels.waiting.pop(goal_id, None)
    endpoint.cancels.asked.pop(goal_id, None)


def send_now(endpoint: Endpoint, goal_id: bytes) -> None:
    """Send the request that waits for this goal, room or not: there may be no other time."""
    sender = endpoint.cancels.waiting.pop(goal_id, None)
    if sender is not None:
        send_cancel(sender, goal_id)


def send_more(endpoint: Endpoint, now: float) -> None:
    """Send as many requests to the server as it has room for (`now`: seconds, steady clock)."""
    waiting, asked = endpoint.cancels.waiting, endpoint.cancels.asked
    for goal_id in [each for each, at in asked.items() if now - at >= ANSWERED_WITHIN]:
        del asked[goal_id]
    while waiting and len(asked) < AT_MOST:
        goal_id = next(iter(waiting))
        if send_cancel(waiting.pop(goal_id), goal_id):
            asked[goal_id] = now


def send_cancel(endpoint: Endpoint, goal_id: bytes) -> bool:
    """Send a cancel request now; return whether the request has left."""
    try:
        endpoint.transport.cancel(goal_id)
    except Exception as error:  # noqa: BLE001 - the middleware's: any; a later turn asks again
        endpoint.warn_once("CANCEL could not be sent", error)
        return False
    return True
