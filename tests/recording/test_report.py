"""One text of a recorded run, whatever became of the run, and whatever the file holds."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from bt_actions import load_tree
from bt_actions.events import (
    Event,
    GoalChanged,
    Logged,
    RunBegan,
    RunEnded,
    StopWanted,
)
from bt_actions.goals.policy import End, Outcome
from bt_actions.recording import report as module
from bt_actions.recording.report import markdown, reports, text
from bt_actions.story.bare import stripped
from bt_actions.story.keeping import to_json
from bt_actions.story.why import why
from bt_actions.testing import Simulation, VirtualNetwork, VirtualRunner
from tests.support.every_kind import every_kind
from tests.support.recordings import bytes_of, record
from tests.support.stories import state_of
from tests.support.told_trees import FakeAction, FakeNode, Story

NIGHT = "examples/night/night.yaml"
STATIONS = {"stations": [2.0, 3.125, 4.125], "shelf": 5.125}


def told(first: Path, **options: Any) -> str:
    """The whole text of a report."""
    return "\n".join(text(reports(first, **options)))


def happened(first: Path) -> list[str]:
    """What happened, without times."""
    lines = told(first).partition("what happened\n")[2].splitlines()
    return [re.sub(r"^ +[\d.]+ s  [\d:]+  ", "", line) for line in lines]


@pytest.fixture(scope="module")
def night() -> tuple[list[Event], VirtualRunner]:
    """The events of a shift of 40 nodes that fails at its end."""
    network = VirtualNetwork()
    Simulation(network, faults=["move_robot:12:abort"])
    runner = VirtualRunner(load_tree(NIGHT, STATIONS), network)
    assert runner.run() is Status.FAILURE
    return list(runner.events), runner


@pytest.fixture
def leaf() -> FakeNode:
    return FakeAction("Move", attempts=3)


@pytest.fixture
def story(leaf: FakeNode) -> Story:
    return Story(FakeNode("Deliver", [leaf]))


def failing(story: Story, leaf: FakeNode) -> list[Event]:
    """A run that fails at its only leaf."""
    return [
        story.began,
        *story.fail(leaf, "a fault"),
        story.node(story.root, Status.FAILURE),
        story.finish(Status.FAILURE),
        RunEnded(story._next(), 1),
    ]


# What it tells


def test_a_report_of_a_failed_run_tells_the_cause_as_the_run_did(
    night: tuple[list[Event], VirtualRunner], tmp_path: Path
) -> None:
    events, runner = night
    said = told(record(events, tmp_path))
    assert said.startswith("night: FAILURE after ")
    for line in why(runner.state):
        assert f"\n  {line}\n" in said


def test_a_report_has_the_inputs_the_versions_the_files_and_the_actions(
    night: tuple[list[Event], VirtualRunner], tmp_path: Path
) -> None:
    events, _ = night
    said = told(record(events, tmp_path))
    assert "inputs stations=[2.0, 3.125, 4.125], shelf=5.125" in said
    assert "py_trees 2" in said
    assert f"tree files {NIGHT}" in said
    assert "To the station  /move_robot       3 in 3 visits  SUCCEEDED" in said
    assert isinstance(events[0], RunBegan)
    assert f"run {events[0].run_id}" in said


def test_a_report_says_where_the_run_was_and_what_stood_in_for_the_world(tmp_path: Path) -> None:
    first = record(every_kind(), tmp_path)
    simulated = "  in a simulation: --sim --speed 2\n  node /all, domain 7"
    assert f"{simulated}, host robot7\n" in told(first)
    assert f"{simulated}\n" in told(first, values=False)


def test_nobody_is_sent_to_cancel_what_ran_in_the_simulation_of_a_killed_process(
    story: Story, leaf: FakeNode, tmp_path: Path
) -> None:
    story.began = replace(story.began, where={"simulation": "--sim --speed 1"})
    events = [story.began, story.goal(leaf, "EXECUTING"), story.node(leaf, Status.RUNNING)]
    said = told(record(events, tmp_path, killed=2.0))
    assert "    Move: executing on move_robot for " in said
    assert "cleanup" not in said


def test_what_happened_has_a_line_for_each_thing_that_somebody_cares_for(
    night: tuple[list[Event], VirtualRunner], tmp_path: Path
) -> None:
    lines = happened(record(night[0], tmp_path))
    for line in (
        "server    /gripper_control comes in sight",
        "goal      To the start: sent to /move_robot: {distance: 0.5}",
        "FAILURE   $shelf < 0.0: $shelf < 0.0 is false: $shelf is 5.125",
        "round     Each station: item 2 of 3: 3.125",
        "variable  Each station: $at = 3.125",
        "log       Somebody has to sort station 1",
        "SUCCESS   Look around: 2 of 2 succeeded, 0 failed",
        "FAILURE   Shift",
    ):
        assert line in lines, lines
    again = [line for line in lines if "Grasp: attempt 1 of 3: UNEXPECTED_RESULT" in line]
    assert len(again) == 2
    assert all(line.endswith("; again in 0.3 s") for line in again)
    assert not [line for line in lines if "RUNNING" in line]


@pytest.mark.parametrize("values", [True, False], ids=["with values", "without"])
def test_a_node_that_was_left_out_is_told_as_such(tmp_path: Path, values: bool) -> None:
    tree = tmp_path / "tree.yaml"
    tree.write_text(
        "tree: t\ninputs: {near: {type: bool, default: false}}\nroot:\n  fallback: F\n  children:\n"
        "    - {log: Here, only_if: $near}\n    - {success: There}\n",
        encoding="utf-8",
    )
    runner = VirtualRunner(load_tree(tree), VirtualNetwork())
    runner.run()
    (report,) = reports(record(runner.events, tmp_path), values=values)
    lines = [str(line)[12:] for line in report.lines()]
    why = ": $near is false" if values else ""
    assert [line for line in lines if f"left out  log Here{why}" in line], lines
    assert not [line for line in lines if "FAILURE" in line]


def test_each_line_has_seconds_since_the_beginning_and_the_time_of_the_day(
    story: Story, leaf: FakeNode, tmp_path: Path
) -> None:
    first = record(failing(story, leaf), tmp_path)
    (report,) = reports(first)
    line = next(each for each in report.lines() if not isinstance(each, str))
    assert line.seconds == 1.5
    assert str(line).startswith("     1.50 s  ")
    assert str(line)[12:].split()[0] == module.clock(1e9 + 101.5)


def test_names_that_occur_twice_are_told_with_their_path(tmp_path: Path) -> None:
    leaves = [FakeAction("Move"), FakeAction("Move")]
    rooms = [FakeNode("Left", [leaves[0]]), FakeNode("Right", [leaves[1]])]
    story = Story(FakeNode("Both", rooms))
    events = [story.began, *story.succeed(leaves[0]), *story.fail(leaves[1], "stuck")]
    lines = happened(record(events, tmp_path, killed=0.0))
    assert "SUCCESS   Left / Move: SUCCEEDED" in lines
    assert "FAILURE   Right / Move: ABORTED: stuck" in lines


def test_a_tick_that_lasted_is_told(story: Story, leaf: FakeNode, tmp_path: Path) -> None:
    events = [story.began, story.lasts(leaf, 1.0), story.lasts(leaf, 7.25, is_over=True)]
    assert happened(record(events, tmp_path, killed=0.0)) == [
        "tick      Move: its tick lasts, by now for 1.0 s",
        "tick      Move: its tick has taken 7.2 s",
    ]


def test_a_goal_that_outlives_its_leaf_is_told_of_at_its_end(
    story: Story, leaf: FakeNode, tmp_path: Path
) -> None:
    canceled = {"outcome": Outcome.CANCELED, "end": End.CANCELED}
    events = [
        story.began,
        story.goal(leaf, "SENDING"),
        story.node(leaf, Status.RUNNING),
        StopWanted(story._next(), "SIGINT", "interrupted by SIGINT"),
        story.node(leaf, Status.INVALID),
        story.goal(leaf, "DONE", **canceled),
    ]
    lines = happened(record(events, tmp_path, killed=0.0))
    assert lines[-3:] == [
        "stop      interrupted by SIGINT (SIGINT)",
        "STOPPED   Move",
        "goal      Move: the goal that was left ended CANCELED",
    ]


def test_a_long_run_is_shortened_and_says_by_how_much(
    story: Story, leaf: FakeNode, tmp_path: Path
) -> None:
    rounds = [Logged(story._next(), leaf.id, "info", f"n{number}") for number in range(1000)]
    first = record([story.began, *rounds], tmp_path, killed=0.0)
    said = told(first)
    assert "... 800 lines are left out here (--full has them)" in said
    assert "n49\n" in said
    assert "n50\n" not in said
    assert "n850\n" in said
    full = "\n".join(text(reports(first), full=True))
    assert [f"n{number}\n" in f"{full}\n" for number in range(1000)] == [True] * 1000


# Runs that never finished


def test_a_killed_run_says_until_when_it_lived_and_what_it_waited_for(
    story: Story, leaf: FakeNode, tmp_path: Path
) -> None:
    events = [story.began, story.goal(leaf, "EXECUTING"), story.node(leaf, Status.RUNNING)]
    said = told(record(events, tmp_path, killed=2.0, tick=1.25))
    assert said.startswith("Deliver: never finished\n")
    until = module.clock(1e9 + 103.0)
    assert f"its process lived until {until}, 3.0 s after the run began; its tick lasted" in said
    assert "its tick lasted for 1.2 s then" in said
    assert "    Move: executing on move_robot for 2.5 s" in said
    assert "`bt-actions cleanup move_robot` cancels it" in said


def test_a_run_that_goes_on_says_so(story: Story, leaf: FakeNode, tmp_path: Path) -> None:
    from bt_actions.recording.folders import held

    events = [story.began, story.goal(leaf, "EXECUTING"), story.node(leaf, Status.RUNNING)]
    first = record(events, tmp_path, killed=2.0)
    with held(first, alone=True):
        said = told(first)
    assert said.startswith("Deliver: goes on\n")
    assert "lived" not in said
    assert "cleanup" not in said
    assert "it runs:" in said


# Runs below


def chain(levels: int, where: Path) -> list[Path]:
    """Record runs of which each has failed as the one below it has; return their files."""
    found = []
    for level in range(levels):
        leaf = FakeAction(f"Leaf {level}", "/run_tree")
        leaf.action = "RunTree"
        story = Story(FakeNode(f"Tree {level}", [leaf]))
        ids = {"request": f"{level:032x}" if level else "", "caller": f"{level:031x}c"}
        story.began = replace(story.began, run_id=f"{level + 1:031x}c", **ids)
        goal = {"goal_id": f"{level + 1:032x}"}
        events = [
            replace(each, **goal) if isinstance(each, GoalChanged) else each
            for each in failing(story, leaf)
        ]
        found.append(record(events, where / str(level)))
    for each in found:
        each.parent.rename(where / each.parent.name)
    return [where / each.parent.name / each.name for each in found]


def test_the_run_below_is_told_behind_the_leaf_that_asked_for_it(tmp_path: Path) -> None:
    above, below = chain(2, tmp_path)
    said = told(above, where=tmp_path)
    heads = [line for line in said.splitlines() if ": FAILURE" in line]
    assert heads == [
        "Tree 0: FAILURE after 3.00 s",
        "below Tree 0 / Leaf 0: Tree 1: FAILURE after 3.00 s",
    ]
    assert f"asked for by goal {1:032x} of run {1:031x}c" in said
    assert [each.state.tree for each in reports(below, where=tmp_path)] == ["Tree 1"]
    (report,) = reports(below, where=tmp_path)
    assert module.caller_of(report, tmp_path) == above


def test_a_chain_is_told_to_eight_levels(tmp_path: Path) -> None:
    first = chain(10, tmp_path)[0]
    assert [each.state.tree for each in reports(first, where=tmp_path)] == [
        f"Tree {level}" for level in range(8)
    ]


def test_a_run_below_that_cannot_be_read_is_left_out(tmp_path: Path) -> None:
    above, below = chain(2, tmp_path)
    below.write_bytes(b"none")
    assert [each.state.tree for each in reports(above, where=tmp_path)] == ["Tree 0"]


# For others


VALUES = (b"final_pose", b"100.0", b"station 1", b"fault: abort", b"3.125", b"5.125", b"stalled: ")


@pytest.mark.parametrize("options", [{}, {"size": 20_000, "files": 3}], ids=["short", "long"])
def test_without_values_a_report_holds_none_of_them(
    night: tuple[list[Event], VirtualRunner], tmp_path: Path, options: dict[str, int]
) -> None:
    first = record(night[0], tmp_path, **options)
    with_values = told(first).encode()
    is_long = b"events are missing" in with_values
    assert is_long is bool(options)
    assert is_long or all(value in with_values for value in VALUES)
    for said in (told(first, values=False), "\n".join(markdown(reports(first, values=False)))):
        assert not [value for value in VALUES if value in said.encode()], said
        assert "ABORTED: aborted by /move_robot" in said
        assert "To the station  /move_robot       3 in 3 visits  SUCCEEDED" in said
        assert str(tmp_path) not in said
        assert "night.yaml:" in said
        assert "examples/" not in said


def test_a_run_that_is_recorded_without_values_holds_none(
    night: tuple[list[Event], VirtualRunner], tmp_path: Path
) -> None:
    first = record(night[0], tmp_path, values=False)
    kept = b"".join(bytes_of(tmp_path))
    assert not [value for value in VALUES if value in kept]
    assert "ABORTED: aborted by /move_robot" in told(first)


@pytest.mark.parametrize("message", ["lifted 3.125 kg", "for John", "{x: 1}", "went: far"])
@pytest.mark.parametrize("options", [{}, {"size": 1, "files": 2}], ids=["short", "long"])
def test_what_a_leaf_of_the_user_s_says_counts_as_value(
    story: Story, leaf: FakeNode, message: str, options: dict[str, int], tmp_path: Path
) -> None:
    events = [
        story.began,
        story.node(leaf, Status.FAILURE, message),
        story.node(leaf, Status.SUCCESS, message, warning=message),
        story.node(story.root, Status.FAILURE, message),
        story.finish(Status.FAILURE),
        RunEnded(story._next(), 1, complaint=message),
    ]
    first = record(events, tmp_path, **options)
    assert message in told(first)
    assert "warning: " in told(first)
    for said in (told(first, values=False), to_json(stripped(state_of(events)))):
        assert message not in said
        assert "warning: " not in said
