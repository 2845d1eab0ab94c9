"""The files of a run: what was written is read, whatever has become of the file meanwhile."""

from __future__ import annotations

import errno
import itertools
import os
import random
import struct
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest
import zstandard
from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    Event,
    EventsLost,
    FeedbackCame,
    GoalChanged,
    Moment,
    NodeChanged,
    RunBegan,
    VariableWritten,
    wire,
)
from bt_actions.events.bare import bare
from bt_actions.recording import finishing, mcap_records, reading, writing
from bt_actions.recording.finishing import finish, is_finished
from bt_actions.recording.folders import is_written, parts_of
from bt_actions.recording.mcap_records import Attachment
from bt_actions.recording.reading import Recording, RecordingError
from bt_actions.recording.writing import RunWriter
from bt_actions.story.state import State
from bt_actions.story.words import last_words
from tests.support.every_kind import SOURCES, every_kind
from tests.support.stories import state_of


def written(first: Path, events: list[Event], **options: object) -> RunWriter:
    began = next(each for each in events if isinstance(each, RunBegan))
    writer = RunWriter(first, began, **options)  # type: ignore[arg-type]
    for event in events:
        writer.add(event)
        writer.flush()
    writer.close()
    return writer


def read(first: Path) -> list[Event | State]:
    return list(Recording(first).items())


def told(items: list[Event | State]) -> list[str]:
    """What is compared: NaN equals NaN."""
    return [repr(each) for each in items]


def test_the_sample_holds_every_kind() -> None:
    assert {type(each).__name__ for each in every_kind()} == set(wire.KINDS)


def test_each_event_is_read_as_it_was_written(tmp_path: Path) -> None:
    events = every_kind()
    written(tmp_path / "run.mcap", events)
    assert told(read(tmp_path / "run.mcap")) == told(events)
    finish(tmp_path / "run.mcap")
    assert is_finished(tmp_path / "run.mcap")
    assert told(read(tmp_path / "run.mcap")) == told(events)


def test_the_tree_files_the_inputs_and_the_versions_are_kept(tmp_path: Path) -> None:
    written(tmp_path / "run.mcap", every_kind())
    recording = Recording(tmp_path / "run.mcap")
    recording.state()
    assert recording.sources == SOURCES
    with (tmp_path / "run.mcap").open("rb") as file:
        found = [each for each in mcap_records.records(file) if isinstance(each, Attachment)]
    assert {"inputs.json", "versions.json"} < {each.name for each in found}


def test_only_its_user_may_read_it(tmp_path: Path) -> None:
    written(tmp_path / "run.mcap", every_kind())
    assert (tmp_path / "run.mcap").stat().st_mode & 0o777 == 0o600
    finish(tmp_path / "run.mcap")
    assert (tmp_path / "run.mcap").stat().st_mode & 0o777 == 0o600


def test_large_runs_are_finished_by_one_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(finishing, "AT_ONCE", 0)
    firsts = [tmp_path / name / "run.mcap" for name in "ab"]
    for first in firsts:
        first.parent.mkdir()
        written(first, every_kind())
    process = finishing.finish_beside(*firsts, may_wait=True)
    assert process is not None
    assert process.wait(60.0) == 0
    assert all(map(is_finished, firsts))


def test_finishing_follows_no_link_that_lies_in_wait_and_leaves_those_of_the_user(
    tmp_path: Path,
) -> None:
    victim, first, link = tmp_path / "victim", tmp_path / "run.mcap", tmp_path / "link.mcap"
    victim.write_bytes(b"mine")
    (tmp_path / ".run.mcap.new").symlink_to(victim)
    written(first, every_kind())
    first.chmod(0o640)
    link.symlink_to(first)
    assert finish(link)
    assert victim.read_bytes() == b"mine"
    assert link.is_symlink()
    assert is_finished(first)
    assert first.stat().st_mode & 0o777 == 0o640


