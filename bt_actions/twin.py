"""What is believed of what servers say of a twin: a goal that has ended, and turns up elsewhere.

Whoever has told its end before tells it once more when it is asked, and no answer says whose it is.
So an end is news where one more server tells it than has told it before, or where nobody else is
left who could have. What is not known is not told as an end.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from bt_actions.goal import Goal
from bt_actions.goal_terms import CANCEL_ACCEPTED, CANCEL_REJECTED, ENDS, Event
from bt_actions.policy import End
from bt_actions.server import GID, ServerWatch
from bt_actions.testimony import Testimony, Told


class TwinTestimony(Testimony):
    """What is believed of what servers say of a twin. Its `sent_to` are those that may run it."""

    def __init__(self, goal: Goal, ended: Testimony, sent_to: frozenset[GID]) -> None:
        """`goal` is the twin, `ended` what was believed of the goal that has ended."""
        super().__init__(goal)
        self.sent_to = sent_to
        self._told_before = ended.ends_told
        self._tellers = ended.servers
        self._silent = sent_to  # these have told no end before, unless it turns up
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
        """It runs at one of the servers that are shown."""
        self.sent(watch)
        self._silent = frozenset()
        self._accepted_by, self._fresh_since = len(self._told_before) + 1, now

    def may_run_at(self, watch: ServerWatch) -> frozenset[GID]:
        """Return who may run it though it has ended here; not who may have told its end before."""
        return super().may_run_at(watch) & self._silent

    def canceled(self, watch: ServerWatch, asked: float, answers: Sequence[int]) -> Told:
        """Take an answer to a cancel request: whoever agrees, or refuses, runs it."""
        if asked >= self._fresh_since and answers[-1] in (CANCEL_ACCEPTED, CANCEL_REJECTED):
            self._runs_at = self.servers & watch.gids
        return super().canceled(watch, asked, answers)

    def finished(
        self, watch: ServerWatch, now: float, asked: float, answers: Sequence[tuple[int, Any]]
    ) -> Told:
        """Take an answer to a question for the result; of an end that is no news, nothing."""
        ended = [answer for answer in answers if answer[0] in ENDS]
        if not ended:
            return super().finished(watch, now, asked, answers)
        if asked < self._fresh_since:
            return []
        if news := self._news(ended):
            if len(news) < self._ends_wanted(watch):
                return []
            self._ends_told = tuple(ENDS[each[0]] for each in news)
            return [(Event.RESULT, news[-1])]
        if self._is_alone(watch):
            self._ended = ended[-1]  # until the next look: another may just have come back
            return []
        gone = self.sent_to - watch.gids
        if not gone or self._may_be_at_two(watch):
            forgotten = len(answers) >= max(2, len(watch.gids))  # by the one that took it, too
            return [(Event.RESULT_UNKNOWN, None)] if forgotten else []
        if self._goal.lost:
            return []
        self.sent_to, self._was_gone = gone, True
        return [(Event.SERVER_LOST, f"{self._goal.server} went away under the goal")]

    def shown(self, watch: ServerWatch, status: int) -> Told:
        """Take the status that one server publishes of the goal; not that of who told it before."""
        if status not in ENDS:
            return super().shown(watch, status)
        is_news = ENDS[status] not in self._told_before and self._ends_wanted(watch) == 1
        return [(Event.STATUS, status)] if is_news else []

    def looked(self, watch: ServerWatch, now: float) -> Told:
        """Take what discovery shows now: it may show that one is the only one left."""
        there = self.servers & watch.gids
        if len(there) == 1 and there == self._runs_at:
            self.sent_to = there
        self._runs_at = frozenset()
        if not self._is_alone(watch):
            self._ended = None
        return super().looked(watch, now)

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
        """Whether only that server is in sight that runs it: nobody who has told its end before."""
        return len(self.sent_to) == 1 and self.servers & watch.gids == self.sent_to
