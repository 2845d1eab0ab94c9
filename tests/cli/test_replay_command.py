"""`bt-actions replay`: a recorded run in a terminal, and as lines where there is none."""

from __future__ import annotations

import io
import json
import os
import random
import re
import sys
import termios
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import pytest
from py_trees.common import Status

from bt_actions.cli.commands import replay as command
from bt_actions.cli.driving.player import Player
from bt_actions.cli.program import main
from bt_actions.cli.views.json_lines import JsonView
from bt_actions.cli.views.lines import LineView
from bt_actions.cli.views.played import PlayedView
from bt_actions.events import Event, RunBegan
from bt_actions.goals.policy import Outcome
from bt_actions.recording.folders import held
from bt_actions.recording.reading import Recording
from bt_actions.recording.tape import Tape
from bt_actions.recording.writing import RunWriter
from bt_actions.story.state import State
from tests.cli.test_views import Screen, feed
from tests.support.every_kind import every_kind
from tests.support.recordings import record
from tests.support.stories import state_of
from tests.support.terminal import ROWS, Terminal
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.virtual_runs import NIGHT, run_of


@pytest.fixture(scope="module")
def night() -> list[Event]:
    """The events of a shift that fails at its end."""
    return run_of(NIGHT, "move_robot:12:abort")


