"""`bt-actions diff`: what is told of two runs, and with which exit code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from bt_actions.cli.program import main
from bt_actions.events import Event, GoalChanged, RunBegan
from bt_actions.recording.folders import held
from tests.support.recordings import record
from tests.support.virtual_runs import NIGHT, run_of

Recorded = Callable[[list[Event]], str]


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    """Record events; return the path of the recording."""
    return lambda events: str(record(events, tmp_path))


def changed(events: list[Event], **fields: object) -> list[Event]:
    """The events with another beginning."""
    return [
        replace(each, **fields) if isinstance(each, RunBegan) else each  # type: ignore[arg-type]
        for each in events
    ]


def began(events: list[Event]) -> RunBegan:
    return next(each for each in events if isinstance(each, RunBegan))


def lines_of(capsys: pytest.CaptureFixture[str]) -> list[str]:
    answer = capsys.readouterr()
    assert answer.err == ""
    return answer.out.splitlines()


def test_two_runs_that_part_are_told_with_what_was_the_same_and_both_sides(
    recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = run_of(NIGHT), run_of(NIGHT, "move_robot:12:abort")
    assert main(["diff", recorded(a), recorded(b)]) == 1
    lines = lines_of(capsys)
    ids = [began(each).run_id[:8] for each in (a, b)]
    assert lines[0].startswith(f"A  {ids[0]}  night  20")
    assert lines[0].endswith("  SUCCESS after 8.37 s")
    assert lines[1].startswith(f"B  {ids[1]}  night  20")
    assert lines[1].endswith("  FAILURE after 7.96 s")
    home = "Shift / Go home / Straight home / Home in time / Home"
    sends = "attempt 1: sends {distance: 0.0}"
    assert lines[2] == f"the same up to there: 96 outcomes, the last of {home}: {sends}"
    assert lines[3] == f"the runs part at {home}"
    assert lines[4].startswith("  A  8.27 s  attempt 1: SUCCEEDED; goal {distance: 0.0}; result")
    assert lines[5].startswith("  B  7.96 s  attempt 1: ABORTED: aborted by /move_robot; goal")
    assert len(lines) == 6


def test_two_runs_that_do_not_part_are_no_failure(
    recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["diff", recorded(run_of(NIGHT)), recorded(run_of(NIGHT, speed=9.0))]) == 0
    assert lines_of(capsys)[2:] == ["the runs do not part: 106 outcomes are the same"]


def test_results_may_differ_by_the_tolerance_that_is_given(
    recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    night = run_of(NIGHT)
    other = [
        replace(each, result={**each.result, "final_pose": each.result["final_pose"] + 0.02})
        if isinstance(each, GoalChanged)
        and isinstance(each.result, dict)
        and "final_pose" in each.result
        else each
        for each in changed(night, run_id="a" * 32)
    ]
    runs = recorded(night), recorded(other)
    assert main(["diff", "--tolerance", "0.03", *runs]) == 0
    assert main(["diff", *runs]) == 1
    assert "attempt 1: SUCCEEDED; goal {distance: 0.5}; result {final" in lines_of(capsys)[-1]


@pytest.mark.parametrize(
    ("a", "b", "told"),
    [
        ({"to": 2.0}, {"to": 3.0}, ["input to: A 2.0 | B 3.0"]),
        ({"to": 2.0, "x": "a"}, {"to": 2.0}, ["input x: A 'a' | B 'not there'"]),
        ({"to": float("nan")}, {"to": float("nan")}, []),
        ({"to": "•••"}, {"to": 2.0}, []),
    ],
)
def test_inputs_that_differ_are_told_first(
    recorded: Recorded,
    capsys: pytest.CaptureFixture[str],
    a: Mapping[str, object],
    b: Mapping[str, object],
    told: list[str],
) -> None:
    night = run_of(NIGHT)
    runs = [recorded(changed(night, inputs=a, run_id="a" * 32)), recorded(changed(night, inputs=b))]
    assert main(["diff", *runs]) == 0
    assert lines_of(capsys)[2:-1] == told


def test_where_the_runs_were_is_told_where_it_differs(
    recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    night = run_of(NIGHT)
    a = {"node": "/night", "host": "robot7", "simulation": "--sim --speed 10"}
    b = {"node": "/night", "host": "robot8"}
    runs = [
        recorded(changed(night, where=a, run_id="a" * 32)),
        recorded(changed(night, where=b)),
    ]
    assert main(["diff", *runs]) == 0
    assert lines_of(capsys)[2:-1] == [
        "host: A robot7 | B robot8",
        "simulation: A --sim --speed 10 | B none",
    ]


@pytest.mark.parametrize(
    ("a", "b", "told"),
    [
        (
            {"t.yaml": "tree: t\n  x: 1\n"},
            {"t.yaml": "tree: t\n  x: 2\n"},
            ["file t.yaml, line 2: A x: 1 | B x: 2"],
        ),
        ({"t.yaml": "a\nb\n"}, {"t.yaml": "a\n"}, ["file t.yaml, line 2: A b | B "]),
        (
            {"t.yaml": "a\n"},
            {"t.yaml": "a\n", "u.yaml": "b\n"},
            ["file u.yaml: only B has read it"],
        ),
        ({"t.yaml": "a\n"}, {"elsewhere/t.yaml": "a\n"}, []),
    ],
)
def test_tree_files_that_differ_are_told(
    recorded: Recorded,
    capsys: pytest.CaptureFixture[str],
    a: Mapping[str, str],
    b: Mapping[str, str],
    told: list[str],
) -> None:
    night = run_of(NIGHT)
    runs = [
        recorded(changed(night, sources=a, run_id="a" * 32)),
        recorded(changed(night, sources=b)),
    ]
    assert main(["diff", *runs]) == 0
    assert [line.rstrip() for line in lines_of(capsys)[2:-1]] == [each.rstrip() for each in told]


def test_a_run_that_has_not_finished_says_why_it_did_nothing_more(
    tmp_path: Path, recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    night = run_of(NIGHT)
    killed = record(changed(night, run_id="a" * 32)[:100], tmp_path, killed=0.0)
    assert main(["diff", recorded(night), str(killed)]) == 1
    lines = lines_of(capsys)
    assert "  NOT FINISHED after " in lines[1]
    assert lines[-1] == "  B  nothing more: its process was killed"
    with held(killed, alone=True):
        assert main(["diff", recorded(changed(night, run_id="b" * 32)), str(killed)]) == 1
    assert lines_of(capsys)[-1] == "  B  nothing yet: the run goes on"


def test_what_a_run_says_gives_the_terminal_no_commands(
    recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    night = run_of(NIGHT)
    inputs = {"to\x1b[2J": "x\x1b[31m"}
    runs = [recorded(changed(night, run_id="a" * 32)), recorded(changed(night, inputs=inputs))]
    assert main(["diff", *runs]) == 0
    assert "\x1b" not in "".join(lines_of(capsys))


def test_runs_of_two_trees_and_runs_that_are_not_there_are_bad_input(
    recorded: Recorded, capsys: pytest.CaptureFixture[str]
) -> None:
    night = recorded(run_of(NIGHT))
    patrol = recorded(changed(run_of(NIGHT), tree="patrol"))
    for runs, said in (
        ([night, patrol], "these are runs of two trees, night and patrol"),
        ([night, f"{night}.gone.mcap"], "is no recording"),
        (["night", night], "no run is recorded yet"),
    ):
        assert main(["diff", *runs]) == 2
        answer = capsys.readouterr()
        assert said in answer.err
        assert answer.out == ""
