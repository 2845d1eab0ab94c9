"""The goals of one endpoint that have ended, and may turn up at a second server, which is to
cancel.

A word of such a goal may be older than its end, or the word of another server of the name that took
it, too. This tells the two apart, asks where it cannot, and hands the endpoint a duplicate where
there is one. What is believed of what servers say of that is servers/duplicates.py's. All under the
one lock.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End
from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_REJECTED, Event
from bt_actions.servers.duplicates import DuplicateReplies
from bt_actions.servers.presence import GID
from bt_actions.servers.replies import Replies
from bt_actions.traffic.handle import Endpoint, GoalHandle, Reporter
from bt_actions.traffic.host import Host
from bt_actions.traffic.transport import GOALS_KEPT

STALE = 2.0
"""Seconds after a goal's end within which an older word of its server may still arrive."""
QUESTIONS = 5
"""So many of these words, at most, are followed up."""


@dataclass(slots=True)
class Ended:
    """A goal that is DONE, with what its duplicate would need to know should there be one."""

    goal: Goal
    replies: Replies
    owner: Callable[[], Any]
    """A weak reference to the leaf."""
    name: str
    begun_in: object
    attempt: int
    reporter: Reporter
    accepted: bool
    since: float
    questions: int = 0
    """Asked in doubt."""


class Past:
    """What has ended on one endpoint, the newest goals."""

    def __init__(self, endpoint: Endpoint, host: Host) -> None:
        self._endpoint, self._host = endpoint, host
        self._ended: dict[bytes, Ended] = {}

    def keep(self, handle: GoalHandle) -> None:
        """Keep a goal that is DONE in mind; where one that may run it is gone, wait for that.

        But not where it is lost, and is given up with many others.
        """
        endpoint, goal = self._endpoint, handle.goal
        owner = (lambda: None) if handle.owner is None else weakref.ref(handle.owner)
        ended = Ended(
            goal, handle.replies, owner, handle.name, handle.begun_in, handle.attempt,
            handle.reporter, goal.accepted, self._host.steady(),
        )  # fmt: skip
        if len(handle.replies.servers) > 1 and goal.end is not End.SERVER_GONE:
            endpoint.see()
            if elsewhere := handle.replies.may_run_at(endpoint.watch):
                duplicate, _ = self._duplicate(ended, elsewhere)
                duplicate.replies.taken_over()
                endpoint.take_in(duplicate)
                return
        self._ended[goal.id] = ended
        if len(self._ended) > GOALS_KEPT:
            oldest = next(iter(self._ended))
            del self._ended[oldest]
            endpoint.transport.forget(oldest)

    def _duplicate(
        self, ended: Ended, sent_to: frozenset[GID]
    ) -> tuple[GoalHandle, DuplicateReplies]:
        """Return the same goal as one of these servers may run it."""
        goal = ended.goal.duplicate(self._endpoint.participant.now())
        duplicate = GoalHandle(
            goal, self._endpoint, ended.reporter, ended.owner(), ended.name, ended.begun_in,
            ended.attempt,
        )  # fmt: skip
        duplicate.replies = said = DuplicateReplies(goal, ended.replies, sent_to)
        return duplicate, said

    def accepted(self, goal_id: bytes, answers: Sequence[bool] = (True,)) -> None:
        """Take an acceptance: it may have been overtaken by the result, or have come twice."""
        ended = self._get(goal_id)
        if ended is None:
            return
        is_news = not ended.accepted and sum(answers) == 1
        if self._may_be_several(ended) or is_news:
            self._hand_over(ended)
        elif sum(answers) > 1:  # by one, twice, or by one that is not shown yet
            self._ask(ended)

    def cancel_answered(self, goal_id: bytes, asked: float, code: int) -> None:
        """Take an answer to a cancel request: who has ended a goal neither agrees nor refuses."""
        ended = self._get(goal_id)
        if ended is not None and asked > ended.since and code in (CANCEL_ACCEPTED, CANCEL_REJECTED):
            self.accepted(goal_id)

    def runs(self, goal_id: bytes) -> None:
        """Take feedback, or a status that shows that the goal runs.

        What seems to be older than the end may be all that a second server ever says of it; to ask
        it to cancel tells.
        """
        ended = self._get(goal_id)
        if ended is None:
            return
        if self._host.steady() - ended.since > STALE:
            self.accepted(goal_id)
        elif self._may_be_several(ended):
            self._ask(ended)

    def _ask(self, ended: Ended) -> None:
        """Ask whoever has it to cancel: whoever has ended it will deny it."""
        if ended.questions < QUESTIONS:
            ended.questions += 1
            self._endpoint.ask_to_cancel(ended.goal.id)

    def _get(self, goal_id: bytes) -> Ended | None:
        """Return what has ended; in the child of a fork nothing has, it is the parent's."""
        return None if self._endpoint.is_parents else self._ended.get(goal_id)

    def _may_be_several(self, ended: Ended) -> bool:
        self._endpoint.see()
        return len(ended.replies.servers | self._endpoint.watch.gids) > 1

    def _hand_over(self, ended: Ended) -> None:
        endpoint = self._endpoint
        del self._ended[ended.goal.id]
        duplicate, said = self._duplicate(ended, ended.replies.sent_to)
        endpoint.watch.two_answered()
        said.is_at_another(endpoint.watch, self._host.steady())
        endpoint.take_in(duplicate)
        endpoint.tell(duplicate, Event.SERVER_RETURNED)
