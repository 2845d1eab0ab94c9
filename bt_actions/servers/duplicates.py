"""What is believed of what servers say of a duplicate: a goal that has ended, and turns up
elsewhere.

Whoever has told its end before tells it once more when it is asked, and no answer says whose it is.
So an end is news where one more server tells it than has told it before, or where nobody else is
left who could have. What is not known is not told as an end.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End
from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_REJECTED, ENDS, Event
from bt_actions.servers.presence import GID, ServerWatch
from bt_actions.servers.replies import Replies, Told


class DuplicateReplies(Replies):
    """What is believed of a duplicate. Its `sent_to` are the servers that may run it."""

    def __init__(self, goal: Goal, ended: Replies, sent_to: frozenset[GID]) -> None:
        """`goal` is the duplicate, `ended` what was believed of the goal that has ended."""
        super().__init__(goal)
        self.sent_to = sent_to
        self._told_before = ended.ends_told
        self._tellers = ended.servers
        self._runs_at: frozenset[GID] = frozenset()  # one of these, unless others come in sight

    @property
    def servers(self) -> frozenset[GID]:
        """All that may have told how it ended, here or before."""
        return self._tellers | self.sent_to

    @property
    def ends_told(self) -> tuple[End, ...]:
        """Return the ends that were told, here and before, one for each server that did."""
        return (*self._told_before, *super().ends_told)

    def is_at_another(self, watch: ServerWatch, now: float) -> None:
        """It runs at one of the servers, which may be shown only later."""
        self.sent(watch)
        self.sent_to |= self._tellers
        self._accepted_by, self._fresh_since = len(self._told_before) + 1, now

    def answered(self, watch: ServerWatch, now: float, answers: Sequence[bool]) -> Told:
        """Take an answer to the goal request: a server that is in sight has accepted it, too."""
        if self._goal.lost and answers[-1]:
            told = self._turns_up(watch, now)
            self._accepted_by = max(self._accepted_by, sum(answers))
            return told
        return super().answered(watch, now, answers)

    def canceled(
        self, watch: ServerWatch, now: float, asked: float, answers: Sequence[int]
    ) -> Told:
        """Take an answer to a cancel request: whoever agrees, or refuses, runs it."""
        self._note_changes(watch, now)
        if asked >= self._fresh_since and answers[-1] in (CANCEL_ACCEPTED, CANCEL_REJECTED):
            if self._goal.lost:
                return self._turns_up(watch, now)
            self._runs_at = self.servers & watch.gids
        return super().canceled(watch, now, asked, answers)

    def finished(
        self, watch: ServerWatch, now: float, asked: float, answers: Sequence[tuple[int, Any]]
    ) -> Told:
        """Take an answer to a question for the result; of an end that is no news, nothing."""
        self._note_changes(watch, now)
        if any(answer[0] not in (0, *ENDS) for answer in answers):
            return super().finished(watch, now, asked, answers)
        if asked < self._fresh_since:
            return []
        by_each = len(answers) >= len(watch.gids)
        ended = [answer for answer in answers if answer[0] in ENDS]
        if news := self._news(ended):
            if len(news) < self._ends_wanted(watch) and not by_each:
                return []
            self._ends_told = tuple(ENDS[each[0]] for each in news)
            return [(Event.RESULT, news[-1])]
        if ended and self._is_alone(watch):
            self._ended = ended[-1]  # until the next look: another may just have come back
            return []
        if not by_each or self._goal.lost:
            return []
        if gone := self.servers - watch.gids:
            self.sent_to, self._was_gone = gone, True
            return [(Event.SERVER_LOST, f"{self._goal.server} went away under the goal")]
        return [(Event.RESULT_UNKNOWN, None)]  # denied, also by the one that took it

    def shown(self, watch: ServerWatch, now: float, status: int) -> Told:
        """Take the status that one server publishes of the goal; not that of who told it before."""
        if status not in ENDS:
            return [*self.lives(watch, now), (Event.STATUS, status)]
        is_news = ENDS[status] not in self._told_before and self._ends_wanted(watch) == 1
        return [(Event.STATUS, status)] if is_news else []

    def lives(self, watch: ServerWatch, now: float) -> Told:
        """Take feedback, or a status: if it was out of sight, another one has it, too."""
        return self._turns_up(watch, now) if self._goal.lost else []

    def looked(self, watch: ServerWatch, now: float) -> Told:
        """Take what discovery shows now: it may show that one is the only one left."""
        there = self.servers & watch.gids
        if len(there) == 1 and there == self._runs_at:
            self.sent_to = there
        self._runs_at = frozenset()
        if not self._is_alone(watch):
            self._ended = None
        return super().looked(watch, now)

    def _turns_up(self, watch: ServerWatch, now: float) -> Told:
        self.is_at_another(watch, now)
        return [(Event.SERVER_RETURNED, None)]

    def _news(self, ended: list[tuple[int, Any]]) -> list[tuple[int, Any]]:
        """Return the answers that tell an end once more than it was told before."""
        before, news = Counter(self._told_before), list[tuple[int, Any]]()
        for answer in ended:
            end = ENDS[answer[0]]
            if before[end]:
                before[end] -= 1
            else:
                news.append(answer)
        return news

    def _ends_wanted(self, watch: ServerWatch) -> int:
        """Return how many ends are to be told: as many as have accepted it since."""
        since = self._accepted_by - len(self._told_before)
        return max(1, since) if self._may_be_at_two(watch) else 1

    def _is_alone(self, watch: ServerWatch) -> bool:
        """Whether only that server is in sight that runs it: nobody who has told its end before.

        Which was told by itself where no other has ever had the goal.
        """
        alone = len(self.sent_to) == 1 and self.servers & watch.gids == self.sent_to
        return alone and self.servers != self.sent_to
