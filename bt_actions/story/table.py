"""The table of a run's actions, in lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from bt_actions.goals.policy import End, Outcome
from bt_actions.story.actions import ActionStory
from bt_actions.utilities.shorten import MESSAGE

STOOD = (Outcome.SUCCEEDED, Outcome.UNEXPECTED_RESULT, Outcome.ABORTED)
"""Outcomes that follow from how the goal ended on its server."""


def table(
    actions: Iterable[ActionStory],
    names: Callable[[ActionStory], str],
    now: float,
    width: int = MESSAGE,
) -> list[str]:
    """Return actions as lines under a head, each as it stands at `now` on the steady clock.

    `names` gives their names, which are cut so that lines fit into `width`.
    """
    body = [
        (
            names(action),
            action.server,
            _tries(action),
            verdict(action),
            f"{action.seconds(now):.2f} s{' in all' if action.visits > 1 else ''}",
        )
        for action in actions
    ]
    return _columns(body, width) if body else []


def _tries(action: ActionStory) -> str:
    if action.visits <= 1:
        return f"{action.attempts}"
    return f"{action.attempts} in {action.visits} visits"


def verdict(action: ActionStory) -> str:
    """Return the outcome for the table, or the goal's state while there is none.

    The end is added where the goal may still be running, or run again, and where the robot did what
    nobody waited for.
    """
    if action.outcome is None:
        return action.state
    surprise = action.outcome not in STOOD and action.end in (End.SUCCEEDED, End.ABORTED)
    gone = action.end is End.SERVER_GONE and action.outcome is not Outcome.SERVER_LOST
    told = f", end {action.end}" if surprise or gone or action.end is End.UNKNOWN else ""
    late = action.outcome is Outcome.SUCCEEDED and action.reason.startswith("late:")
    failed = f", {action.failed} of {action.visits} visits failed"
    some = failed if action.visits > 1 and action.failed else ""
    return f"{action.outcome}{told}{', late' if late else ''}{some}"


def _columns(body: list[tuple[str, str, str, str, str]], width: int = MESSAGE) -> list[str]:
    """Return name, server, tries, verdict and duration of actions as lines, under a head."""
    head = ("action", "server", "attempts", "outcome", "duration")
    widths = [max(len(line[column]) for line in (head, *body)) for column in range(len(head))]
    for column in (1, 0):  # the server first: it is often a long name
        excess = sum(widths) + 2 * (len(widths) - 1) - width
        widths[column] -= max(0, min(excess, widths[column] - 8))
    right = {2, 4}
    return [
        "  ".join(
            _cut(cell, size).rjust(size) if column in right else _cut(cell, size).ljust(size)
            for column, (cell, size) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in (head, *body)
    ]


def _cut(cell: str, size: int) -> str:
    return cell if len(cell) <= size else cell[: size - 2] + ".."
