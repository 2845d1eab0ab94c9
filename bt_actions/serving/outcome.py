"""How a run is told to others: codes, the chain of failures, a report for each action. No ROS.

The numbers are those of bt_actions_interfaces (RunTree.action, ActionReport.msg), which say what
they mean.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import NamedTuple

from bt_actions.goals.policy import End, Outcome
from bt_actions.running.report import Report, Row
from bt_actions.utilities.plain_text import clean

SEPARATOR = " / "
"""Between the names of a path."""
_MOST_TEXT = 4000
"""Characters of a chain of failures."""


class Code(enum.IntEnum):
    """Why a run did not succeed."""

    NONE = 0
    UNKNOWN = 20000
    TREE_FAILED = 20001
    CANCELED = 20002
    REPLACED = 20003
    HALTED = 20004
    DEACTIVATED = 20005
    TIMED_OUT = 20006
    EXCEPTION = 20007
    ACTION_FAILED = 20100


OUTCOMES = {outcome: number for number, outcome in enumerate(Outcome, 1)}
ENDS = {
    End.UNKNOWN: 0,
    End.SUCCEEDED: 1,
    End.ABORTED: 2,
    End.CANCELED: 3,
    End.NEVER_STARTED: 4,
    End.SERVER_GONE: 5,
}


class Ending(enum.Enum):
    """The ways to end a run before its time, with the code and the words of each."""

    CANCELED = (Code.CANCELED, "a client canceled it")
    REPLACED = (Code.REPLACED, "a newer goal replaced it")
    HALTED = (Code.HALTED, "it was halted")
    DEACTIVATED = (Code.DEACTIVATED, "its server was deactivated")
    SERVER_ENDS = (Code.DEACTIVATED, "its server ends")


class ActionOutcome(NamedTuple):
    """The end of one action; see ActionReport.msg."""

    path: str
    server: str
    attempts: int
    outcome: int
    end: int
    reason: str
    duration: float
    place: str


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """The answer to a RunTree goal; see RunTree.action."""

    code: int
    message: str = ""
    outputs: str = "{}"
    unaccounted: tuple[str, ...] = ()
    actions: tuple[ActionOutcome, ...] = ()

    @property
    def settled(self) -> bool:
        """Whether the end of every goal below is known."""
        return not self.unaccounted

    @property
    def as_wanted(self) -> bool:
        """Whether it is settled, and succeeded or was ended by somebody."""
        return self.settled and self.code in (Code.NONE, *(each.value[0] for each in Ending))


def outcome_of(
    report: Report,
    *,
    succeeded: bool,
    ending: Ending | None = None,
    error: BaseException | None = None,
    outputs: str = "{}",
    unaccounted: list[str] | None = None,
) -> RunOutcome:
    """Put a run that is over into words and numbers.

    `outputs` is JSON; `unaccounted` has a line for each goal whose end is not known.
    """
    code: int = Code.NONE
    lines = []
    if succeeded:
        pass
    elif error is not None:
        code, lines = Code.EXCEPTION, [clean(str(error))]
    elif ending is not None:
        code, lines = ending.value[0], [ending.value[1]]
    else:
        code, lines = _failure(report)
    left = list(unaccounted or ())
    if left:
        code = Code.UNKNOWN if succeeded else code
        lines += [f"may still be running: {each}" for each in left]
    return RunOutcome(
        int(code),
        "\n".join(lines)[:_MOST_TEXT],
        outputs,
        tuple(left),
        tuple(_action(report, row) for row in report.rows),
    )


def _failure(report: Report) -> tuple[int, list[str]]:
    """Return the first action that is to blame, and the chain of failures, first cause first."""
    culprits = report.culprits()
    chain = sorted(culprits, key=lambda each: each.row is None)
    code: int = Code.TREE_FAILED
    for each in chain:
        if each.row is not None and each.row.outcome is not None:
            code = Code.ACTION_FAILED + OUTCOMES[each.row.outcome]
            break
    lines = []
    for each in chain:
        said = each.message
        if each.row is not None and each.row.outcome is not None:
            said = f"{each.row.outcome}: {each.row.reason or said}"
        place = f" ({each.place})" if each.place else ""
        lines.append(f"{SEPARATOR.join(each.path)}: {said or 'failed'}{place}")
    return code, lines or ["the tree failed"]


def _action(report: Report, row: Row) -> ActionOutcome:
    return ActionOutcome(
        SEPARATOR.join(row.path),
        row.server,
        row.attempts,
        0 if row.outcome is None else OUTCOMES[row.outcome],
        ENDS[End.UNKNOWN if row.end is None else row.end],
        row.reason,
        row.seconds(report.now),
        row.place,
    )
