"""`bt-actions stats`: what is told of each action over all recorded runs."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from bt_actions.cli.driving import recorded as module
from bt_actions.cli.program import main
from bt_actions.events import Event
from tests.cli.test_diff import changed
from tests.support.recordings import record
from tests.support.virtual_runs import NIGHT, run_of


@pytest.fixture(scope="module")
def nights() -> list[list[Event]]:
    """A shift that went well, and one whose last move was aborted."""
    return [run_of(NIGHT), run_of(NIGHT, "move_robot:12:abort")]


@pytest.fixture
def files(nights: list[list[Event]]) -> list[Path]:
    """The recordings of these shifts, the only ones of this user."""
    return [record(each) for each in nights]


@pytest.mark.usefixtures("files")
def test_each_action_is_told_with_its_outcomes_and_the_seconds_of_each_phase(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["stats"]) == 0
    answer = capsys.readouterr()
    assert answer.err == ""
    lines = answer.out.splitlines()
    assert lines[0] == "2 runs"
    move = lines[lines.index("/move_robot (MoveRobot), in 2 runs") :]
    assert move[1:3] == [
        "  24 attempts, 24 goals sent, 96% succeeded",
        "  SUCCEEDED 23, ABORTED 1",
    ]
    assert re.fullmatch(r" +goals +p50 +p95 +longest", move[3])
    assert re.fullmatch(r"  executing +24( +\d+\.\d\d s){3}", move[-1])
    assert [line.split("  ")[1] for line in move[4:]] == [
        "waiting for the server",
        "waiting for acceptance",
        "executing",
    ]


@pytest.mark.usefixtures("files")
def test_the_same_is_told_as_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stats", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["runs"], told["left_out"]) == (2, 0)
    grip, move = told["actions"]
    assert (grip["server"], grip["type"]) == ("/gripper_control", "Gripper")
    seconds = move.pop("seconds")
    assert move == {
        "server": "/move_robot",
        "type": "MoveRobot",
        "runs": 2,
        "attempts": 24,
        "goals_sent": 24,
        "success": pytest.approx(23 / 24),
        "outcomes": {"SUCCEEDED": 23, "ABORTED": 1},
    }
    assert set(seconds) == {"waiting_for_server", "sending", "executing"}
    assert seconds["executing"]["goals"] == 24
    assert 0 < seconds["executing"]["p50"] <= seconds["executing"]["p95"]
    assert seconds["executing"]["p95"] <= seconds["executing"]["longest"] < 1.0


def test_runs_of_one_tree_are_counted_alone(
    nights: list[list[Event]], files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    record(changed(nights[0], tree="day", run_id="a" * 32))
    assert main(["stats", "--json", "--tree", "day"]) == 0
    assert json.loads(capsys.readouterr().out)["runs"] == 1
    assert main(["stats", "--tree", "nigth"]) == 2
    assert "did you mean 'night'?" in capsys.readouterr().err


@pytest.mark.usefixtures("files")
def test_runs_in_a_simulation_are_counted_for_themselves_and_else_left_out(
    nights: list[list[Event]], capsys: pytest.CaptureFixture[str]
) -> None:
    where = {"simulation": "--sim --speed 10 --fault move_robot:12:abort"}
    record(changed(nights[1], where=where, run_id="a" * 32))
    heads = []
    for words in (["stats"], ["stats", "--simulated"]):
        assert main(words) == 0
        heads.append(capsys.readouterr().out.splitlines()[0])
    assert heads == [
        "2 runs; 1 in a simulation left out (--simulated counts these alone)",
        "1 run; 2 in the world left out",
    ]
    assert main(["stats", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["runs"], told["left_out"]) == (2, 1)


def test_a_damaged_file_is_named_and_passed_over(
    files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    files[1].write_bytes(b"noise")
    assert main(["stats", "--json"]) == 0
    answer = capsys.readouterr()
    assert json.loads(answer.out)["runs"] == 1
    assert answer.err.startswith(f"bt-actions stats: passed over: {files[1]} is no recording")
    assert answer.err.count("\n") == 1


def test_damaged_messages_are_counted_and_the_rest_is_read(
    files: list[Path], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    data = files[0].read_bytes()
    monkeypatch.setattr("bt_actions.recording.reading.from_line", None)
    assert main(["stats", "--json"]) == 0
    answer = capsys.readouterr()
    assert data
    damage = rf"{files[0]}: \d+ parts of the recording \(\d+ bytes\) are damaged"
    assert re.search(damage, answer.err)


def test_without_a_run_there_is_nothing_to_count(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stats"]) == 2
    assert "no run is recorded yet" in capsys.readouterr().err


class Standing:
    """A standard error that is a terminal, or is none."""

    def __init__(self, *, is_terminal: bool) -> None:
        self.text, self._is_terminal = "", is_terminal

    def isatty(self) -> bool:
        return self._is_terminal

    def write(self, text: str) -> None:
        self.text += text

    def flush(self) -> None:
        """Nothing is held back."""


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_terminal_shows_how_far_reading_is_and_keeps_nothing_of_that(
    monkeypatch: pytest.MonkeyPatch, is_terminal: bool
) -> None:
    standing, now = Standing(is_terminal=is_terminal), [0.0]
    monkeypatch.setattr("sys.stderr", standing)
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    with module.progress("of 9 runs read") as count:
        for number in range(4):
            count(number)
            now[0] += 0.3
    assert standing.text == ("\r2 of 9 runs read\r\x1b[K" if is_terminal else "")
