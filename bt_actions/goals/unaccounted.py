"""A goal that is not accounted for, in the words of the log, the end report and the exit."""

from __future__ import annotations

from dataclasses import dataclass

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Outcome


@dataclass(frozen=True, slots=True)
class GoalReport:
    """A goal that is not accounted for, and may still be running."""

    name: str
    server: str
    goal_id: str
    outcome: Outcome | None
    reason: str
    fields: str = ""
    """The fields of the goal, in short: ``{distance: 12.0}``."""

    @property
    def alarm(self) -> str:
        """The report as one line of a log, with the remedy."""
        remedy = f"once this process has ended, `bt-actions cleanup {self.server}` cancels it"
        return f"not accounted for: {self}; {remedy}"

    def __str__(self) -> str:
        """Name the leaf, the server and the goal, and the reason."""
        asks = f" {self.fields}" if self.fields and self.fields not in self.reason else ""
        why = f": {self.reason}" if self.reason else ""
        return f"{self.name} on {self.server}, goal {self.goal_id}{asks}{why}"


def report_of(goal: Goal, name: str) -> GoalReport:
    """Return the report of a goal of the leaf called `name`, as the goal stands."""
    why = f"{goal.reason}{goal.cancel_said}"
    return GoalReport(name, goal.server, goal.id.hex(), goal.outcome, why, goal.fields)
