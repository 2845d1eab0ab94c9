"""Following a run while it is written, through its end and its finishing."""

from __future__ import annotations

import contextlib
import itertools
from pathlib import Path

import pytest

from bt_actions.events import Event, RunBegan
from bt_actions.recording.finishing import finish, is_finished
from bt_actions.recording.folders import held, parts_of, prune
from bt_actions.recording.following import Follower
from bt_actions.recording.reading import Item
from bt_actions.recording.writing import RunWriter
from bt_actions.story.state import State
from bt_actions.story.words import last_words
from tests.recording.test_folders import made
from tests.support.every_kind import every_kind
from tests.support.stories import state_of


def writer_of(first: Path, events: list[Event], **options: int) -> RunWriter:
    began = next(each for each in events if isinstance(each, RunBegan))
    return RunWriter(first, began, **options)


def folded(items: list[Item]) -> State:
    state = State()
    for item in items:
        if isinstance(item, State):
            state = item
        else:
            state.fold(item)
    return state


@pytest.mark.parametrize("size", [10**6, 20_000])
def test_a_follower_gets_each_event_once_however_often_it_looks(tmp_path: Path, size: int) -> None:
    events, first = every_kind(rounds=20), tmp_path / "run.mcap"
    writer = writer_of(first, events, size=size)
    found: list[Item] = []
    with Follower(first) as follower, held(first, alone=True):
        for number, event in enumerate(events):
            writer.add(event)
            writer.flush()
            if number % 3 == 0:
                found += list(follower.news())
        writer.close()
        found += list(follower.news())
        assert list(follower.news()) == []
    with Follower(first) as follower:
        assert list(map(repr, list(follower.news()))) == list(map(repr, events))
        assert finish(first)
        assert is_finished(first)
        assert list(follower.news()) == []
        assert follower.recording.damaged == 0
    assert list(map(repr, found)) == list(map(repr, events))


def test_what_is_half_written_is_read_when_it_is_whole(tmp_path: Path) -> None:
    events, first = every_kind(), tmp_path / "run.mcap"
    writer = writer_of(first, events)
    for event in events:
        writer.add(event)
    writer.close()
    data = first.read_bytes()
    found: list[Item] = []
    first.write_bytes(b"")
    with Follower(first) as follower, held(first, alone=True):
        for at in range(0, len(data), 97):
            with first.open("ab") as file:
                file.write(data[at : at + 97])
            found += list(follower.news())
    assert list(map(repr, found)) == list(map(repr, events))


def test_a_run_that_is_finished_between_two_looks_goes_on_where_it_was(tmp_path: Path) -> None:
    events, first = every_kind(rounds=20), tmp_path / "run.mcap"
    writer = writer_of(first, events)
    with Follower(first) as follower:
        for event in events[:100]:
            writer.add(event)
        writer.flush()
        found = list(follower.news())
        for event in events[100:]:
            writer.add(event)
        writer.close()
        finish(first)
        found += list(follower.news())
    assert list(map(repr, found)) == list(map(repr, events))


def test_what_is_written_while_a_follower_reads_is_read(tmp_path: Path) -> None:
    """The writer ends a file and begins another one behind what the follower has of it."""
    events, first = every_kind(rounds=20), tmp_path / "run.mcap"
    writer, left = writer_of(first, events, size=30_000), iter(events)
    found: list[Item] = []

    def written(count: int) -> bool:
        some = list(itertools.islice(left, count))
        for event in some:
            writer.add(event)
        writer.flush()
        return bool(some)

    with Follower(first) as follower, held(first, alone=True):
        while written(1):
            for item in follower.news():
                found.append(item)
                written(3)
        found += list(follower.news())
    assert len(parts_of(first)) > 2
    assert list(map(repr, found)) == list(map(repr, events))


@pytest.mark.parametrize("bit", [8, 24, 48], ids=["a little too long", "too long", "huge"])
@pytest.mark.parametrize("goes_on", [True, False], ids=["goes on", "is over"])
def test_a_damaged_length_costs_a_follower_a_message(
    tmp_path: Path, bit: int, goes_on: bool
) -> None:
    events, first = every_kind(rounds=20), tmp_path / "run.mcap"
    writer = writer_of(first, events, size=30_000)
    with contextlib.ExitStack() as stack:
        if goes_on:
            stack.enter_context(held(first, alone=True))
        follower = stack.enter_context(Follower(first))
        for event in events[:20]:
            writer.add(event)
        writer.flush()
        at = first.stat().st_size
        for event in events[20:]:
            writer.add(event)
            writer.flush()
        writer.close()
        data = bytearray(first.read_bytes())
        data[at + 1 + bit // 8] ^= 1
        first.write_bytes(data)
        found = list(follower.news())
    numbers = {item.at.number for item in found if not isinstance(item, State)}
    missing = {each.at.number for each in events} - numbers
    assert missing <= {events[20].at.number}
    assert follower.recording.damaged == 1


def test_a_follower_that_was_too_late_for_a_file_gets_the_state_behind_it(tmp_path: Path) -> None:
    events, first = every_kind(rounds=60), tmp_path / "run.mcap"
    writer = writer_of(first, events, size=20_000, files=3)
    with Follower(first) as follower:
        for event in events[:50]:
            writer.add(event)
        writer.flush()
        found = list(follower.news())
        for event in events[50:]:
            writer.add(event)
            writer.flush()
        writer.close()
        found += list(follower.news())
    assert any(isinstance(each, State) for each in found)
    assert last_words(folded(found)) == last_words(state_of(events))


def test_what_is_followed_is_not_removed(tmp_path: Path) -> None:
    first = made(tmp_path, 1)
    with Follower(first):
        prune(tmp_path, succeeded=0)
        assert first.exists()
    prune(tmp_path, succeeded=0)
    assert not first.exists()
