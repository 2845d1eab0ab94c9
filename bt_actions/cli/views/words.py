"""What the views say in words: where a goal stands, what a message holds, how a run ended.

Pure functions of the report and of messages; nothing here writes anything.
"""

from __future__ import annotations

from dataclasses import dataclass

from py_trees.common import Status

from bt_actions.cli.exits import Exit
from bt_actions.cli.views.table import summary, table
from bt_actions.goals.policy import End, Outcome
from bt_actions.running.report import Report, Row
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import MESSAGE, fit, shorten
from bt_actions.utilities.suggest import listing

_USUAL_ENDS = {
    Outcome.SUCCEEDED: End.SUCCEEDED,
    Outcome.UNEXPECTED_RESULT: End.SUCCEEDED,
    Outcome.ABORTED: End.ABORTED,
    Outcome.CANCELED: End.CANCELED,
    Outcome.CANCELED_BY_OTHER: End.CANCELED,
    Outcome.REJECTED: End.NEVER_STARTED,
    Outcome.SERVER_UNAVAILABLE: End.NEVER_STARTED,
    Outcome.SERVER_AMBIGUOUS: End.NEVER_STARTED,
    Outcome.SERVER_BUSY: End.NEVER_STARTED,
    Outcome.INVALID_GOAL: End.NEVER_STARTED,
    Outcome.SERVER_LOST: End.SERVER_GONE,
}
"""Ends that go without saying."""
MOST = 3
"""Of many actions that are waited for, or many items of a list, how many are shown."""
MANY = 20
"""Items of a list that is shown whole."""
LONG = 200
"""Characters of a value; longer ones are cut."""


@dataclass(frozen=True, slots=True)
class Closing:
    """How a run ended, for the last words of a view."""

    exit_code: Exit
    cause: str = ""
    """Why it did not end by itself ("interrupted by SIGINT"), or ""."""
    verdict: str = ""
    """What the simulated world looks like, or ""."""
    complaint: str = ""
    """What is not as it was expected of the world, or ""."""
    error: str = ""
    """The bug in a behaviour that ended the run, or ""."""


def last_words(report: Report, closing: Closing, width: int = MESSAGE) -> list[str]:
    """Return the table, the verdict, how long it took, and last what went wrong."""
    lines = ["", *table(report, width)] if report.rows else []
    outputs = [clean(f"{name}: {brief(value)}") for name, value in outputs_of(report).items()]
    lines += ["", *outputs] if outputs else []
    lines += ["", closing.verdict] if closing.verdict else []
    word = report.status.value if report.status is not Status.INVALID else "STOPPED"
    cause = f", {closing.cause}" if closing.cause else ""
    cause += ", but not as it should be" if closing.complaint and word == "SUCCESS" else ""
    lines += ["", f"{word} after {report.now - report.started:.2f} s{cause}"]
    wrong = troubles(report, closing)
    return [*lines, *(["", *wrong] if wrong else [])]


def outputs_of(report: Report) -> dict[str, object]:
    """Return what the tree gave its outputs; only once it has succeeded."""
    if report.status is not Status.SUCCESS:
        return {}
    from bt_actions.document import tree_outputs

    return tree_outputs(report.root)


def brief(value: object) -> str:
    """Return a value as people read it, short however large it is; a text without quotes."""
    return fit(value, LONG) if isinstance(value, str) else shorten(value, LONG)


def troubles(report: Report, closing: Closing) -> list[str]:
    """Return what went wrong, the gravest last; empty when nothing did."""
    warned = [f"{' / '.join(each.path)}: {each.message}" for each in report.warnings]
    warnings = [fit(f"warning: {clean(line)}") for line in warned]
    return [*warnings, *summary(report), *left_open(report, closing)]


def left_open(report: Report, closing: Closing) -> list[str]:
    """Return what went wrong beside the tree, and what is not known, the gravest last."""
    lines = [line for line in (closing.complaint, closing.error) if line]
    left = {row.server for row in report.rows if row.left_at_server or row.live}
    if left and not closing.verdict:  # of a simulation, which ends with us
        which = " ".join(["", *sorted(left)]) if len(left) <= MOST else ""
        lines.append(
            "A goal may still run, or run on where its server only stood still: once that is in "
            f"sight, `bt-actions cleanup{which}` cancels it."
        )
    lines += [f"not accounted for: {line}" for line in report.unaccounted]
    return [fit(clean(line)) for line in lines]


def goal_text(row: Row) -> str:
    """Say where the latest goal of an action stands."""
    attempt = f" (attempt {row.attempt})" if row.attempt > 1 else ""
    if row.outcome is None:
        words = {
            "QUEUED": "waiting for its turn on",
            "WAITING_FOR_SERVER": "waiting for the server",
            "SENDING": "sending a goal to",
            "EXECUTING": "executing on",
            "CANCELING": "canceling on",
        }
        return f"{words.get(row.state, row.state.lower())} {row.server}{attempt}"
    text = f"{row.outcome}{attempt}"
    if row.end is End.UNKNOWN:
        return f"{text}, end not known{' yet' if row.live else ''}"  # why, is told of the goal
    if row.in_doubt:
        text += ", not started as far as its server knows"
    elif row.end is not None and row.end is not _USUAL_ENDS.get(row.outcome):
        text += f", ended {row.end}"
    return text + (f": {row.reason}" if row.reason and row.outcome is not Outcome.SUCCEEDED else "")


def waiting_text(report: Report) -> str:
    """Say for what a run waits whose tree has ended; "" where it is over."""
    rows = [row for row in report.rows if row.waited_for]
    if rows:
        goals = sum(row.waited_for for row in rows)
        count = "1 goal" if goals == 1 else f"{goals} goals"
        return f"waiting to know the end of {count}: {_where(report, rows)}"
    rows = [row for row in report.rows if row.left_at_server]
    if rows:
        what = "looking out for a server that went away, to cancel its goal if it is back"
        return f"{what}: {_where(report, rows)}"
    return ""


def _where(report: Report, rows: list[Row]) -> str:
    return listing([f"{report.called(row.behaviour)} on {row.server}" for row in rows], MOST)


def feedback_text(row: Row) -> str:
    """Return the latest feedback of an action on one line: its plain fields."""
    from bt_actions.messages.fields import fields_in_words

    progress = getattr(row.behaviour, "progress", None)
    if progress is None:
        return ""
    message = progress().feedback
    return "" if message is None else fields_in_words(message)


def result_lines(result: object) -> list[str]:
    """Return a result message as lines of YAML; of long values the beginning."""
    if result is None:
        return []
    import yaml

    from bt_actions.messages.conversion import to_plain
    from bt_actions.messages.fields import constant_name

    text = yaml.safe_dump(_short(to_plain(result)), sort_keys=False, allow_unicode=True)
    lines = []
    for line in text.splitlines():
        field, _, written = line.partition(": ")
        name = constant_name(result, field, int(written)) if written.isdecimal() else written
        lines.append(f"  {line}" + (f"  # {name}" if name != written else ""))
    return lines


def _short(data: object) -> object:
    """Return plain data with the first items of long lists, and the beginning of long texts."""
    if isinstance(data, dict):
        return {key: _short(value) for key, value in data.items()}
    if isinstance(data, list):
        more = [f"… {len(data)} items"] if len(data) > MANY else []
        return [_short(item) for item in (data[:MOST] if more else data)] + more
    return brief(data) if isinstance(data, str) else data