def test_a_transition_without_a_text_takes_60_bytes_and_40_when_finished(tmp_path: Path) -> None:
    few, many = tmp_path / "few.mcap", tmp_path / "many.mcap"
    events = every_kind()
    at = events[1].at
    rounds = 20_000
    more: list[Event] = [
        NodeChanged(
            Moment(10 + number, at.steady + (number + 1) / 64, at.wall + (number + 1) / 64, 0.0),
            1 + number % 3,
            (Status.RUNNING, Status.SUCCESS)[number % 2],
            "",
        )
        for number in range(rounds)
    ]
    written(few, events[:2])
    written(many, events[:2] + more)
    assert (many.stat().st_size - few.stat().st_size) / rounds <= 60
    finish(many)
    finish(few)
    assert (many.stat().st_size - few.stat().st_size) / rounds <= 40
    assert told(read(many)) == told([*events[:2], *more])


# Long runs


def test_a_run_that_grows_gets_more_files_and_reads_as_one(tmp_path: Path) -> None:
    events = every_kind(rounds=40)
    written(tmp_path / "run.mcap", events, size=60_000)
    assert len(parts_of(tmp_path / "run.mcap")) > 2
    assert told(read(tmp_path / "run.mcap")) == told(events)


def test_a_state_that_is_longer_than_a_file_begins_no_file_with_each_event(tmp_path: Path) -> None:
    events = every_kind(rounds=40)
    written(tmp_path / "run.mcap", events, size=100, files=1000)
    assert 2 < len(parts_of(tmp_path / "run.mcap")) < len(events) / 5
    assert told(read(tmp_path / "run.mcap")) == told(events)


def test_a_run_is_held_until_the_last_of_its_files_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, rewrite, seen = tmp_path / "run.mcap", finishing._rewrite, list[bool]()
    written(first, every_kind(rounds=40), size=60_000)

    def watched(part: Path) -> bool:
        seen.append(is_written(first))
        return rewrite(part)

    monkeypatch.setattr(finishing, "_rewrite", watched)
    assert finish(first)
    assert seen == [True] * len(parts_of(first))


@pytest.mark.parametrize("finished", [False, True])
def test_what_old_files_held_is_counted_and_the_story_is_the_same(
    tmp_path: Path, finished: bool
) -> None:
    first, events = tmp_path / "run.mcap", every_kind(rounds=60)
    written(first, events, size=40_000, files=3)
    assert parts_of(first)[0] == first
    assert len(parts_of(first)) == 3
    if finished:
        finish(first)
    items = read(first)
    gap = next(number for number, each in enumerate(items) if isinstance(each, State))
    lost = items[gap - 1]
    assert isinstance(lost, EventsLost)
    assert gap - 1 + lost.count + len(items[gap + 1 :]) == len(events)
    assert last_words(Recording(first).state()) == last_words(state_of(events))


def test_the_first_file_alone_does_not_end_as_the_run_did(tmp_path: Path) -> None:
    """The state at the head of a file counts, and not what came before it."""
    first, events = tmp_path / "run.mcap", every_kind(rounds=60)
    written(first, events, size=40_000, files=3)
    for part in parts_of(first)[1:]:
        part.unlink()
    assert last_words(Recording(first).state()) != last_words(state_of(events))


def test_a_file_that_another_run_left_is_no_part_of_it(tmp_path: Path) -> None:
    first, events = tmp_path / "m[1].mcap", every_kind()
    other: list[Event] = [
        replace(each, run_id="0f" * 16) if isinstance(each, RunBegan) else each
        for each in every_kind(rounds=40)
    ]
    written(first, other, size=60_000)
    assert len(parts_of(first)) > 2
    first.unlink()
    written(first, events)
    recording = Recording(first)
    assert told(list(recording.items())) == told(list[Event | State](events))
    assert recording.damaged == 0


