"""The goals of one line that have ended, and may turn up at a second server, which is to cancel.

A word of such a goal may be older than its end, or the word of another server of the name that took
it, too. This tells the two apart, asks where it cannot, and hands the line a twin where there is
one. What is believed of what servers say of that is servers/duplicates.py's. All under the one
lock.
"""

from __future__ import annotations

import dataclasses
import time
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_REJECTED, ENDS, Event
from bt_actions.ros import alarm
from bt_actions.ros.action_client import GOALS_KEPT
from bt_actions.ros.shared import Ticket
from bt_actions.servers.duplicates import TwinTestimony

if TYPE_CHECKING:
    from bt_actions.ros.line import Line

STALE = 2.0
"""Seconds after a goal's end within which an older word of its server may still arrive."""
QUESTIONS = 5
"""So many of these words, at most, are followed up."""


@dataclass(slots=True)
class Ended:
    """A goal that is DONE, and the twin that it has should a second server run it."""

    owner: Callable[[], Any]
    """A weak reference to the leaf."""
    accepted: bool
    since: float
    twin: Ticket
    said: TwinTestimony
    questions: int = 0
    """Asked in doubt."""


class Past:
    """What has ended on one line, the newest goals."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._ended: dict[bytes, Ended] = {}

    def keep(self, ticket: Ticket) -> None:
        """Keep a goal that is DONE in mind; where one that may run it is gone, wait for that.

        But not where it is lost, and is given up with many others.
        """
        line = self._line
        twin = dataclasses.replace(
            ticket,
            goal=ticket.goal.twin(line.traffic.clocks.now()),
            keeps_feedback=False,
            feedback=deque(maxlen=1),
        )
        line.see()
        elsewhere = ticket.testimony.may_run_at(line.watch)
        given_up = ticket.goal.lost and ticket.goal.end not in ENDS.values()
        if elsewhere and not given_up:
            twin.testimony = TwinTestimony(twin.goal, ticket.testimony, elsewhere)
            twin.testimony.taken_over()
            line.goals[twin.goal.id] = twin
            return
        twin.owner = None
        said = TwinTestimony(twin.goal, ticket.testimony, ticket.testimony.sent_to)
        twin.testimony = said
        owner = (lambda: None) if ticket.owner is None else weakref.ref(ticket.owner)
        accepted, now = ticket.goal.accepted, time.monotonic()
        self._ended[twin.goal.id] = Ended(owner, accepted, now, twin, said)
        if len(self._ended) > GOALS_KEPT:
            oldest = next(iter(self._ended))
            del self._ended[oldest]
            line.client.forget(oldest)

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
        if time.monotonic() - ended.since > STALE:
            self.accepted(goal_id)
        elif self._may_be_several(ended):
            self._ask(ended)

    def _ask(self, ended: Ended) -> None:
        """Ask whoever has it to cancel: whoever has ended it will deny it."""
        if ended.questions < QUESTIONS:
            ended.questions += 1
            self._line.ask_to_cancel(ended.twin.goal.id)

    def _get(self, goal_id: bytes) -> Ended | None:
        """Return what has ended; in the child of a fork nothing has, it is the parent's."""
        return None if self._line.is_parents else self._ended.get(goal_id)

    def _may_be_several(self, ended: Ended) -> bool:
        self._line.see()
        return len(ended.said.servers | self._line.watch.gids) > 1

    def _hand_over(self, ended: Ended) -> None:
        line, twin = self._line, ended.twin
        del self._ended[twin.goal.id]
        twin.owner = ended.owner()
        line.watch.two_answered()
        ended.said.is_at_another(line.watch, time.monotonic())
        line.goals[twin.goal.id] = twin
        alarm.mind(line)
        line.tell(twin, Event.SERVER_RETURNED)
