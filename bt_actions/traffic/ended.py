"""The goals of one endpoint that have ended: should one turn up at a second server, it is canceled.

Of each only what that takes is kept. A word of such a goal may be older than its end, or that of
another server of the name, which took it, too: to ask for its cancel tells, as whoever has ended a
goal neither agrees nor refuses. All under the one lock.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.goal import Goal
from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_REJECTED, NEVER, Event
from bt_actions.servers.presence import GID
from bt_actions.traffic.state import Endpoint, GoalHandle, Host
from bt_actions.traffic.transport import GOALS_KEPT, Request


@dataclass(slots=True)
class Ended:
    """What is kept of a goal that is DONE; not the goal itself, which has its result."""

    again: Callable[[], GoalHandle]
    """Makes a goal that stands for it, should it turn up."""
    accepted: bool
    servers: frozenset[GID]
    """Who may have had it."""
    since: float
    asked_at: float = NEVER


class EndedGoals:
    """The newest goals that have ended on one endpoint."""

    def __init__(self, endpoint: Endpoint, host: Host) -> None:
        self._endpoint, self._host = endpoint, host
        self._ended: dict[bytes, Ended] = {}

    def keep(self, handle: GoalHandle) -> None:
        """Remember a goal that is DONE."""
        goal, endpoint = handle.goal, self._endpoint
        goal_anew = partial(
            Goal, goal.id, goal.server, goal.timeouts, resources=goal.resources, busy=goal.busy
        )
        owner = (lambda: None) if handle.owner is None else weakref.ref(handle.owner)
        whose = handle.name, handle.begun_in, handle.attempt

        def again() -> GoalHandle:
            again = goal_anew(now=endpoint.participant.now())
            again.turns_up_again()
            return GoalHandle(again, endpoint, owner(), *whose)

        self._ended[goal.id] = Ended(
            again, goal.accepted, handle.replies.sent_to, self._host.steady()
        )
        if len(self._ended) > GOALS_KEPT:
            oldest = next(iter(self._ended))
            del self._ended[oldest]
            endpoint.transport.forget(oldest)

    def answered(
        self, request: Request, goal_id: bytes, asked: float, answers: Sequence[Any]
    ) -> None:
        """Take an answer. An acceptance may have been overtaken by the result, or have come twice.

        And whoever has ended a goal neither agrees nor refuses to cancel it.
        """
        ended = self._ended.get(goal_id)
        if ended is None:
            return
        if request == "cancel":
            if asked > ended.since and answers[-1] in (CANCEL_ACCEPTED, CANCEL_REJECTED):
                self._turns_up(goal_id, ended)
        elif request == "goal" and answers[-1]:
            is_news = not ended.accepted and sum(answers) == 1
            if is_news or self._may_be_several(ended):
                self._turns_up(goal_id, ended)
            elif sum(answers) > 1:  # by one, twice, or by one that is not shown yet
                self._ask(goal_id, ended)

    def runs(self, goal_id: bytes) -> None:
        """Take feedback, or a status that shows that the goal runs: is it older than its end?"""
        ended = self._ended.get(goal_id)
        if ended is not None and self._may_be_several(ended):
            self._ask(goal_id, ended)

    def _ask(self, goal_id: bytes, ended: Ended) -> None:
        now = self._host.steady()
        if now - ended.asked_at >= ASK_AGAIN:
            ended.asked_at = now
            self._endpoint.ask_to_cancel(goal_id)

    def _may_be_several(self, ended: Ended) -> bool:
        self._endpoint.observe()
        return len(ended.servers | self._endpoint.watch.gids) > 1

    def _turns_up(self, goal_id: bytes, ended: Ended) -> None:
        """A second server runs it: cancel it, and account for it like for any goal."""
        endpoint = self._endpoint
        del self._ended[goal_id]
        handle = ended.again()
        endpoint.watch.two_answered()
        handle.replies.taken_by_two(ended.servers | endpoint.watch.gids, self._host.steady())
        endpoint.take_in(handle)
        endpoint.tell(handle, Event.SERVER_RETURNED)
