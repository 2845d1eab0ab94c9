"""The cancel requests to one server, of which only so many are under way at a time.

A server keeps the last ten requests of all its clients together and drops the others silently:
sixty goals that are interrupted in one moment would run for a second more, until they are canceled
again. So what is over waits for an answer, or until one is not expected any more; first come first
served, of all endpoints to the server. Who is to be canceled, and when again, is for goals/goal.py
to decide. All under the host's lock.
"""

from __future__ import annotations

from bt_actions.traffic.state import CancelQueue, Endpoint

AT_MOST = 8
"""Requests of this process without an answer at one server: two places are left to others."""
ANSWERED_WITHIN = 1.0
"""Seconds until a request counts as lost, or its server as busy, and the next one is sent."""


def ask_to_cancel(endpoint: Endpoint, goal_id: bytes) -> None:
    """Ask the server to cancel a goal, as soon as its queue has room."""
    endpoint.cancels.waiting[goal_id] = endpoint
    send_more(endpoint.cancels, endpoint.host.steady())


def make_room(queue: CancelQueue, goal_id: bytes, now: float) -> None:
    """Take note of an answer (seconds, steady clock)."""
    queue.asked.pop(goal_id, None)
    send_more(queue, now)


def forget(queue: CancelQueue, goal_id: bytes) -> None:
    """Ask no more for this goal."""
    queue.waiting.pop(goal_id, None)
    queue.asked.pop(goal_id, None)


def send_now(queue: CancelQueue, goal_id: bytes) -> None:
    """Send what waits for this goal, room or not: there may be no other time."""
    endpoint = queue.waiting.pop(goal_id, None)
    if endpoint is not None:
        send_cancel(endpoint, goal_id)


def send_more(queue: CancelQueue, now: float) -> None:
    """Send what there is room for (seconds, steady clock)."""
    for goal_id in [each for each, at in queue.asked.items() if now - at >= ANSWERED_WITHIN]:
        del queue.asked[goal_id]
    while queue.waiting and len(queue.asked) < AT_MOST:
        goal_id = next(iter(queue.waiting))
        if send_cancel(queue.waiting.pop(goal_id), goal_id):
            queue.asked[goal_id] = now


def send_cancel(endpoint: Endpoint, goal_id: bytes) -> bool:
    """Ask the server now; return whether the request has left."""
    try:
        endpoint.transport.cancel(goal_id)
    except Exception as error:  # noqa: BLE001 - the middleware's: any; it is asked again later
        endpoint.warn_once("CANCEL could not be sent", error)
        return False
    return True