def test_feedback_of_a_long_run_is_thinned_and_that_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(writing, "THIN_FROM", 1)
    events = every_kind(rounds=60)
    written(tmp_path / "run.mcap", events, size=20_000, say=said.append)
    kept = [each for each in read(tmp_path / "run.mcap") if isinstance(each, FeedbackCame)]
    assert len(kept) < 60
    assert len(said) == 1
    assert "feedback" in said[0]
    assert last_words(Recording(tmp_path / "run.mcap").state()) == last_words(state_of(events))


def test_without_values_none_is_in_the_file(tmp_path: Path) -> None:
    events = every_kind()
    written(tmp_path / "run.mcap", events, values=False)
    data = (tmp_path / "run.mcap").read_bytes()
    for value in (
        b"x\\ud800",
        b'{"x":1.5}',
        b"$bytes",
        b"18446744073709551615",
        b"tree: all",
        b"said",
        b"1.00 m",
        b"robot7",
    ):
        assert value not in data.replace(b"\\u0000", b"")
    assert b"--sim --speed 2" in data
    assert told(read(tmp_path / "run.mcap")) == told([e for e in map(bare, events) if e])


# Damage


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, list[Event]]:
    """A small file, and its events."""
    first, events = tmp_path_factory.mktemp("sample") / "run.mcap", every_kind()
    written(first, events)
    return first.read_bytes(), events


def ends_of_records(data: bytes) -> list[int]:
    at, ends = len(mcap_records.MAGIC), []
    while at < len(data):
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        ends.append(at)
    return ends


def test_a_file_that_is_cut_at_any_byte_is_read_up_to_there(
    tmp_path: Path, sample: tuple[bytes, list[Event]]
) -> None:
    data, events = sample
    whole, path = ends_of_records(data), tmp_path / "cut.mcap"
    before = told(list[Event | State](events))
    for end in range(len(mcap_records.MAGIC), len(data)):
        path.write_bytes(data[:end])
        if end in whole or end % 7 == 0:
            items = told(read(path))
            assert items == before[: len(items)]
            with path.open("rb") as file:
                *found, last = (None, *mcap_records.records(file))
            is_cut = isinstance(last, mcap_records.Damage)
            assert is_cut == (end not in {len(mcap_records.MAGIC), *whole})
            heads = 1  # the header tells nothing
            assert len(found) - is_cut == max(0, sum(each <= end for each in whole) - heads)
    for end in range(len(mcap_records.MAGIC)):
        path.write_bytes(data[:end])
        assert read(path) == []  # as it is when a run has just begun
        with pytest.raises(RecordingError, match="holds no run"):
            Recording(path).state()


def with_one_bit_changed(data: bytes, at: int, chance: random.Random) -> bytes:
    return data[:at] + bytes([data[at] ^ (1 << chance.randrange(8))]) + data[at + 1 :]


def test_finishing_takes_nothing_from_a_damaged_file(
    tmp_path: Path, sample: tuple[bytes, list[Event]]
) -> None:
    data, _ = sample
    chance, path, finished = random.Random(35), tmp_path / "run.mcap", 0
    heads = [end + byte for end in ends_of_records(data)[:12] for byte in (0, 1, 9, 10, 11, 12)]
    for at in [*heads, *(chance.randrange(8, len(data)) for _ in range(100))]:
        path.write_bytes(with_one_bit_changed(data, at, chance))
        before = told(read(path))
        finished += finish(path)
        assert told(read(path)) == before
    assert 20 < finished < 150  # a bit within a text is no damage that can be seen


