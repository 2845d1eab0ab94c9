"""The goals of one endpoint that have ended: should one turn up at a second server, it is canceled.

A word of such a goal may be older than its end, or that of another server of the name, which took
it, too: to ask for its cancel tells, as whoever has ended a goal neither agrees nor refuses. All
under the host's lock.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.goal import Goal
from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_REJECTED, Event
from bt_actions.traffic import route
from bt_actions.traffic.cancel_queue import ask_to_cancel
from bt_actions.traffic.driver import take_in, tell
from bt_actions.traffic.state import Ended, Endpoint, GoalHandle
from bt_actions.traffic.transport import Request


def take_answer(
    endpoint: Endpoint, request: Request, goal_id: bytes, asked: float, answers: Sequence[Any]
) -> None:
    """Take an answer. An acceptance may have been overtaken by the result, or have come twice.

    And whoever has ended a goal neither agrees nor refuses to cancel it.
    """
    ended = endpoint.ended.get(goal_id)
    if ended is None:
        return
    if request == "cancel":
        if asked > ended.since and answers[-1] in (CANCEL_ACCEPTED, CANCEL_REJECTED):
            _turns_up(endpoint, goal_id, ended)
    elif request == "goal" and answers[-1]:
        is_news = not ended.accepted and sum(answers) == 1
        if is_news or _may_be_several(endpoint, ended):
            _turns_up(endpoint, goal_id, ended)
        elif sum(answers) > 1:  # by one, twice, or by one that is not shown yet
            _ask(endpoint, goal_id, ended)


def take_sign_of_life(endpoint: Endpoint, goal_id: bytes) -> None:
    """Take feedback, or a status that shows that the goal runs: is it older than its end?"""
    ended = endpoint.ended.get(goal_id)
    if ended is not None and _may_be_several(endpoint, ended):
        _ask(endpoint, goal_id, ended)


def _ask(endpoint: Endpoint, goal_id: bytes, ended: Ended) -> None:
    now = endpoint.host.steady()
    if now - ended.asked_at >= ASK_AGAIN:
        ended.asked_at = now
        ask_to_cancel(endpoint, goal_id)


def _may_be_several(endpoint: Endpoint, ended: Ended) -> bool:
    route.glance(endpoint)
    return len(ended.servers | endpoint.watch.gids) > 1


def _turns_up(endpoint: Endpoint, goal_id: bytes, ended: Ended) -> None:
    """A second server runs it: cancel it, and account for it like for any goal."""
    del endpoint.ended[goal_id]
    goal = Goal(
        goal_id, endpoint.name, ended.timeouts, endpoint.participant.now(),
        resources=ended.resources, busy=ended.busy,
    )  # fmt: skip
    goal.turns_up_again()
    owner = None if ended.owner is None else ended.owner()
    handle = GoalHandle(goal, endpoint, owner, ended.name, ended.begun_in, ended.attempt)
    endpoint.watch.two_answered()
    handle.replies.taken_by_two(ended.servers | endpoint.watch.gids, endpoint.host.steady())
    take_in(endpoint, handle)
    tell(handle, Event.SERVER_RETURNED)
