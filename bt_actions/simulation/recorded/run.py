"""The answers of action servers to the goals of a recorded run, folded from its events. No ROS.

The events have only the client's view of a server. So no event tells how a canceled goal would have
gone on.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from bt_actions.events.kinds import (
    Event,
    EventsLost,
    FeedbackCame,
    GoalChanged,
    RunBegan,
    ServerSeen,
)
from bt_actions.events.snapshot import HIDDEN, Cut, Value
from bt_actions.goals.policy import End, Outcome
from bt_actions.simulation.fault_plan import GoalFaults
from bt_actions.simulation.faults import FaultKind
from bt_actions.utilities.suggest import listing

_BY_SERVER = (End.SUCCEEDED, End.ABORTED, End.CANCELED)
_ENDED = {
    Outcome.SUCCEEDED: End.SUCCEEDED,
    Outcome.ABORTED: End.ABORTED,
    Outcome.CANCELED_BY_OTHER: End.CANCELED,
}
"""The ends in the words of a server, also where its result tells of goals below with an UNKNOWN
end."""
PROMPT = 0.1
"""Seconds within which a server's reaction counts as immediate."""
THINNED = 0.25
"""Seconds between two feedback messages of a goal that have perhaps lost others between them."""
_ON_CANCEL: dict[End | None, FaultKind] = {
    End.SUCCEEDED: FaultKind.SUCCEED_ON_CANCEL,
    End.ABORTED: FaultKind.ABORT_ON_CANCEL,
}


@dataclass(slots=True, eq=False)
class RecordedGoal:
    """One goal that was sent; moments are seconds on the steady clock of its run."""

    goal: Value
    sent: float
    accepted: float | None = None
    canceled: float | None = None
    """The moment from which on its client did not want it any more."""
    over: float | None = None
    """The moment at which its server had ended it, or was lost."""
    outcome: Outcome | None = None
    ended: End | None = None
    """The end in the words of its server."""
    result: Value = None
    feedback: list[tuple[float, Value]] = field(default_factory=list)
    """Each message, with the moment at which it was told."""
    away: float = 0.0
    """Seconds for which its server was out of sight afterwards; infinity for good."""

    def goal_changed(self, event: GoalChanged) -> None:
        """Fold an event of the goal."""
        is_lost = event.outcome is Outcome.SERVER_LOST
        if event.state == "EXECUTING" and self.accepted is None:
            self.accepted = event.at.steady
        elif event.state == "CANCELING" and self.canceled is None and not is_lost:
            self.canceled = event.at.steady
        self.outcome = event.outcome
        self.result = self.result if event.result is None else event.result
        if event.end in _BY_SERVER:
            self.ended = event.end
        elif event.outcome is not None and self.ended is None:
            self.ended = _ENDED.get(event.outcome, End.CANCELED if event.result else None)
        if self.over is None and (is_lost or self.ended is not None):
            self.over = event.at.steady

    @property
    def began(self) -> float:
        """The moment of acceptance, as far as is known."""
        known = (each for each in (self.accepted, self.over) if each is not None)
        return next(known, self.sent)

    @property
    def seconds(self) -> float:
        """Seconds until the goal ended by itself; infinity where it did not."""
        if self.over is None or self.canceled is not None:
            return math.inf
        return self.over - self.began

    @property
    def heard(self) -> list[tuple[float, Value]]:
        """Each feedback message with the seconds from acceptance until it came."""
        return [(at - self.began, each) for at, each in self.feedback]

    @property
    def faults(self) -> GoalFaults:
        """The deeds of the server beside the goal's end, as faults."""
        found = GoalFaults()
        if self.outcome is Outcome.REJECTED:
            found[FaultKind.REJECT] = None
        elif self.outcome is Outcome.SERVER_LOST and math.isinf(self.away):
            found[FaultKind.DIE] = "execute"
        elif self.outcome is Outcome.SERVER_LOST:
            found[FaultKind.RESTART] = self.away
        elif self.accepted is None and self.ended is None:
            found[FaultKind.DROP_GOAL] = None
        else:
            if self.began - self.sent > PROMPT:
                found[FaultKind.DELAY_ACCEPT] = self.began - self.sent
            if self.canceled is not None:
                self._add_cancel(found, max(self.canceled, self.began))
        return found

    def _add_cancel(self, found: GoalFaults, asked: float) -> None:
        if self.over is None:
            found[FaultKind.DROP_CANCEL] = None
            return
        if self.over - asked > PROMPT:
            found[FaultKind.DELAY_CANCEL] = self.over - asked
        if self.ended in _ON_CANCEL:
            found[_ON_CANCEL[self.ended]] = None


