"""The figures of each action's goals over many runs: outcomes, and the seconds of each phase."""

from __future__ import annotations

import math
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

from bt_actions.events import AttemptEnded, GoalChanged, NodesAdded, RunBegan
from bt_actions.goals.policy import Outcome
from bt_actions.recording.reading import Item
from bt_actions.story.state import State

PHASES = {
    "QUEUED": "waiting for its turn",
    "WAITING_FOR_SERVER": "waiting for the server",
    "SENDING": "waiting for acceptance",
    "EXECUTING": "executing",
    "CANCELING": "canceling",
}
"""The states of a goal that last, in their order, in words."""
Which: TypeAlias = tuple[str, str]
"""An action: its server, and its type."""


class Spread(NamedTuple):
    """Seconds of many goals: the limit for half of them, for 95 in a hundred, and for all."""

    goals: int
    p50: float
    p95: float
    longest: float


@dataclass(slots=True)
class Figures:
    """The figures of the goals of one action."""

    runs: int = 0
    attempts: int = 0
    """Goals that a leaf wished for."""
    sent: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    """The outcomes of the attempts, as the leaf judged them."""
    seconds: defaultdict[str, array[float]] = field(
        default_factory=lambda: defaultdict(lambda: array("d"))
    )
    """Seconds by state, of each goal that has left it."""

    @property
    def success(self) -> float | None:
        """The share of successes among the outcomes; None without any."""
        total = self.outcomes.total()
        return self.outcomes[Outcome.SUCCEEDED.value] / total if total else None

    @property
    def phases(self) -> dict[str, Spread]:
        """The spread by state, in the order in which a goal passes them."""
        return {state: _spread(self.seconds[state]) for state in PHASES if state in self.seconds}


@dataclass(slots=True)
class _Goal:
    which: Which
    state: str
    since: float
    sent: bool = False
    outcome: str = ""
    spent: list[tuple[str, float]] = field(default_factory=list)


class Statistics:
    """The count over one run after another."""

    def __init__(self) -> None:
        self.actions: defaultdict[Which, Figures] = defaultdict(Figures)

    def add(self, items: Iterable[Item]) -> None:
        """Count a run as a whole, or not at all where its reading raises RecordingError."""
        types, goals = dict[int, str](), dict[str, _Goal]()
        for item in items:
            match item:
                case State():
                    types |= {key: each.node.action for key, each in item.nodes.items()}
                case RunBegan() | NodesAdded():
                    types |= {each.id: each.action for each in item.nodes}
                case GoalChanged():
                    self._changed(goals, item, types.get(item.node, ""))
                case AttemptEnded() if item.goal_id in goals:
                    goals[item.goal_id].outcome = item.outcome.value
        for goal in goals.values():
            figures = self.actions[goal.which]
            figures.attempts += 1
            figures.sent += goal.sent
            figures.outcomes.update([goal.outcome] if goal.outcome else ())
            for state, seconds in goal.spent:
                figures.seconds[state].append(seconds)
        for which in {goal.which for goal in goals.values()}:
            self.actions[which].runs += 1

    def _changed(self, goals: dict[str, _Goal], event: GoalChanged, type_: str) -> None:
        now = event.at.steady
        goal = goals.setdefault(event.goal_id, _Goal((event.server, type_), event.state, now))
        if event.state != goal.state:
            goal.spent.append((goal.state, now - goal.since))
            goal.state, goal.since = event.state, now
        goal.sent |= event.state == "SENDING"
        if event.outcome is not None and not goal.outcome:
            goal.outcome = event.outcome.value


def _spread(seconds: array[float]) -> Spread:
    found = sorted(seconds)
    half, most = (found[math.ceil(share * len(found)) - 1] for share in (0.5, 0.95))
    return Spread(len(found), half, most, found[-1])
