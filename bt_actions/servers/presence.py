"""One action server, seen from outside: whether the server is in sight, alone, and still the same.

The watch takes the facts of discovery (readiness, and the GIDs of the readers of goal requests),
and the answers to probes. No ROS, no thread, no clock of its own. The watch sends nothing:
`wants_probe` says that a probe is due.

Two readers of goal requests are not yet two servers: a server that was killed stays in discovery
until its lease runs out (20 s with the settings of Fast DDS). A probe is a question that every live
server answers once. Two answers mean two servers. One answer and then silence mean a dead server
and its successor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from bt_actions.goals.terms import NEVER

GID = bytes

PROBE_EVERY = 0.5
"""Seconds between probes while a server in sight may be alive or dead."""
NO_SECOND_AFTER = 1.0
"""Seconds of silence after a probe's first answer until no second one is expected any more,"""
SLOWEST_START = 3.0
"""and seconds within which a server that has just come in sight answers (0.15 to 2.7 measured)."""
PROBES_KEPT = 20
"""Probes whose answers are counted; older probes expect no answer."""
LEASE = 25.0
"""Seconds after which no dead server is shown: a server that still is shown lives."""
NOT_READY_FOR = 2.0
"""Seconds without readiness and without a word, though requests would be read, until the server
counts as gone."""


class Server(Enum):
    """The state of the servers that answer under a name."""

    ABSENT = "absent"
    READY = "ready"
    UNCLEAR = "unclear"
    """Several are shown, and it is not known yet which of them live."""
    AMBIGUOUS = "ambiguous"


@dataclass(slots=True)
class _Probe:
    sent: float
    answers: int = 0
    first: float = NEVER
    """The moment of the first answer."""


class ServerWatch:
    """The picture of one server, drawn from observations at any times the caller likes."""

    def __init__(self) -> None:
        self.gids: frozenset[GID] = frozenset()
        self.in_sight_since = NEVER
        """The moment from which on a server has been shown, without a gap that was seen."""
        self.alone = False
        """Whether several GIDs are shown, but only one server answers."""
        self._unready_since = math.inf
        self.crowded_since = math.inf
        """The moment from which on all servers that are shown now have been, if they are
        several."""
        self._not_alone_before = NEVER
        self._probed_at = NEVER
        self._probes: dict[bytes, _Probe] = {}  # by the ids that they ask for
        self.heard_at = NEVER
        """The moment of the last word of a server: a server that speaks is there."""
        self._most_answers = 0  # to one question

    def see(self, now: float, ready: bool, gids: frozenset[GID], *, concludes: bool = True) -> None:
        """Take what discovery shows at `now` (seconds, steady clock).

        `concludes`: whether all arrived answers are in, so that silence means something.
        """
        if self.state(now) is Server.ABSENT:
            self.in_sight_since = now
        self._unready_since = math.inf if ready else min(now, self._unready_since)
        if gids != self.gids:
            self.alone, self._most_answers = False, 0
            self._probes.clear()
            self.gids = gids
            self.crowded_since = now if self.is_crowded else math.inf
        is_open = concludes and not self.both_live and now >= self._not_alone_before
        if is_open and now - self.crowded_since >= SLOWEST_START:
            self.alone = self._answered_once(now, self.crowded_since)

    def stood_still(self, now: float) -> None:
        """Take note of a stall of this process: answers of that time are yet to come in."""
        self._not_alone_before = now + NO_SECOND_AFTER

    @property
    def is_crowded(self) -> bool:
        """Whether several servers are shown."""
        return len(self.gids) > 1

    def _answered_once(self, now: float, sent_since: float) -> bool:
        return any(
            probe.answers == 1 and now - probe.first >= NO_SECOND_AFTER and probe.sent >= sent_since
            for probe in self._probes.values()
        )

    def alone_since(self, now: float, moment: float) -> bool:
        """Return whether one server answers alone, now and to all requests since `moment`.

        The sender of any answer at `moment` is then the only server.
        """
        return self.state(now) is Server.READY and self.alone and self._answered_once(now, moment)

    def probe_sent(self, now: float, probe: bytes) -> None:
        """Take note that a probe goes out, which asks for a goal of this id."""
        self._probes[probe] = _Probe(now)
        if len(self._probes) > PROBES_KEPT:
            del self._probes[next(iter(self._probes))]

    def probe_answered(self, now: float, goal_id: bytes) -> bool:
        """Take an answer; return whether the probe is no older than the servers that are shown."""
        probe = self._probes.get(goal_id)
        if probe is None:
            return False
        probe.answers += 1
        if probe.answers == 1:
            probe.first = now
        else:
            self.two_answered(probe.answers)
        return True

    def two_answered(self, answers: int = 2) -> None:
        """Take note that several servers have answered one question, a probe or another."""
        if self.is_crowded:
            self._most_answers = max(self._most_answers, answers)
            self.alone = False

    @property
    def both_live(self) -> bool:
        """Whether two of the servers that are shown have answered one question."""
        return self._most_answers > 1

    def all_live(self, now: float) -> bool:
        """Return whether several servers are shown, and all of them live.

        All live if that many have answered one question; or if two have, for so long that a dead
        server would not be shown any more.
        """
        none_dead = self._most_answers >= len(self.gids) or now - self.crowded_since > LEASE
        return self.both_live and none_dead

    def state(self, now: float) -> Server:
        """Return the state of the servers under the name, as far as is known at `now`."""
        if self._unready_since < math.inf or not self.gids:
            return Server.ABSENT
        if not self.is_crowded:
            return Server.READY
        none_dead = now - self.crowded_since > LEASE and now >= self._not_alone_before
        if self.both_live or none_dead:
            return Server.AMBIGUOUS
        return Server.READY if self.alone else Server.UNCLEAR

    def wants_probe(self, now: float, *, runs: bool = False) -> bool:
        """Return whether a probe is due; the caller sends one at a True.

        `runs`: whether goals may run here, so that an unready server must be told from a gone one.
        """
        is_open = self.is_crowded and not self.both_live
        is_open |= runs and self._unready_since < math.inf and bool(self.gids)
        if not is_open or now - self._probed_at < PROBE_EVERY:
            return False
        self._probed_at = now
        return True

    def gone(self, now: float, sent_to: frozenset[GID]) -> bool:
        """Return whether no server that the goal was sent to is there any more.

        An unready server is gone if it is silent, and no other is in sight: readiness is that of
        the name, and a second server that is discovered in part takes it away.
        """
        if not sent_to & self.gids:
            return True
        silent_since = max(self._unready_since, self.heard_at)
        return not self.is_crowded and now - silent_since >= NOT_READY_FOR

    def changed(self, sent_to: frozenset[GID]) -> bool:
        """Return whether a server is shown that was not there when the goal was sent."""
        return bool(self.gids - sent_to)
