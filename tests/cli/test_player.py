"""A recording that is played: what time and keys do."""

from __future__ import annotations

from pathlib import Path

import pytest
from py_trees.common import Status

from bt_actions.cli.driving.player import Player
from bt_actions.events import Event
from bt_actions.recording.reading import Recording
from bt_actions.recording.tape import Tape
from tests.support.recordings import record
from tests.support.told_trees import FakeAction, FakeNode, Story

STEP = 4.0
"""Seconds between two events."""


@pytest.fixture
def events() -> list[Event]:
    """Two leaves that succeed and one that fails between them, for more than a minute."""
    leaves = [FakeAction(name) for name in ("First", "Second", "Third")]
    story = Story(FakeNode("Root", leaves), step=STEP)
    told = [story.began, *story.succeed(leaves[0]), *story.fail(leaves[1], "no")]
    told += [*story.succeed(leaves[2]), *story.fail(leaves[1], "again", visit=2)]
    return [*told, story.finish(Status.FAILURE)]


@pytest.fixture
def player(events: list[Event], tmp_path: Path) -> Player:
    return Player(Tape(Recording(record(events, tmp_path))))


def at(player: Player) -> float:
    """Where a player stands, in seconds since the run began."""
    return player.now - player.first


def test_time_passes_at_the_speed_that_was_chosen(player: Player) -> None:
    player.let_pass(0.5)
    assert at(player) == 0.5
    player.speed = 10.0
    player.let_pass(0.5)
    assert at(player) == 5.5
    assert player.state.now is not None
    assert player.state.now.number == 2


def test_speeds_are_chosen_up_and_down_and_end_at_the_highest_and_the_lowest(
    player: Player,
) -> None:
    speeds = []
    for key in "++++++-----":
        player.press(key)
        speeds.append(player.speed)
    assert speeds == [2, 5, 10, 100, 100, 100, 10, 5, 2, 1, 1]
    player.speed = 3.0
    player.press("+")
    assert player.speed == 5


def test_space_pauses_and_goes_on(player: Player) -> None:
    player.press(" ")
    player.let_pass(1.0)
    assert (at(player), player.is_paused) == (0.0, True)
    player.press(" ")
    player.let_pass(1.0)
    assert (at(player), player.is_paused) == (1.0, False)


def test_arrows_go_five_seconds_or_a_minute_and_not_beyond_the_run(player: Player) -> None:
    positions = []
    for key in ("right", "right", "left", "up", "up", "left", "down", "left"):
        player.press(key)
        positions.append(at(player))
    end = player.last - player.first
    assert positions == [5, 10, 5, 65, end, end - 5, max(0.0, end - 65), 0]


def test_a_step_is_one_event_and_stops_there(player: Player) -> None:
    assert player.state.now is not None
    assert player.state.now.number == 1
    for key, number in (("right", 2), (".", 3), (".", 4), (",", 3), (",", 2), (",", 1), (",", 1)):
        player.press(key)
        assert player.state.now is not None
        assert player.state.now.number == number
        assert at(player) == (5.0 if key == "right" else (number - 1) * STEP)
    assert player.is_paused


def test_the_next_failure_and_the_one_before_stop_there(player: Player) -> None:
    stops = []
    for key in "nnnNN":
        player.press(key)
        stops.append((at(player), player.said))
    first, second = 8 * STEP, 16 * STEP
    assert stops == [
        (first, ""),
        (second, ""),
        (second, "no later failure"),
        (first, ""),
        (first, "no earlier failure"),
    ]
    assert player.is_paused
    assert player.state.nodes[3].message == "ABORTED: no"


def test_the_end_pauses_and_space_begins_again(player: Player) -> None:
    player.let_pass(1000.0)
    assert player.now == player.last
    assert player.state.finished is not None
    assert player.is_paused
    player.press(" ")
    assert (at(player), player.is_paused) == (0.0, False)
    player.let_pass(1.0)
    assert at(player) == 1.0


def test_other_keys_do_nothing(player: Player) -> None:
    before = player.now, player.speed, player.is_paused
    for key in "x0?":
        player.press(key)
    assert (player.now, player.speed, player.is_paused) == before