def test_one_damaged_byte_costs_one_message(
    tmp_path: Path, sample: tuple[bytes, list[Event]]
) -> None:
    data, events = sample
    chance, path = random.Random(36), tmp_path / "damaged.mcap"
    before = [(type(each), each.at.number) for each in events]
    layouts = ends_of_records(data)
    first_message = next(end for end in layouts if data[end] == mcap_records.MESSAGE)
    for _ in range(1000):
        at = chance.randrange(first_message, len(data))
        path.write_bytes(with_one_bit_changed(data, at, chance))
        items = [(type(each), each.at.number) for each in read(path) if not isinstance(each, State)]
        missing = set(before) - set(items)
        assert len(missing) <= 1, f"byte {at}"
        in_order = iter(items)  # a damaged one may read as another one, or as one more
        assert all(each in in_order for each in before if each not in missing), f"byte {at}"


@pytest.mark.parametrize("times", [1, 3])
def test_what_stands_twice_in_a_file_is_read_once_and_counted(
    tmp_path: Path, sample: tuple[bytes, list[Event]], times: int
) -> None:
    data, events = sample
    ends = ends_of_records(data)
    tail = data[next(end for end in ends if data[end] == mcap_records.MESSAGE) :]
    (tmp_path / "run.mcap").write_bytes(data + times * tail)
    recording = Recording(tmp_path / "run.mcap")
    assert told(list(recording.items())) == told(list[Event | State](events))
    assert recording.damaged >= times * len(events)


def test_the_event_behind_lost_ones_has_their_number_and_is_read(tmp_path: Path) -> None:
    lost = EventsLost(every_kind()[4].at, 3)
    events = [*every_kind()[:4], lost, *every_kind()[4:]]
    written(tmp_path / "run.mcap", events)
    assert told(read(tmp_path / "run.mcap")) == told(list[Event | State](events))


def test_a_number_that_is_far_ahead_costs_none_that_follow(tmp_path: Path) -> None:
    events = every_kind(rounds=3)
    at = events[30].at
    events[30] = replace(events[30], at=at._replace(number=at.number + 2**40))
    written(tmp_path / "run.mcap", events)
    assert told(read(tmp_path / "run.mcap")) == told(list[Event | State](events))


