"""What an action waits for, and until when, as far as its events tell.

A deadline that stands still, as its tree is paused or this process was stopped, is not known of
here: it then falls due later than is said.
"""

from __future__ import annotations

from typing import NamedTuple

from bt_actions.story.actions import ActionStory, GoalStory

_PHASE = {
    "QUEUED": "queue",
    "WAITING_FOR_SERVER": "server",
    "SENDING": "accept",
    "EXECUTING": "result",
    "CANCELING": "cancel",
}
"""The field of Timeouts that bounds each state of a goal."""


class Due(NamedTuple):
    """A deadline."""

    name: str
    """A field of Timeouts, or ``backoff``."""
    left: float
    """Seconds."""
    limit: float
    """Seconds that it gives in all."""


def due_of(action: ActionStory, now: float) -> Due | None:
    """Return what falls due next; `now` is in seconds on the steady clock."""
    goal = action.latest
    if goal is None:
        return None
    verdict = goal.verdict
    if verdict is not None:
        pause = verdict.again_in
        if pause is None:
            return None
        return Due("backoff", max(0.0, verdict.at.steady + pause - now), pause)
    dues = [_due(action, goal, _PHASE.get(goal.latest.state, ""), goal.since.steady, now)]
    if goal.latest.state == "EXECUTING":
        heard = goal.since if goal.feedback is None else goal.feedback.at
        dues.append(_due(action, goal, "feedback", heard.steady, now))
    return min((due for due in dues if due is not None), key=lambda due: due.left, default=None)


def _due(action: ActionStory, goal: GoalStory, phase: str, since: float, now: float) -> Due | None:
    timeouts = action.node.settings.get("timeouts")
    limit = timeouts.get(phase) if isinstance(timeouts, dict) else None
    if not isinstance(limit, int | float):
        return None
    return Due(phase, max(0.0, since + limit - now), limit)
