"""The questions to the server of one goal, and its answers: two small machines.

The machines count and remember. The steps decide what to ask, and what follows from an answer
(goals/steps). Seconds are those of the steady clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_UNKNOWN_GOAL

ASK_AGAIN = 1.0
"""Seconds between two questions to a server that owes an answer."""
ASK_LESS = 10.0
"""The same, after `UNHEARD` questions without a word: they wait in the queue of a server that is
busy, which holds ten, those of other clients among them."""
UNHEARD = 3
ASK_IN_ANY_CASE = 30.0
"""Seconds between two questions to a server that need not have an answer yet: should the result
and the status both be lost, a goal without deadlines would wait for ever."""
RESULT_QUESTIONS = 40
"""So many questions for the result of a goal that has ended, until it counts as lost. On a link
that loses a fifth, the middleware repairs half of what is lost every 3 s; 21 s were measured."""
DOUBTS = 3
"""So many times a lone server may deny a goal that it had accepted before it is believed."""
DENIED_FOR_GOOD = 30.0
"""Seconds for which a server must have denied a request that it never answered, until the end of
the tree need not wait for it. Should it turn up all the same, it is canceled."""

LOOKED_OUT_FOR = 3.0
"""Seconds for which a run that is over, or a leaf that is shut down, looks out for a server that
went away: one that was only stopped still runs its goal."""


@dataclass(slots=True)
class Asking:
    """The requests to cancel one goal, which also ask whether the server has it."""

    unheard: int = 0
    """Requests since anything was heard of the goal."""
    asked_at: float | None = None
    answer: int | None = None
    """The last answer, a code of action_msgs/srv/CancelGoal."""
    denied_since: float = math.inf
    """Every answer since then was: unknown goal."""
    in_vain: bool = False
    """The end of its tree waited for it in vain; none does again, until its server is back."""
    _denied_at: float = 0.0

    def ask(self, now: float) -> float:
        """Take note of a request; return the seconds until the next one."""
        self.unheard, self.asked_at = self.unheard + 1, now
        return ASK_AGAIN if self.unheard <= UNHEARD else ASK_LESS

    def hear(self) -> bool:
        """Take note of any word of the goal; return whether it breaks a long silence."""
        silent, self.unheard = self.unheard > UNHEARD, 0
        return silent

    def cancel_answered(self, code: int, now: float) -> None:
        """Take note of an answer."""
        if self.answer != CANCEL_ACCEPTED:  # after that, rcl calls it TERMINATED
            self.answer = code
        if code != CANCEL_UNKNOWN_GOAL:
            self.denied_since = math.inf
            return
        self._denied_at, self.denied_since = now, min(now, self.denied_since)

    def denied_lately(self, now: float) -> bool:
        """Return whether the last answer was a denial, and is not old."""
        return self.denied_since < math.inf and now - self._denied_at <= 2 * ASK_AGAIN

    def left_to_deny(self, now: float) -> float:
        """Return the seconds for which it must still be denied until that is believed for good."""
        return min(now, self.denied_since) + DENIED_FOR_GOOD - now

    def begin_anew(self, now: float) -> None:
        """Ask whoever has the goal again; of all answers, only a late denial still counts."""
        if not self.denied_lately(now):
            self.denied_since = math.inf
        self.unheard, self.answer = 0, None


@dataclass(slots=True)
class LostResult:
    """Whether a goal that seems to have ended owes its result."""

    status: int | None = None
    """Terminal, from the status topic: so it has ended."""
    questions: int = 0
    """For the result since then."""
    denials: int = 0
    """So often its server has said, in a row, that it does not know the goal."""

    def asked_in_vain(self) -> bool:
        """Count a question; return whether there were enough of them."""
        if self.status is None:
            return False
        self.questions += 1
        return self.questions > RESULT_QUESTIONS