@pytest.fixture
def first(night: list[Event], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The recording of that shift, the only one of this user."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return record(night)


# In a terminal


def modes(terminal: Terminal) -> object:
    return termios.tcgetattr(terminal._end)


@pytest.mark.usefixtures("first")
def test_a_run_is_played_and_the_terminal_is_as_it_was_before(
    terminal: Callable[..., Terminal], tmp_path: Path
) -> None:
    replay = terminal("replay", "night", "--speed", "0.01")
    before = modes(replay)
    replay.until("0:00.0 of 0:08.0  ×0.01")
    assert replay.screen.display[-1].startswith("─")
    replay.type(b"n")
    replay.until("✗ Grasp  /gripper_control  UNEXPECTED_RESULT (attempt 3)")
    replay.until("paused")
    replay.type(b"\x1b[D\x1b[C")
    replay.until("▶ Each station")
    replay.type(b"nnn")
    replay.until("no later failure")
    replay.type(b"+ ")
    replay.until("×1 ")
    replay.type(b"\x1b[A")
    replay.until("FAILURE after 7.96 s")
    replay.until("ABORTED: aborted by /move_robot")
    assert modes(replay) != before
    replay.type(b"q")
    assert replay.wait() == 0
    assert modes(replay) == before
    assert replay.raw.count(b"\x1b[?1049h") == replay.raw.count(b"\x1b[?1049l") == 1
    ending = replay.raw.rpartition(b"\x1b[?25l")[2]
    assert ending.endswith(b"\x1b[?25h\x1b[?1049l"), "the cursor is back, and what stood there"


@pytest.mark.usefixtures("first")
def test_ctrl_c_ends_it_and_leaves_the_terminal_as_it_was(
    terminal: Callable[..., Terminal],
) -> None:
    replay = terminal("replay")
    before = modes(replay)
    replay.until(" of 0:08.0")
    suspends = termios.tcgetattr(replay._end)[6][termios.VSUSP]
    assert suspends == b"\0", "a shell would draw into it after Ctrl-Z"
    replay.type(b"\x03")
    assert replay.wait() == 130
    assert modes(replay) == before
    assert replay.raw.endswith(b"\x1b[?25h\x1b[?1049l")


@pytest.mark.usefixtures("first")
def test_a_closed_terminal_ends_it(terminal: Callable[..., Terminal]) -> None:
    replay = terminal("replay")
    replay.until(" of 0:08.0")
    os.close(replay._end)
    _, status = os.waitpid(replay.pid, 0)
    replay.code = os.waitstatus_to_exitcode(status)
    replay._end = os.open(os.devnull, os.O_RDONLY)
    assert replay.code == 129


def test_a_terminal_that_is_gone_while_it_is_drawn_on_ends_it(
    first: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    master, slave = os.openpty()
    monkeypatch.setattr(sys, "stdin", os.fdopen(slave))
    monkeypatch.setattr(PlayedView, "show", Mock(side_effect=OSError("gone")))
    assert command._play(Tape(Recording(first)), Screen(24).console, 1.0) == 129
    os.close(master)


@pytest.mark.usefixtures("first")
@pytest.mark.parametrize(("option", "name"), [((), "dumb"), (("--plain",), "xterm-256color")])
def test_a_dumb_terminal_gets_lines_and_so_does_who_wants_it_plain(
    option: tuple[str, ...], name: str, terminal: Callable[..., Terminal]
) -> None:
    replay = terminal("replay", *option, TERM=name)
    assert replay.wait() == 0
    assert b"\x1b" not in replay.raw
    assert any("FAILURE after 7.96 s" in line for line in replay.lines)


@pytest.mark.parametrize("height", [1, 4, 12, ROWS, 80])
def test_a_frame_is_the_same_however_the_player_came_there_and_fits(
    first: Path, height: int
) -> None:
    tape, screen = Tape(Recording(first)), Screen(height)
    view = PlayedView(screen.console)
    on = Player(tape)
    frames = list[list[str]]()

    def frame(player: Player) -> list[str]:
        view.show(player)
        return str(view._drawn).split("\n")

    on.is_paused = True
    for _ in range(41):
        frames.append(frame(on))
        on.is_paused = False
        on.let_pass(0.2)
        on.is_paused = True
    assert len({str(each) for each in frames}) > (20 if height > 4 else 5)
    assert all(len(each) == max(1, height) for each in frames)
    assert all(len(line) <= 79 for each in frames for line in each)
    for number in random.Random(1).choices(range(41), k=20):
        elsewhere = Player(tape)
        elsewhere.let_pass(number * 0.2)
        elsewhere.is_paused = True
        assert frame(elsewhere) == frames[number]
    view.close()


# As lines


@pytest.mark.usefixtures("first")
@pytest.mark.parametrize("options", [(), ("--verbose",), ("--json",)])
def test_without_a_terminal_it_is_what_the_run_itself_has_written(
    night: list[Event], capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    out, state = io.StringIO(), State()
    is_json, is_verbose = "--json" in options, "--verbose" in options
    view = JsonView(state, out) if is_json else LineView(state, out, verbose=is_verbose)
    feed(state, view, *night)
    view.finish()
    assert main(["replay", *options]) == 0
    assert to_the_microsecond(capsys.readouterr().out) == to_the_microsecond(out.getvalue())


def to_the_microsecond(text: str) -> str:
    return re.sub(r'"wall": ([\d.]+)', lambda found: f"{float(found[1]):.6f}", text)


def test_the_run_of_a_killed_process_ends_where_its_recording_does(
    night: list[Event], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = record(night[:200], tmp_path, killed=0.0)
    assert main(["replay", str(first)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "the recording ends here: its process was killed" in lines
    assert any(line.startswith("NOT FINISHED after ") for line in lines)
    with held(first, alone=True):
        assert main(["replay", str(first)]) == 0
    assert "the recording ends here: the run goes on\n" in capsys.readouterr().out
    assert main(["replay", "--json", str(first)]) == 0
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (last["event"], last["status"], last["exit_code"]) == ("finished", "INVALID", None)
    assert main(["replay", str(first)]) == 0, "the recording is finished now"
    assert capsys.readouterr().out.splitlines() == lines


def test_events_that_are_missing_are_told_and_what_follows_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    events, first = every_kind(rounds=60), tmp_path / "run.mcap"
    began = next(each for each in events if isinstance(each, RunBegan))
    writer = RunWriter(first, began, size=10_000, files=3)
    for event in events:
        writer.add(event)
        writer.flush()
    writer.close()
    assert main(["replay", str(first)]) == 0
    out = capsys.readouterr().out
    missing = re.findall(r"^(\d+) events are missing here$", out, re.MULTILINE)
    assert [int(each) > 100 for each in missing] == [True, False]
    assert out.rstrip().endswith("not accounted for: Move on /move")
    assert main(["replay", "--json", str(first)]) == 0
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert told[-1]["event"] == "finished"
    assert len(told[-1]["dealt_with"]) == len(state_of(events).dealt_with)
    assert sum("are missing here" in each.get("text", "") for each in told) == 2


@pytest.mark.parametrize("options", [(), ("--json",)])
def test_what_only_damaged_events_explain_is_passed_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    leaf, stranger = FakeAction("Move"), FakeNode("Stranger", id=99)
    story = Story(FakeNode("Root", [leaf]))
    unheard = [
        story.verdict(leaf, Outcome.ABORTED, "of a goal that nobody heard of"),
        story.node(stranger, Status.FAILURE),
        story.goal(stranger, "EXECUTING"),
    ]
    first = record([story.began, *unheard, *story.fail(leaf, "a fault")], tmp_path)
    assert main(["replay", str(first), *options]) == 0
    out = capsys.readouterr().out
    assert "FAILURE" in out
    assert "Stranger" not in out


def test_a_run_that_is_not_there_or_cannot_be_read_is_bad_input(
    first: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    noise, empty = tmp_path / "noise.mcap", tmp_path / "empty.mcap"
    noise.write_bytes(b"x" * 1000)
    RunWriter(empty, next(each for each in every_kind() if isinstance(each, RunBegan))).close()
    for run, said in {
        "nigt": "did you mean 'night'?",
        str(noise): "noise.mcap is no recording",
        str(empty): "empty.mcap holds no run",
        str(tmp_path / "gone.mcap"): "is no recording",
    }.items():
        assert main(["replay", run]) == 2, run
        answer = capsys.readouterr()
        assert said in answer.err
        assert answer.err.count("\n") == 1
        assert answer.out == ""
