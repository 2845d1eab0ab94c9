"""The roll call of all servers of an action: whether each has had the time to tell its goals.

No ROS.

The problem: a server cannot be asked for all of its goals. A server publishes their status, and the
middleware delivers that at some time. A server that has had no goal yet publishes nothing, so
silence may mean "no goals" or "not delivered yet". And no status and no answer says whose it is.

The rule: once a second all servers get a question about a goal that does not exist, which each live
server answers. A question counts when as many answers have come as servers were in sight. A server
that has answered each question for 4 s has had the time to tell its goals. Silence of more than 1.5
s starts the row anew, and the row must then last 7 s. A status settles the matter at once for a
server that is alone.

Why that is enough: a link that carries answers carries the status, too, and Fast DDS offers a lost
status again every 3 s; 2.2 s were measured. A server that was stopped in between answers nothing,
so the row shows it.

A goal that was sent and not accepted needs the same patience: a server denies a request that it has
received and not decided on. Only a row of denials of 30 s shows that the goal will not turn up.

Times are seconds of the steady clock. Nothing here sends a question.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from bt_actions.goals.asking import DENIED_FOR_GOOD
from bt_actions.goals.policy import End
from bt_actions.goals.terms import NEVER

GONE = "its server is gone"
ASK_AGAIN = 1.0
"""Seconds between two questions;"""
LATE = 1.5
"""seconds of silence after which the server may have been stopped in between."""
SETTLE = 4.0
"""Seconds of answers within which a server's status must have been received; where a client was
just killed, that took 2.2 s each time, else 0.02 s (Fast DDS offers again every 3 s)."""
SETTLE_AFTER_SILENCE = 7.0
"""The same after a silence: the offers of a server that was stopped, or of a machine without
time, may be lost twice."""


class Answers:
    """The time for which all servers have given one answer to a question that is asked repeatedly.

    For a goal the answer is a denial. A server also denies a request that it has received and not
    decided on, so only time tells.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Begin anew, as in a new participant, whose question numbers begin anew, too."""
        self._asked: dict[int, tuple[float, frozenset[bytes]]] = {}
        self._count = Counter[int]()
        self._last = NEVER, frozenset[bytes]()  # the question that all have answered
        self.lasted = 0.0
        """Seconds for which all servers have given the answer, each time."""

    def asked(self, number: int, of: frozenset[bytes], now: float) -> None:
        """Take note that the question of this number went to these servers."""
        self._asked[number] = now, of

    def answer_came(self, number: int) -> bool:
        """Take one server's answer to this question; return whether it was the last one missing."""
        if number not in self._asked:
            return False
        self._count[number] += 1
        at, of = self._asked[number]
        since, all_then = self._last
        if self._count[number] != len(of) or at <= since:
            return False
        # In a longer gap the server may have been stopped
        self.lasted = self.lasted + min(at - since, LATE) if of == all_then else 0.0
        self._last = at, of
        return True


class RollCall:
    """The servers of one action, told apart by GID, in one participant after another."""

    def __init__(self, action: str) -> None:
        self.action = action
        self.servers: frozenset[bytes] = frozenset()
        """All servers that were ever in sight."""
        self._settled: frozenset[bytes] = frozenset()  # told, or had the time
        self._settle = SETTLE
        self._answers = Answers()
        self._asked_at = 0.0  # the last question; 0: none since a server came in sight
        self._heard_at = self._complete_at = NEVER  # last answer, last full row
        self.begin()

    def begin(self) -> None:
        """Go on in a new participant, which has nothing in sight yet."""
        if self.servers and not self.known:
            self._settle = SETTLE_AFTER_SILENCE
        self._shown: frozenset[bytes] = frozenset()

    @property
    def known(self) -> bool:
        """Whether every server that was ever in sight has told its goals, or had the time."""
        return bool(self.servers) and self.servers <= self._settled

    @property
    def trouble(self) -> str:
        """The reason why the action is not `known`; its name, or several, belong in the braces."""
        if not self._shown or self._asked_at - self._heard_at > LATE:
            return "no server of {} answers"
        if self._gone:
            return "a server of {} went away meanwhile"
        return "not every server of {} answers for long enough"

    @property
    def _gone(self) -> frozenset[bytes]:
        return self.servers - self._settled - self._shown

    def overdue(self, now: float) -> bool:
        """Return whether the action is not `known`, and not about to be."""
        return not self.known and (not self._shown or now - self._complete_at >= SETTLE)

    def sees(self, shown: frozenset[bytes], now: float) -> None:
        """Take the servers that are in sight now."""
        if shown - self.servers or (shown and not self._shown):
            self._answers.begin()
            self._asked_at, self._complete_at = 0.0, now
        self.servers |= shown
        self._shown = shown

    def tells(self) -> None:
        """Take note of a status: a server that is alone has told all its goals."""
        if len(self.servers) == 1:
            self._settled |= self.servers

    def due(self, now: float) -> bool:
        """Return whether to ask the next question now."""
        return bool(self._shown) and now - self._asked_at >= ASK_AGAIN

    def asked(self, number: int, now: float) -> None:
        """Take note that the question of this number was asked."""
        if self._asked_at and (self._complete_at <= self._asked_at or now - self._asked_at > LATE):
            self._answers.begin()
            self._settle = SETTLE_AFTER_SILENCE
        self._answers.asked(number, self._shown, now)
        self._asked_at = now

    def answer_came(self, number: int, now: float) -> None:
        """Take an answer to the question of this number, or to one about a goal."""
        self._heard_at = now
        # After a server has gone untold, no count of answers can be complete
        if now - self._asked_at <= LATE and self._answers.answer_came(number) and not self._gone:
            self._complete_at = now
            if self._answers.lasted >= self._settle:
                self._settled |= self._shown


@dataclass(slots=True)
class LeftBehind:
    """A goal whose process is dead. `end` is UNKNOWN until the server tells.

    Where two servers of one name were in sight, the end stays UNKNOWN: either may run the goal, and
    a status does not tell whose it is.
    """

    call: RollCall
    """The servers of the goal's action."""
    goal_id: bytes
    pid: int
    shown: End = End.UNKNOWN
    asked_at: float = NEVER
    takes: float = DENIED_FOR_GOOD
    """Seconds of denials until the goal will not turn up any more."""
    awaited: bool = False
    """Whether the goal was sent, no server has shown it yet, and one may."""
    nothing_left: str = ""
    """The reason why no server will show the goal, or tell its end; "" while one may."""
    denials: Answers = field(default_factory=Answers)

    @property
    def end(self) -> End:
        """The end of the goal, as far as is known."""
        return self.shown if len(self.call.servers) <= 1 else End.UNKNOWN

    @property
    def is_over(self) -> bool:
        """Whether no server runs the goal, nor will."""
        return self.end is not End.UNKNOWN or bool(self.nothing_left)

    def judge(self, *, known: bool, gone: bool) -> None:
        """Decide whether to await the goal.

        All goals of its servers may be `known`, or the servers `gone`.
        """
        if self.nothing_left == GONE and not gone:  # a server is in sight after all
            self.awaited, self.nothing_left = True, ""
        if self.awaited and self.denials.lasted >= self.takes:
            self.awaited, self.nothing_left = False, f"denied for {self.takes:g} s"
        elif self.awaited and known and gone:
            self.awaited, self.nothing_left = False, GONE