@pytest.mark.parametrize("finished", [False, True])
def test_no_damage_makes_more_than_an_error_in_words(
    tmp_path: Path, sample: tuple[bytes, list[Event]], finished: bool
) -> None:
    data, _ = sample
    chance, path = random.Random(37), tmp_path / "run.mcap"
    if finished:
        path.write_bytes(data)
        finish(path)
        data = path.read_bytes()
    for _ in range(300):
        damaged = bytearray(data)
        for _ in range(chance.randrange(1, 20)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        path.write_bytes(damaged)
        try:
            read(path)
        except RecordingError:
            continue


def test_in_a_finished_file_no_damage_is_taken_for_what_happened(
    tmp_path: Path, sample: tuple[bytes, list[Event]]
) -> None:
    """What is lost is said, and no value is another one."""
    data, _ = sample
    chance, path = random.Random(38), tmp_path / "run.mcap"
    path.write_bytes(data)
    finish(path)
    data, before = path.read_bytes(), told(read(path))
    for _ in range(300):
        path.write_bytes(with_one_bit_changed(data, chance.randrange(8, len(data)), chance))
        recording = Recording(path)
        items = told(list(recording.items()))
        assert recording.damaged or items == before


def test_one_damaged_byte_of_a_finished_file_costs_what_is_packed_with_it(tmp_path: Path) -> None:
    path, chance = tmp_path / "run.mcap", random.Random(39)
    events = every_kind(rounds=50)
    written(path, events)
    finish(path)
    data = path.read_bytes()
    ends = ends_of_records(data[: -len(mcap_records.MAGIC)])
    chunks = [(at, to) for at, to in itertools.pairwise(ends) if data[at] == mcap_records.CHUNK]
    assert len(chunks) > 8
    for at, to in chunks[1:]:
        path.write_bytes(with_one_bit_changed(data, chance.randrange(at + 60, to), chance))
        recording = Recording(path)
        numbers = [each.at.number for each in recording.items() if not isinstance(each, State)]
        assert 0.8 * len(events) < len(numbers) < len(events)
        assert sorted(set(numbers)) == numbers
        size = to - at
        said = f"1 part of the recording ({size} bytes) is damaged or of another version"
        assert recording.damage == said
    at, _ = chunks[0]
    path.write_bytes(data[:at] + b"\xff" + data[at + 1 :])
    recording = Recording(path)
    with pytest.raises(RecordingError, match="holds no run"):
        recording.state()
    assert recording.damaged_bytes == chunks[0][1] - at


def test_many_damages_are_counted_with_their_bytes(
    tmp_path: Path, sample: tuple[bytes, list[Event]]
) -> None:
    data, _ = sample
    ends = [end for end in ends_of_records(data)[:-1] if data[end] == mcap_records.MESSAGE]
    path, lost = tmp_path / "run.mcap", 0
    for end in (ends[3], ends[8]):
        data = data[:end] + b"\xff" + data[end + 1 :]
        lost += ends[ends.index(end) + 1] - end
    path.write_bytes(data)
    recording = Recording(path)
    list(recording.items())
    said = f"2 parts of the recording ({lost} bytes) are damaged or of another version"
    assert recording.damage == said


@pytest.mark.parametrize("claim", [100_000_000, 1000], ids=["a huge one", "a small one"])
def test_a_chunk_is_passed_over_that_is_huge_whatever_size_it_claims(
    tmp_path: Path, claim: int
) -> None:
    packed = zstandard.compress(bytes(100_000_000))
    chunk = struct.pack("<QQQII", 0, 0, claim, 0, 4) + b"zstd" + struct.pack("<Q", len(packed))
    record = struct.pack("<BQ", mcap_records.CHUNK, len(chunk + packed)) + chunk + packed
    (tmp_path / "bomb.mcap").write_bytes(mcap_records.MAGIC + record)
    recording = Recording(tmp_path / "bomb.mcap")
    tracemalloc.start()
    try:
        assert list(recording.items()) == []
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
    assert recording.damaged == 1


def test_names_that_never_end_are_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    events = every_kind()
    monkeypatch.setattr(reading, "MOST_NAMES", 50)
    more = [VariableWritten(Moment(90 + n, 200.0, 200.0, 0.0), f"v{n}", 1, None) for n in range(60)]
    written(tmp_path / "run.mcap", [*events[:-1], *more])
    with pytest.raises(RecordingError, match="more names"):
        read(tmp_path / "run.mcap")


@pytest.mark.parametrize("kind", ["variables", "goals", "feedback", "verdicts"])
def test_values_that_never_end_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    events = every_kind()
    large, more = "x" * 1000, list[Event]()
    sent = next(each for each in events if isinstance(each, GoalChanged))
    judged = next(each for each in events if isinstance(each, AttemptEnded))
    for number in range(60):
        at, own = Moment(90 + number, 200.0, 200.0, 0.0), f"{number:032x}"
        if kind == "variables":
            more.append(VariableWritten(at, own, large, None))
        elif kind == "goals":
            more.append(replace(sent, at=at, goal_id=own, state="SENDING", goal=large))
        elif kind == "feedback":
            more.append(FeedbackCame(at, sent.node, own, large))
        else:
            more.append(replace(judged, at=at, reason=large))
    written(tmp_path / "run.mcap", [*events[:-1], *more])
    assert len(read(tmp_path / "run.mcap")) == len(events) - 1 + len(more)
    monkeypatch.setattr(reading, "MOST_KEPT", 60_000)
    with pytest.raises(RecordingError, match="more values"):
        read(tmp_path / "run.mcap")


def test_a_long_run_has_no_more_values_than_a_state_of_it_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "MOST_KEPT", 20_000)
    *events, ended = every_kind()
    of_goals = [each for each in events if isinstance(each, GoalChanged | AttemptEnded)]
    for turn in range(100):
        for each in of_goals:
            at = each.at._replace(number=len(events) + 1)
            events.append(replace(each, at=at, goal_id=f"{turn:032x}"))
    events.append(replace(ended, at=ended.at._replace(number=len(events) + 1)))
    written(tmp_path / "run.mcap", events)
    assert told(read(tmp_path / "run.mcap")) == told(list[Event | State](events))


