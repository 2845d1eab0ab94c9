"""Have all servers of an action been alive for long enough to tell what they run? No ROS.

Nobody can ask a server for all of its goals: it publishes them, and its middleware delivers that
when it does. A server that has had no goal yet publishes nothing. But a server that has answered
every question for some seconds has had the time. Neither a status nor an answer says whose it is:
so a status tells of a server that is alone, and as many answers have to come as there are servers
in sight. The same holds of a goal that they deny: one that was sent, and not accepted yet, may turn
up later.

Times are seconds of the steady clock. Looks for nothing itself.
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
"""so many, and the server may have been stopped in between."""
SETTLE = 4.0
"""Seconds of answers within which a server's status must have been received; where a client was
just killed, that took 2.2 s each time, else 0.02 s (Fast DDS offers again every 3 s)."""
SETTLE_AFTER_SILENCE = 7.0
"""The same where a server was silent before: what a stopped one, or a machine without time for it,
offers may be lost twice."""


class Answers:
    """For how long all servers have given one answer to a question that is asked again and again.

    Of a goal, that they have not got it: a server denies also what it has received, and has not
    decided on, so only time tells.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Begin anew, in a new participant, say, whose numbers begin anew, too."""
        self._asked: dict[int, tuple[float, frozenset[bytes]]] = {}
        self._count = Counter[int]()
        self._last = NEVER, frozenset[bytes]()  # question that all have answered
        self.lasted = 0.0
        """Seconds for which all have answered it, the last time too."""

    def asked(self, number: int, of: frozenset[bytes], now: float) -> None:
        """Take note that the question of this number was asked, `of` these servers."""
        self._asked[number] = now, of

    def answer_came(self, number: int) -> bool:
        """Take the answer of one server to this question; return whether it was the last."""
        if number not in self._asked:
            return False
        self._count[number] += 1
        at, of = self._asked[number]
        since, all_then = self._last
        if self._count[number] != len(of) or at <= since:
            return False
        # For the rest of a longer time it may have been stopped
        self.lasted = self.lasted + min(at - since, LATE) if of == all_then else 0.0
        self._last = at, of
        return True


class RollCall:
    """The servers of one action, told apart by GID, in one participant after another."""

    def __init__(self, action: str) -> None:
        self.action = action
        self.servers: frozenset[bytes] = frozenset()
        """All that were ever in sight."""
        self._settled: frozenset[bytes] = frozenset()  # those that have told it, or had the time
        self._settle = SETTLE
        self._answers = Answers()
        self._asked_at = 0.0  # last; 0: not since one came in sight
        self._heard_at = self._complete_at = NEVER  # from any server, and from the last
        self.begin()

    def begin(self) -> None:
        """Go on in a new participant, which has nothing in sight yet."""
        if self.servers and not self.known:
            self._settle = SETTLE_AFTER_SILENCE
        self._shown: frozenset[bytes] = frozenset()

    @property
    def known(self) -> bool:
        """Whether every server that was ever in sight has told what it runs, or had the time."""
        return bool(self.servers) and self.servers <= self._settled

    @property
    def trouble(self) -> str:
        """Why it is not `known`; the action's name, or several, belong in the braces."""
        if not self._shown or self._asked_at - self._heard_at > LATE:
            return "no server of {} answers"
        if self._gone:
            return "a server of {} went away meanwhile"
        return "not every server of {} answers for long enough"

    @property
    def _gone(self) -> frozenset[bytes]:
        return self.servers - self._settled - self._shown

    def overdue(self, now: float) -> bool:
        """Return whether it is not `known`, and not about to be."""
        return not self.known and (not self._shown or now - self._complete_at >= SETTLE)

    def sees(self, shown: frozenset[bytes], now: float) -> None:
        """Take what is in sight now."""
        if shown - self.servers or (shown and not self._shown):
            self._answers.begin()
            self._asked_at, self._complete_at = 0.0, now
        self.servers |= shown
        self._shown = shown

    def tells(self) -> None:
        """Take note that a lone server has told its goals: nothing else need be known of it."""
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
        # Of one that has gone untold nobody can say that it has answered
        if now - self._asked_at <= LATE and self._answers.answer_came(number) and not self._gone:
            self._complete_at = now
            if self._answers.lasted >= self._settle:
                self._settled |= self._shown


@dataclass(slots=True)
class LeftBehind:
    """A goal whose orchestrator is dead. `end` is UNKNOWN until the server tells.

    Where two servers of one name were in sight it stays UNKNOWN: either may run it, and a status
    does not tell whose it is.
    """

    call: RollCall
    """The servers of its action."""
    goal_id: bytes
    pid: int
    shown: End = End.UNKNOWN
    asked_at: float = NEVER
    takes: float = DENIED_FOR_GOOD
    """Seconds for which it has to be denied until it will not turn up any more."""
    awaited: bool = False
    """The goal was sent, and no server has shown it yet; one may."""
    nothing_left: str = ""
    """Why none will, or its end is not told: it need not be awaited."""
    denials: Answers = field(default_factory=Answers)

    @property
    def end(self) -> End:
        """How it ended, as far as is known."""
        return self.shown if len(self.call.servers) <= 1 else End.UNKNOWN

    @property
    def is_over(self) -> bool:
        """Whether nobody runs it, nor will."""
        return self.end is not End.UNKNOWN or bool(self.nothing_left)

    def judge(self, *, known: bool, gone: bool) -> None:
        """See whether to await it: all that its servers run may be `known`, or they are `gone`."""
        if self.nothing_left == GONE and not gone:  # one is in sight after all
            self.awaited, self.nothing_left = True, ""
        if self.awaited and self.denials.lasted >= self.takes:
            self.awaited, self.nothing_left = False, f"denied for {self.takes:g} s"
        elif self.awaited and known and gone:
            self.awaited, self.nothing_left = False, GONE
