"""Have all servers of an action been alive for long enough to tell what they run? No ROS.

Nobody can ask a server for all of its goals: it publishes them, and its middleware delivers that
when it does. But a server that has answered every question for some seconds has had the time. An
answer does not say whose it is; so as many have to come as there are servers in sight. The same
holds of a goal that they deny: one that was sent, and not accepted yet, may turn up later.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

ASK_AGAIN = 1.0
"""Seconds between two questions;"""
LATE = 1.5
"""so many, and the server may have been stopped in between."""
QUESTIONS = 10
"""How many questions may be under way: over a bad link an answer takes seconds."""
SETTLE = 4.0
"""Seconds of answers within which a server's status must have been received; where a client was
just killed, that took 2.2 s each time, else 0.02 s (Fast DDS offers again every 3 s)."""
SETTLE_AFTER_SILENCE = 7.0
"""The same where a server was silent before: what a stopped one, or a machine without time for it,
offers may be lost twice."""


class RollCall:
    """The servers of one action, told apart by GID, in one participant after another.

    Times are seconds of the steady clock.
    """

    def __init__(self, now: float) -> None:
        self.servers: frozenset[bytes] = frozenset()
        """All that were ever in sight."""
        self.sighted = False
        """Whether anything of a server was."""
        self._settled: frozenset[bytes] | None = None  # those that had the time; None: nobody had
        self._settle = SETTLE
        self.begin(now)

    def begin(self, now: float) -> None:
        """Go on in a new participant, which has nothing in sight yet."""
        if self.sighted and not self.known:
            self._settle = SETTLE_AFTER_SILENCE
        self._shown: frozenset[bytes] = frozenset()
        self._in_sight = False
        self._begin_anew(now)

    def _begin_anew(self, now: float) -> None:
        self._since: float | None = None  # when the first of the questions was asked in a row
        self._number: int | None = None
        self._answers = 0
        self._answers_before = 0
        self._asked_at = float("-inf")
        self._heard_at = now

    @property
    def known(self) -> bool:
        """Whether every server that was ever in sight has had the time to tell what it runs."""
        return self._settled is not None and self.servers <= self._settled

    @property
    def trouble(self) -> str:
        """Why it is not `known`; the action's name, or several, belong in the braces."""
        if not self._in_sight or not (self._answers or self._answers_before):
            return "no server of {} answers"
        if self._gone:
            return "a server of {} went away meanwhile"
        return "not every server of {} answers for long enough"

    @property
    def _gone(self) -> frozenset[bytes]:
        return self.servers - (self._settled or frozenset()) - self._shown

    def overdue(self, now: float) -> bool:
        """Whether it is neither known nor on the way to it."""
        return not self.known and (not self._in_sight or now - self._heard_at >= SETTLE)

    def sees(self, shown: frozenset[bytes], now: float, *, published: bool = False) -> None:
        """Take what is in sight now; a status may be `published` where no server is shown yet."""
        in_sight = bool(shown) or published
        if shown - self.servers or (in_sight and not self._in_sight):
            self._begin_anew(now)
        self.servers |= shown
        self.sighted |= in_sight
        self._shown = shown
        self._in_sight = in_sight

    def due(self, now: float) -> bool:
        """Whether to ask the next question now."""
        return self._in_sight and now - self._asked_at >= ASK_AGAIN

    def asked(self, number: int, now: float) -> None:
        """The question of this number was asked."""
        if not self._complete or now - self._asked_at > LATE or self._since is None:
            self._since = now
            if self._number is not None:
                self._settle = SETTLE_AFTER_SILENCE
        self._number = number
        self._answers_before = self._answers
        self._answers = 0
        self._asked_at = now

    @property
    def _complete(self) -> bool:
        """Whether all have answered the last question; who went away untold cannot."""
        return self._answers >= max(1, len(self._shown)) and not self._gone

    def answered(self, number: int, now: float) -> None:
        """Take an answer to the question of this number; each server gives one."""
        if number != self._number or now - self._asked_at > LATE:
            return
        self._answers += 1
        if self._complete and self._since is not None:
            self._heard_at = now
            if self._asked_at - self._since >= self._settle:
                self._settled = (self._settled or frozenset()) | self._shown


class Denial:
    """For how long all servers of an action have denied that they have a certain goal.

    A server denies what it has received, and has not decided on: only time tells. Times are seconds
    of the steady clock.
    """

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Go on in a new participant, of which the servers have been asked nothing."""
        self._asked: dict[int, tuple[float, Collection[bytes]]] = {}
        self._denials = Counter[int]()
        self._last: tuple[float, Collection[bytes]] | None = None  # question that all denied
        self.lasted = 0.0
        """Seconds for which all have denied it, the last time too."""

    def asked(self, number: int, of: Collection[bytes], now: float) -> None:
        """The question of this number was asked, `of` these servers."""
        self._asked[number] = now, of
        for oldest in list(self._asked)[:-QUESTIONS]:
            del self._asked[oldest], self._denials[oldest]

    def denied(self, number: int) -> None:
        """One server answered the question of this number: it has not got it."""
        if number not in self._asked:
            return
        self._denials[number] += 1
        at, of = self._asked[number]
        if self._denials[number] != max(1, len(of)) or (self._last and at <= self._last[0]):
            return
        if self._last is None or self._last[1] != of:
            self.lasted = 0.0
        else:  # for the rest of a longer time it may have been stopped
            self.lasted += min(at - self._last[0], LATE)
        self._last = at, of
