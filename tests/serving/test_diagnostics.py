"""The level of a tree in the diagnostics."""

from __future__ import annotations

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from bt_actions.serving.catalog import FileState
from bt_actions.serving.diagnostics import TreeStanding, judge
from bt_actions.serving.outcome import Code, RunOutcome

FAILED = RunOutcome(Code.TREE_FAILED, "Never: failed")
HALTED = RunOutcome(Code.HALTED, "it was halted")
NODE_CLOSED = RunOutcome(Code.CANCELED, unaccounted=("Go",))
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


@pytest.mark.parametrize(
    ("standing", "refuses", "level", "message"),
    [
        (TreeStanding("t"), "", OK, "ready"),
        (TreeStanding("t", running=1), "", OK, "running"),
        (TreeStanding("t", last=RunOutcome(Code.NONE)), "", OK, "ready"),
        (TreeStanding("t", last=HALTED), "", OK, "ready"),
        (TreeStanding("t", last=FAILED), "", WARN, "the last run failed: Never: failed"),
        (TreeStanding("t", running=1, last=FAILED), "", OK, "running"),
        (TreeStanding("t", running=1, retrying=True), "", WARN, "an action is tried again"),
        (TreeStanding("t", FileState.KEPT_LAST_GOOD), "", WARN,
         "its file does not check; the last good version is used"),
        (TreeStanding("t", FileState.INVALID), "", ERROR, "its file does not check"),
        (TreeStanding("t", last=NODE_CLOSED), "", ERROR,
         "the last run is not settled: Go may still be running"),
        (TreeStanding("t", running=1, last=NODE_CLOSED), "", ERROR,
         "the last run is not settled: Go may still be running"),
        (TreeStanding("t"), "it is inactive", ERROR, "not serving: it is inactive"),
    ],
)  # fmt: skip
def test_the_worst_that_is_known_of_a_tree_is_told(
    standing: TreeStanding, refuses: str, level: bytes, message: str
) -> None:
    assert judge(standing, refuses) == (level, message)