@dataclass(slots=True, eq=False)
class ServerStory:
    """One action server."""

    goals: list[RecordedGoal] = field(default_factory=list)
    """The goals in the order in which they were sent."""
    away: float = 0.0
    """Seconds from the run's beginning until the server came in sight; infinity where it never
    did."""


class RecordedRun:
    """The servers of a run by their full names, and the gaps in what is known."""

    def __init__(self, events: Iterable[Event]) -> None:
        """Fold the events of one run, in their order."""
        self.began: RunBegan | None = None
        self.servers: dict[str, ServerStory] = {}
        self.lost = 0
        """The number of missing events."""
        self.doubled: set[str] = set()
        """Servers to whose name a second one answered."""
        self._goals: dict[str, RecordedGoal] = {}
        self._absent: dict[str, list[RecordedGoal | ServerStory]] = {}
        """Servers out of sight, each with the goals that it had or has had then."""
        for event in events:
            self._take(event)

    @property
    def remarks(self) -> list[str]:
        """A line for each thing that cannot be played as it was."""
        said = []
        if self.lost:
            said.append(f"{self.lost} events are missing: what servers did then is not played")
        if self.doubled:
            said.append(f"two servers answered to {listing(sorted(self.doubled))}: one is played")
        goals = list(self._goals.values())
        parts = {
            "goals": [each.goal for each in goals],
            "results": [each.result for each in goals if each.ended is not None],
            "feedback messages": [value for each in goals for _, value in each.feedback],
        }
        cut = {what: sum(not is_whole(each) for each in of) for what, of in parts.items()}
        if any(cut.values()):
            counts = ", ".join(f"{n} of {len(parts[what])} {what}" for what, n in cut.items() if n)
            said.append(f"not recorded, or not whole: {counts}; what is missing has its default")
        if any(_is_thinned(each) for each in goals):
            said.append("feedback is played as it was recorded: at most five a second of each goal")
        return said

    def _take(self, event: Event) -> None:
        match event:
            case RunBegan():
                self.began = event
            case GoalChanged():
                self._goal_changed(event)
            case FeedbackCame():
                if (goal := self._goals.get(event.goal_id)) is not None:
                    goal.feedback.append((event.at.steady, event.feedback))
            case ServerSeen():
                if event.in_sight:
                    self._came(event.server, event.at.steady)
            case EventsLost():
                self.lost += event.count

    def _goal_changed(self, event: GoalChanged) -> None:
        server = self.servers.setdefault(event.server, ServerStory())
        if event.outcome is Outcome.SERVER_AMBIGUOUS:
            self.doubled.add(event.server)
        goal = self._goals.get(event.goal_id)
        if goal is None and event.state == "SENDING":
            self._came(event.server, event.at.steady)
            goal = self._goals[event.goal_id] = RecordedGoal(event.goal, event.at.steady)
            server.goals.append(goal)
        if goal is None:
            if event.outcome is Outcome.SERVER_UNAVAILABLE and event.server not in self._absent:
                self._went(event.server, server.goals[-1] if server.goals else server)
            return
        is_over = goal.over is not None
        goal.goal_changed(event)
        if event.outcome is Outcome.SERVER_LOST and not is_over:
            self._went(event.server, goal)

    def _went(self, name: str, after: RecordedGoal | ServerStory) -> None:
        after.away = math.inf
        self._absent.setdefault(name, []).append(after)

    def _came(self, name: str, now: float) -> None:
        for after in self._absent.pop(name, ()):
            if isinstance(after, RecordedGoal):
                after.away = now - (after.sent if after.over is None else after.over)
            elif self.began is not None:
                after.away = now - self.began.at.steady


def is_whole(value: Value) -> bool:
    """Return whether all of a value was recorded."""
    if isinstance(value, dict):
        return all(map(is_whole, value.values()))
    if isinstance(value, tuple):
        return all(map(is_whole, value))
    return not (value is None or value == HIDDEN or isinstance(value, Cut))


def _is_thinned(goal: RecordedGoal) -> bool:
    times = [at for at, _ in goal.feedback]
    return any(later - at < THINNED for at, later in itertools.pairwise(times))
