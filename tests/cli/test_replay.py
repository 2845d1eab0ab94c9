"""The stored events of a run give what the run itself gave: lines, table, JSON and exit code."""

from __future__ import annotations

import io
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bt_actions.cli.driving.drive import code_of
from bt_actions.cli.views.json_lines import JsonView
from bt_actions.cli.views.lines import LineView
from bt_actions.story.state import State
from bt_actions.story.words import last_words
from tests.support.processes import Process
from tests.support.recorded_run import replay

SIM = ["run", "pick_and_place", "--sim", "--speed", "10"]
RUNS: dict[str, list[str]] = {
    "success": SIM,
    "retried": [*SIM, "--fault", "move_robot:2:abort"],
    "failure": [*SIM, "--fault", "move_robot:*:abort"],
    "refused": [*SIM, "--fault", "gripper_control:*:reject"],
    "expect": [*SIM, "--set", "pick_at=1.0"],
    "timeout": [*SIM[:-1], "1", "--timeout", "1"],
    "unknown": [*SIM, "--fault", "move_robot:1:reject_cancel", "--fault", "move_robot:1:stall"],
    "complaint": [*SIM, "--check-part", "9.0"],
    "nobody": ["run", "pick_and_place", "--timeout", "3"],
    "interrupted": [*SIM[:-1], "0.2"],
}


@pytest.fixture
def recorded(start_program: Callable[..., Process], tmp_path: Path) -> Callable[..., Process]:
    return lambda *arguments: start_program(
        "-m", "tests.support.recorded_run", str(tmp_path / "events"), *arguments
    )


@pytest.mark.parametrize(
    ("run", "form"),
    [*((run, "lines") for run in RUNS), *((run, "json") for run in ("failure", "unknown"))],
)
def test_a_run_is_the_same_from_its_events(
    recorded: Callable[..., Process], tmp_path: Path, run: str, form: str
) -> None:
    process = recorded(*RUNS[run], *(["--json"] if form == "json" else []))
    if run == "interrupted":
        process.line("EXECUTING" if form == "json" else "executing", within=30.0)
        process.send(signal.SIGINT)
    code = process.wait(within=60.0)
    state, out = State(), io.StringIO()
    view: Any = JsonView(state, out) if form == "json" else LineView(state, out)
    replay(tmp_path / "events", view, state)
    assert out.getvalue().splitlines() == process.lines
    assert state.ended is not None
    assert state.ended.exit_code == code
    assert code_of(state, complaint=state.ended.complaint) == code
    again, once_more = State(), io.StringIO()
    replay(tmp_path / "events", LineView(again, once_more), again)
    assert last_words(again, 72) == last_words(state, 72)
