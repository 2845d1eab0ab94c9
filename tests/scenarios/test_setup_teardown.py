"""Setup and teardown: create, run, shut down, and nothing is left.

Each scenario is a process of its own, so that all it holds can be counted, and all it says.
"""

from __future__ import annotations

import json
import time

import pytest

from tests.scenarios.conftest import Launch
from tests.support.cycles import patience
from tests.support.reliability import Record

MEMORY = 0.05
"""MB that a cycle may hold on to: a tenth of what one leaked thread or context holds."""
ONE_ARENA = {"MALLOC_ARENA_MAX": "1"}
"""glibc gives threads that get in each other's way an arena each, which grows at first. Growth with
one is a third (12 runs); 4 and 8 MB in 20 cycles were seen with more, where 200 added less."""
ALL_WARNINGS = {"PYTHONWARNINGS": "default,ignore::DeprecationWarning:lark.utils"}
"""Python hides most, such as the ResourceWarning of what was not closed. lark, which rclpy imports,
imports what is deprecated."""
AT_RANDOM = 2
"""Cycles, those that added most, that are not counted: a second participant, say, where its server
did not answer for two seconds."""


@pytest.mark.timeout(600)
@pytest.mark.parametrize("cycles", [20, pytest.param(200, marks=pytest.mark.chaos)])
@pytest.mark.parametrize(
    "how", [pytest.param("own", marks=pytest.mark.chaos), "user", "interrupted"]
)
def test_cycles_in_one_process_leave_nothing(
    how: str, cycles: int, launch: Launch, record: Record
) -> None:
    """Create, run, shut down, so many times in one process; "user": in a user's own context"""
    began = time.monotonic()
    program = launch(
        how,
        str(cycles),
        program=("-m", "tests.support.cycles"),
        environment=ONE_ARENA | ALL_WARNINGS,
    )
    assert program.wait(patience(cycles) + 10.0) == 0, str(program)  # in full: where it hangs
    told = json.loads(program.lines[-1])
    warm, after = told["warm"], told["after"]
    assert program.errors == [], "no warning"
    assert program.lines[:-1] == []
    assert after["threads"] <= warm["threads"]
    assert after["files"] <= warm["files"]
    grown = sum(sorted(told["grown"])[:-AT_RANDOM])
    assert grown < MEMORY * cycles, f"{grown:.2f} MB: {told['grown']}"
    assert told["longest"] < 30.0
    record.took(time.monotonic() - began)
    record.shows = "nothing was sent" if how == "interrupted" else f"{cycles} goals succeeded"
    record.outcome = "no warning, no thread, no file and no memory left behind"
