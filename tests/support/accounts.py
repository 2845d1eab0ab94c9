"""What an orchestrator says of its goals, held against what their servers wrote down."""

from __future__ import annotations

from bt_actions import End
from bt_actions.events import Event, GoalChanged
from bt_actions.simulation.journal import JournalLine, ends, executions


class Report:
    """The last that the orchestrator said of each goal."""

    def __init__(self) -> None:
        self.goals: dict[str, GoalChanged] = {}

    def note_goal(self, event: Event) -> None:
        if isinstance(event, GoalChanged):
            self.goals[event.goal_id] = event


def compare(report: Report, entries: list[JournalLine]) -> dict[str, str]:
    """Fail unless report and journal agree on every goal; return the ends by goal."""
    journal = {goal: str(end) for (_, goal), end in ends(entries).items()}
    unknown = {goal for goal, event in report.goals.items() if event.end is End.UNKNOWN}
    assert unknown == set()
    never = {g for g, event in report.goals.items() if event.end is End.NEVER_STARTED}
    said = {"rejected": End.NEVER_STARTED, "succeeded": End.SUCCEEDED}
    said |= {"aborted": End.ABORTED, "canceled": End.CANCELED}
    assert journal.keys() <= report.goals.keys(), "a goal that the report does not know"
    assert report.goals.keys() - never <= journal.keys(), "a goal that no server has seen"
    wrong = [goal for goal, end in journal.items() if report.goals[goal].end is not said[end]]
    assert wrong == []
    assert [goal for goal, times in executions(entries).items() if times > 1] == []
    return journal
