"""What is told of the runs that go on, and of those that have ended since somebody watches."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import replace

import pytest
from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    Event,
    GoalChanged,
    Moment,
    NodeChanged,
    RunBegan,
    RunEnded,
    TickLasts,
    TreeFinished,
)
from bt_actions.goals.policy import End, Outcome
from bt_actions.recording import watching
from bt_actions.recording.folders import Summary
from bt_actions.recording.unrecorded import told
from bt_actions.recording.watching import Seen, Watch
from tests.support.every_kind import GOAL_ID, RUN_ID, every_kind
from tests.support.recordings import Going, record

Begin = Callable[[list[Event]], Going]


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for new runs each time."""
    monkeypatch.setattr(watching, "EACH", 0.0)


@pytest.fixture
def begin() -> Iterator[Begin]:
    with ExitStack() as stack:

        def one(events: list[Event]) -> Going:
            going = Going(events)
            stack.callback(going.end)
            going.write(events)
            return going

        yield one


@pytest.fixture
def watch() -> Iterator[Watch]:
    with closing(Watch()) as one:
        yield one


def the_one(watch: Watch) -> Seen:
    (seen,) = watch.look()
    return seen


def later(events: list[Event], number: int, seconds: float) -> Moment:
    """A moment so many numbers and seconds behind the last event."""
    at = events[-1].at
    return Moment(at.number + number, at.steady + seconds, at.wall + seconds, at.ros)


RUNS = every_kind()[:7]
"""Up to a goal that is sent to /move."""


def fails(events: list[Event]) -> list[Event]:
    at = [later(events, number, 0.1) for number in range(1, 7)]
    ended = Outcome.ABORTED, End.ABORTED, "no room", "/move"
    return [
        GoalChanged(at[0], 2, GOAL_ID, 1, "DONE", *ended),
        AttemptEnded(at[1], 2, GOAL_ID, 1, Outcome.ABORTED, "no room"),
        NodeChanged(at[2], 2, Status.FAILURE, "ABORTED: no room", by_itself=True),
        NodeChanged(at[3], 1, Status.FAILURE, ""),
        TreeFinished(at[4], Status.FAILURE),
        RunEnded(at[5], 1),
    ]


def test_a_run_that_goes_on_says_what_it_waits_for_and_then_why_it_failed(
    begin: Begin, watch: Watch
) -> None:
    run = begin(RUNS)
    seen = the_one(watch)
    assert (seen.summary.run_id, seen.word, seen.look) == (RUN_ID, "goes on", "running")
    (waits,) = seen.why
    assert waits.startswith(
        "Move, item 1 of 1 of R\u00f8t ({at: inf}): sending a goal to /move for "
    )
    run.write(fails(RUNS))
    seen = the_one(watch)
    assert (seen.word[:13], seen.look, seen.is_over) == ("FAILURE after", "failure", True)
    assert any("R\u00f8t / Move" in line for line in seen.why)
    assert "no room" in " ".join(seen.why)
    run.end()
    assert the_one(watch) == seen  # and is held no more
    assert watching.recorded()[0].first.parent.exists()


def test_the_clock_goes_on_for_a_second_behind_a_sign_of_life_and_no_further(
    begin: Begin, watch: Watch
) -> None:
    run = begin(RUNS)
    run.beat(5.0)
    began = RUNS[-1].at.steady - RUNS[1].at.steady + 5.0
    assert began <= the_one(watch).seconds <= began + watching.AHEAD
    os.utime(run.first, (0, time.time() - 2.0))  # nothing was written since
    assert the_one(watch).seconds == pytest.approx(began + watching.AHEAD)
    os.utime(run.first, (0, time.time() - 9.5))
    seen = the_one(watch)
    assert seen.seconds == pytest.approx(began)
    assert (seen.word, seen.look) == ("Stale for 9 s", "waiting")
    assert seen.why[0].startswith("last seen at ")


def test_a_run_whose_process_was_killed_is_lost_with_its_last_state_dated(
    begin: Begin, watch: Watch
) -> None:
    now = time.time() - 12.0
    events = [replace(each, at=each.at._replace(wall=now)) for each in RUNS]
    run = begin(events)
    assert not the_one(watch).is_over
    run.end()
    seen = the_one(watch)
    when = time.strftime("%H:%M:%S", time.localtime(now + RUNS[-1].at.steady - RUNS[1].at.steady))
    assert (seen.look, seen.is_over) == ("lost", True)
    assert seen.word in ("Lost for 11 s", "Lost for 12 s")
    assert seen.why[0] == f"its process was killed, last seen at {when}; it then ran:"
    assert "sending a goal to /move" in seen.why[1]


def test_a_tick_that_lasts_is_told_with_its_leaf(begin: Begin, watch: Watch) -> None:
    run = begin([*RUNS, TickLasts(later(RUNS, 1, 1.5), 2, 1.2)])
    run.beat(12.8, 14.0)
    (told,) = the_one(watch).why
    assert "in its tick for 14 s" in told


def test_what_is_not_recorded_is_told_and_no_more_made_up(begin: Begin, watch: Watch) -> None:
    begin(RUNS)
    summary = Summary(RUN_ID, "all", 0.0)
    at = time.mktime((2026, 11, 27, 12, 3, 10, 0, 0, -1))
    with told(summary, at, "the disk is full"):
        seen = the_one(watch)
        assert (seen.word, seen.look) == (
            "not recorded since 12:03:10: the disk is full",
            "stopped",
        )
        assert seen.why[0].startswith("last seen at ")
    with told(replace(summary, run_id="ab" * 16, tree="secret"), at, "--no-record"):
        _, seen = watch.look()
        assert (seen.summary.tree, seen.why) == ("secret", ())
        assert seen.word == "not recorded since 12:03:10: --no-record"


def test_a_run_that_was_over_before_is_not_told_and_one_that_was_quick_is(watch: Watch) -> None:
    record(every_kind())
    assert watch.look() == []
    quick = [
        replace(each, run_id="ab" * 16, tree="quick") if isinstance(each, RunBegan) else each
        for each in every_kind()
    ]
    record(quick)
    seen = the_one(watch)
    assert (seen.summary.tree, seen.is_over) == ("quick", True)
    assert seen.word.startswith("STOPPED after")


def test_a_run_that_has_ended_is_told_for_a_while(
    watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch.look()
    record(every_kind())
    assert len(watch.look()) == len(watch.look()) == 1
    monkeypatch.setattr(watching, "KEPT", 0.0)
    assert watch.look() == []


def test_only_runs_that_are_meant_are_told(begin: Begin) -> None:
    begin(RUNS)
    with closing(Watch(lambda run: run.tree == "other")) as watch:
        assert watch.look() == []


def test_a_recording_that_cannot_be_read_is_told(begin: Begin, watch: Watch) -> None:
    run = begin(RUNS)
    with run.first.open("r+b") as file:
        file.write(b"no mcap, by far")
    seen = the_one(watch)
    assert seen.word.startswith("its recording cannot be read")
    assert seen.is_over
