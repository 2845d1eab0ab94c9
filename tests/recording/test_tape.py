"""A recording in memory: how the run stood at any position, however one came there."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest
from py_trees.common import Status

from bt_actions.events import Event, NodeChanged, RunBegan
from bt_actions.recording import tape as module
from bt_actions.recording.reading import Recording, RecordingError
from bt_actions.recording.tape import Tape
from bt_actions.recording.writing import RunWriter
from bt_actions.story.keeping import to_json
from tests.support.every_kind import every_kind
from tests.support.recordings import record
from tests.support.stories import state_of
from tests.support.told_trees import FakeAction, FakeNode, Story
from tests.support.virtual_runs import NIGHT, run_of


@pytest.fixture(scope="module")
def night() -> list[Event]:
    """The events of a shift that fails at its end."""
    return run_of(NIGHT, "move_robot:12:abort")


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "BLOCK", 1)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("which", ["every kind", "night"])
def test_a_position_has_the_state_of_the_events_before_it_however_one_came_there(
    night: list[Event], tmp_path: Path, which: str
) -> None:
    told = night if which == "night" else every_kind(rounds=30)
    first = record(told, tmp_path)
    tape, events = Tape(Recording(first)), list(Recording(first).items())
    assert len(tape) == len(events) == len(told)
    assert len(tape._blocks) > 3
    end = len(events) + 1
    anywhere = random.Random(1).choices(range(end), k=30)
    for position in (*range(0, end, 7), *reversed(range(0, end, 11)), *anywhere):
        assert to_json(tape.seek(position)) == to_json(state_of(events[:position])), position
    assert to_json(tape.end) == to_json(state_of(events))


def test_behind_files_that_are_gone_the_state_that_stood_there_counts(tmp_path: Path) -> None:
    events = every_kind(rounds=60)
    first = tmp_path / "run.mcap"
    began = next(each for each in events if isinstance(each, RunBegan))
    writer = RunWriter(first, began, size=10_000, files=3)
    for event in events:
        writer.add(event)
        writer.flush()
    writer.close()
    tape = Tape(Recording(first))
    assert len(tape) < len(events)
    numbers = [getattr(tape.seek(position).now, "number", 0) for position in range(len(tape) + 1)]
    gap = next(n for n in range(len(tape)) if numbers[n + 1] - numbers[n] > 100)
    for position in (len(tape), gap, gap + 1, gap + 2, gap + 1, gap):
        state, number = tape.seek(position), getattr(tape.seek(position).now, "number", 0)
        known = state_of(events[: [each.at.number for each in events].index(number) + 1])
        assert state.nodes[2].visits == known.nodes[2].visits, position
    assert to_json(tape.seek(len(tape))) == to_json(Recording(first).state())


def test_a_failure_is_found_where_a_leaf_fails_and_not_where_others_pass_it_on(
    night: list[Event], tmp_path: Path
) -> None:
    tape = Tape(Recording(record(night, tmp_path)))
    failed = []
    for position in tape.failures:
        event = night[position - 1]
        assert isinstance(event, NodeChanged)
        assert event.status is Status.FAILURE
        failed.append(tape.end.nodes[event.node].node.name)
    assert failed == ["Grasp", "Grasp", "Home"], "what is inverted is no failure"


def test_a_condition_that_fails_in_every_tick_is_one_failure(tmp_path: Path) -> None:
    check, move = FakeNode("Check", kind="check"), FakeAction("Move")
    story, fails = Story(FakeNode("Both", [check, move])), Status.FAILURE
    events = [story.began, *(story.node(check, fails, "no") for _ in range(5))]
    events += [*story.fail(move), *story.fail(move, visit=2)]
    tape = Tape(Recording(record(events, tmp_path)))
    assert [getattr(events[n - 1], "node", 0) for n in tape.failures] == [
        check.id,
        move.id,
        move.id,
    ]


def test_times_never_go_back(tmp_path: Path) -> None:
    events = every_kind()
    events[5] = replace(events[5], at=events[5].at._replace(steady=50.0))
    tape = Tape(Recording(record(events, tmp_path)))
    assert list(tape.times) == sorted(tape.times)


def test_a_recording_without_a_run_is_an_error(tmp_path: Path) -> None:
    first = tmp_path / "run.mcap"
    began = next(each for each in every_kind() if isinstance(each, RunBegan))
    RunWriter(first, began).close()
    with pytest.raises(RecordingError, match="holds no run"):
        Tape(Recording(first))