def test_a_file_that_is_none_is_said_to_be_none(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_text("tree: pick_and_place\n")
    with pytest.raises(RecordingError, match=r"run\.mcap is no recording"):
        read(tmp_path / "run.mcap")
    with pytest.raises(RecordingError, match="cannot be read"):
        read(tmp_path / "none.mcap")


# A full disk


def test_a_full_disk_leaves_whole_records_and_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full disk takes a part of what is written first, and only then says that."""
    first, events, said = tmp_path / "run.mcap", every_kind(rounds=20), list[str]()
    room, write = [30_000], os.write

    def full(descriptor: int, data: bytes) -> int:
        taken = min(len(data), room[0])
        room[0] -= taken
        if not taken:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(descriptor, data[:taken])

    monkeypatch.setattr(writing.os, "write", full)
    writer = written(first, events, say=said.append)
    monkeypatch.undo()
    assert writer.failed
    assert len(said) == 1
    assert "disk is full" in said[0]
    assert first.stat().st_size in ends_of_records(first.read_bytes())
    items = told(read(first))
    assert 0 < len(items) < len(events)
    assert items == told(list[Event | State](events))[: len(items)]


def test_a_disk_that_is_gone_raises_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(writing.os, "close", gone)
    monkeypatch.setattr(Path, "unlink", gone)
    writer = written(tmp_path / "run.mcap", every_kind(rounds=40), size=20_000, files=2)
    monkeypatch.undo()
    assert not writer.failed
    assert len(parts_of(tmp_path / "run.mcap")) > 2


def test_of_a_bag_with_two_runs_one_is_read(tmp_path: Path) -> None:
    from dataclasses import replace as changed

    one = every_kind()
    other: list[Event] = [
        changed(each, run_id="0f" * 16, tree="other") if isinstance(each, RunBegan) else each
        for each in every_kind()
    ]
    written(tmp_path / "one.mcap", one)
    written(tmp_path / "other.mcap", other)
    head, tail = ((tmp_path / name).read_bytes() for name in ("one.mcap", "other.mcap"))
    (tmp_path / "bag.mcap").write_bytes(head + tail[len(mcap_records.MAGIC) :])
    state = Recording(tmp_path / "bag.mcap").state()
    assert state.tree == "all"
    assert Recording(tmp_path / "bag.mcap", run_id="0f" * 16).state().tree == "other"


@pytest.mark.slow
def test_a_large_file_takes_no_more_memory_than_a_small_one(tmp_path: Path) -> None:
    """Kilobytes of the process at its highest, as a program of its own has them."""
    written(tmp_path / "run.mcap", every_kind(rounds=50))
    data = (tmp_path / "run.mcap").read_bytes()
    messages = data[next(e for e in ends_of_records(data) if data[e] == mcap_records.MESSAGE) :]
    program = (
        "import sys; from pathlib import Path\n"
        "from bt_actions.recording.reading import Recording\n"
        "print(Recording(Path(sys.argv[1])).state().status.value)\n"
        "print(*[s.split()[1] for s in open('/proc/self/status') if 'VmHWM' in s])\n"
    )
    peaks = []
    for times in (1, 400):
        with (tmp_path / "run.mcap").open("wb") as file:
            file.writelines([data, *[messages] * times])
        command = [sys.executable, "-c", program, str(tmp_path / "run.mcap")]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        peaks.append(int(done.stdout.split()[-1]))
    assert (tmp_path / "run.mcap").stat().st_size > 50_000_000
    assert peaks[1] - peaks[0] < 40_000
    assert peaks[1] < 300_000
