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
"""The same, after `UNHEARD` questions without a word: questions wait in the queue of a busy
server, which holds ten, those of other clients among them."""
UNHEARD = 3
ASK_IN_ANY_CASE = 30.0
"""Seconds between two questions to a server that need not have an answer yet: without them, a
goal without deadlines would wait for ever for a result and a status that are both lost."""
RESULT_QUESTIONS = 40
"""Questions for the result of a goal that has ended, until the result counts as lost. On a link
that loses a fifth, the middleware repairs half of the losses every 3 s; 21 s were measured."""
DOUBTS = 3
"""Denials of a goal that a lone server had accepted, until one is believed."""
DENIED_FOR_GOOD = 30.0
"""Seconds of denials of a request without any other answer, until the end of the tree need not
wait. Should the goal turn up all the same, the server is asked to cancel it."""

LOOKED_OUT_FOR = 3.0
"""Seconds for which a run that is over, or a leaf that is shut down, looks out for a server that
went away: a server that was only stopped still runs its goal."""


@dataclass(slots=True)
class Asking:
    """The requests to cancel one goal, which also ask whether the server has it."""

    unheard: int = 0
    """Requests since the last word of the goal."""
    asked_at: float | None = None
    answer: int | None = None
    """The last answer, a code of action_msgs/srv/CancelGoal."""
    denied_since: float = math.inf
    """The moment since which every answer was: unknown goal."""
    in_vain: bool = False
    """Whether the wait at the tree's end has failed; no other wait until the server is back."""
    _denied_at: float = 0.0

    def ask(self, now: float) -> float:
        """Take note of a request; return the seconds until the next one."""
        self.unheard, self.asked_at = self.unheard + 1, now
        return ASK_AGAIN if self.unheard <= UNHEARD else ASK_LESS

    def hear(self) -> bool:
        """Take note of any word of the goal; return whether a long silence ends."""
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
        """Return whether the last answer was a denial, and is recent."""
        return self.denied_since < math.inf and now - self._denied_at <= 2 * ASK_AGAIN

    def left_to_deny(self, now: float) -> float:
        """Return the missing seconds of denials until a denial is believed for good."""
        return min(now, self.denied_since) + DENIED_FOR_GOOD - now

    def begin_anew(self, now: float) -> None:
        """Begin anew with a server that is back.

        Of all answers, only a recent denial still counts.
        """
        if not self.denied_lately(now):
            self.denied_since = math.inf
        self.unheard, self.answer = 0, None


@dataclass(slots=True)
class LostResult:
    """The result that a goal still owes, though it seems to have ended."""

    status: int | None = None
    """The terminal status, from the status topic: the goal has ended."""
    questions: int = 0
    """Questions for the result since then."""
    denials: int = 0
    """Denials of the goal by its server, in a row."""

    def asked_in_vain(self) -> bool:
        """Count a question; return whether enough were asked."""
        if self.status is None:
            return False
        self.questions += 1
        return self.questions > RESULT_QUESTIONS
