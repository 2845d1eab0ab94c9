"""The outcome of a run for others: its code, its reason, a report for each action. No ROS.

The numbers are those of bt_actions_interfaces (RunTree.action, ActionReport.msg), which define
them.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass

from py_trees.common import Status

from bt_actions.goals.policy import End, Outcome
from bt_actions.story.actions import ActionStory
from bt_actions.story.state import State
from bt_actions.story.why import why_text
from bt_actions.utilities.plain_text import clean

SEPARATOR = " / "
"""The text between the names of a path."""
_MOST_TEXT = 4000
"""Characters of an error_msg."""


class Code(enum.IntEnum):
    """The reason why a run did not succeed, as a number."""

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
ENDS = {End.UNKNOWN: 0} | {end: at for at, end in enumerate(End, 1) if end is not End.UNKNOWN}


class Ending(enum.Enum):
    """The ways to end a run before its time, with the code and the words of each."""

    CANCELED = (Code.CANCELED, "a client canceled it")
    REPLACED = (Code.REPLACED, "a newer goal replaced it")
    HALTED = (Code.HALTED, "it was halted")
    DEACTIVATED = (Code.DEACTIVATED, "its server was deactivated")
    SERVER_ENDS = (Code.DEACTIVATED, "its server ends")


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """The answer to a RunTree goal; see RunTree.action."""

    code: int
    why: str = ""
    """The reason of a failure; the first line has the root cause."""
    outputs: str = "{}"
    unaccounted: tuple[str, ...] = ()
    actions: tuple[ActionStory, ...] = ()
    at: float = 0.0
    """The moment of the run's end, in seconds on the steady clock."""
    recording: str = ""
    """``HOST:PATH`` of the recording of a run that did not succeed, or ""."""

    @property
    def message(self) -> str:
        """The reason of a failure, and the goals that may still run."""
        left = [f"may still be running: {each}" for each in self.unaccounted]
        return "\n".join([*filter(None, [self.why]), *left])[:_MOST_TEXT]

    @property
    def settled(self) -> bool:
        """Whether the end of every goal below is known."""
        return not self.unaccounted

    @property
    def as_wanted(self) -> bool:
        """Whether the run is settled, and succeeded or was ended on request."""
        return self.settled and self.status is not Status.FAILURE

    @property
    def status(self) -> Status:
        """The status of the tree; INVALID where the run was ended on request."""
        if self.code in (Code.NONE, Code.UNKNOWN):
            return Status.SUCCESS
        on_request = self.code in [each.value[0] for each in Ending]
        return Status.INVALID if on_request else Status.FAILURE


def outcome_of(
    state: State,
    *,
    succeeded: bool,
    ending: Ending | None = None,
    error: BaseException | None = None,
    outputs: str = "{}",
    unaccounted: Iterable[str] = (),
) -> RunOutcome:
    """Put a run that is over into words and numbers.

    `outputs` is JSON; `unaccounted` has a line for each goal whose end is not known.
    """
    left = tuple(unaccounted)
    code: int
    if succeeded:
        code, why = Code.UNKNOWN if left else Code.NONE, ""
    elif error is not None:
        is_told = state.finished is not None and state.finished.error
        code, why = Code.EXCEPTION, why_text(state) if is_told else clean(str(error))
    elif ending is not None:
        code, why = ending.value
    else:
        code, why = _code_of(state), why_text(state) or "the tree failed"
    return RunOutcome(int(code), why, outputs, left, tuple(state.actions), state.latest)


def _code_of(state: State) -> int:
    """Return the code of the first action that is to blame, or TREE_FAILED."""
    for each in state.failures:
        if each.action is not None and each.action.outcome is not None:
            return Code.ACTION_FAILED + OUTCOMES[each.action.outcome]
    return Code.TREE_FAILED
