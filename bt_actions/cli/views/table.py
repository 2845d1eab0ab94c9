"""A run's actions as a table, and why its tree failed, as lines. Looks at the report alone."""

from __future__ import annotations

from bt_actions.goals.policy import End, Outcome
from bt_actions.running.report import Report, Row
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import MESSAGE, fit

STOOD = (Outcome.SUCCEEDED, Outcome.UNEXPECTED_RESULT, Outcome.ABORTED)
"""Outcomes that say how the goal ended on its server."""


def table(report: Report, width: int = MESSAGE) -> list[str]:
    """Return the table of actions as lines; names are cut so that lines fit into `width`."""
    body = [
        (
            report.called(row.behaviour),
            row.server,
            _tries(row),
            verdict(row),
            f"{row.seconds(report.now):.2f} s",
        )
        for row in report.rows
    ]
    return columns(body, width) if body else []


def _tries(row: Row) -> str:
    return f"{row.attempts}" if row.visits <= 1 else f"{row.attempts} in {row.visits}"


def verdict(row: Row) -> str:
    """Return the outcome for the table: where the goal stands while there is none.

    The end is told where the goal may still be running, or run again, and where the robot did what
    nobody waited for.
    """
    if row.outcome is None:
        return row.state
    surprise = row.outcome not in STOOD and row.end in (End.SUCCEEDED, End.ABORTED)
    gone = row.end is End.SERVER_GONE and row.outcome is not Outcome.SERVER_LOST
    told = f", end {row.end}" if surprise or gone or row.end is End.UNKNOWN else ""
    late = row.outcome is Outcome.SUCCEEDED and row.reason.startswith("late:")
    return f"{row.outcome}{told}{', late' if late else ''}"


def columns(body: list[tuple[str, str, str, str, str]], width: int = MESSAGE) -> list[str]:
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


def summary(report: Report) -> list[str]:
    """Return why the tree failed: for each leaf its path, attempts, outcome, reason and place."""
    lines: list[str] = []
    for culprit in report.culprits():
        lines.append(" / ".join(culprit.path))
        row = culprit.row
        if row is None or row.outcome is None:
            lines.append(f"  failed{_because(culprit.message)}")
        else:
            tries = "1 attempt" if row.attempt == 1 else f"{row.attempt} attempts"
            is_told = row.end is End.UNKNOWN  # of the goal that is not accounted for
            why = "" if is_told else _because(row.reason or culprit.message)
            lines.append(f"  {row.outcome} after {tries}{why}")
        if culprit.place:
            lines.append(f"  {culprit.place}")
    return [fit(line) for line in lines]


def _because(reason: str) -> str:
    return f": {clean(reason)}" if reason else ""
