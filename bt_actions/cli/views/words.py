"""What the views say in words: where a goal stands, what a message holds, how a run ended.

Pure functions of the report and of messages; nothing here writes anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from py_trees.common import Status

from bt_actions.cli.exits import Exit
from bt_actions.cli.views.table import table
from bt_actions.goals.policy import End, Outcome
from bt_actions.running.report import Report, Row
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import brief

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
CLEAN_UP = "`bt-actions cleanup` cancels what may still be running, once its server is in sight:"


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


def last_words(report: Report, closing: Closing, width: int | None = None) -> list[str]:
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


def troubles(report: Report, closing: Closing) -> list[str]:
    """Return what went wrong, the gravest last; empty when nothing did."""
    warned = [f"{' / '.join(each.path)}: {each.message}" for each in report.warnings]
    lines = [f"warning: {clean(line)}" for line in warned] + report.summary()
    if report.servers_gone and not closing.verdict:
        lines.append(stood_still(report))
    lines += [line for line in (closing.complaint, closing.error) if line]
    if report.unaccounted and not closing.verdict:  # of a simulation, which ends with us
        lines.append(CLEAN_UP)
    lines += [f"not accounted for: {line}" for line in report.unaccounted]
    return lines


def stood_still(report: Report) -> str:
    """Say what to do about servers that went away with a goal."""
    servers = " ".join(sorted({row.server for row in report.rows if row.left_at_server}))
    return (
        "A server that only stood still, or was cut off, may go on with its goal; once it is back,"
        f" `bt-actions cleanup {servers}` cancels that."
    )


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
        text += ", end not known" if not row.live else ", end not known yet"
    elif row.in_doubt:
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
    which = ", ".join(f"{report.called(row.behaviour)} on {row.server}" for row in rows[:MOST])
    return f"{which} and {len(rows) - MOST} more" if len(rows) > MOST else which


def feedback_text(row: Row) -> str:
    """Return the latest feedback of an action on one line: its plain fields."""
    progress = getattr(row.behaviour, "progress", None)
    if progress is None:
        return ""
    message = progress().feedback
    return "" if message is None else fields_text(message)


def fields_text(message: object, most: int = 4) -> str:
    """Return the first scalar fields of a ROS message: names, values, constants by their name."""
    parts: list[str] = []
    for field in getattr(message, "get_fields_and_field_types", dict[str, str])():
        value = getattr(message, field)
        if isinstance(value, float):
            parts.append(f"{field} {value:.2f}" if math.isfinite(value) else f"{field} {value}")
        elif isinstance(value, bool | str):
            parts.append(f"{field} {brief(value)}")
        elif isinstance(value, int):
            parts.append(f"{field} {_constant(message, field, value)}")
    return ", ".join(parts[:most])


def result_lines(result: object) -> list[str]:
    """Return a result message as lines of YAML; of long values the beginning."""
    if result is None:
        return []
    import yaml

    from bt_actions.messages.conversion import to_plain

    text = yaml.safe_dump(_short(to_plain(result)), sort_keys=False, allow_unicode=True)
    lines = []
    for line in text.splitlines():
        field, _, written = line.partition(": ")
        name = _constant(result, field, int(written)) if written.isdecimal() else written
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


def _constant(message: object, field: str, value: int) -> str:
    """The constant FIELD_X of the message's type that has `value`, as X; else the number."""
    from bt_actions.messages.fields import constants

    start = f"{field.upper()}_"
    message_type: type = type(message)
    for name, known in constants(message_type).items():
        if name.startswith(start) and known == value:
            return name.removeprefix(start)
    return str(value)
