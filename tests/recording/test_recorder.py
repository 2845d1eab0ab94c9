"""The recorder's thread: what it writes while a run goes on, and what a kill leaves."""

from __future__ import annotations

import contextlib
import errno
import os
import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from py_trees.common import Status

from bt_actions.events import (
    NodeChanged,
    RunBegan,
    RunEnded,
    StopWanted,
    TreeFinished,
    VariableWritten,
)
from bt_actions.events.stream import Stream
from bt_actions.recording import recorder as recorder_module
from bt_actions.recording import writing
from bt_actions.recording.finishing import is_finished
from bt_actions.recording.folders import (
    SUCCEEDED,
    Summary,
    home,
    is_written,
    read_summary,
    recorded,
)
from bt_actions.recording.reading import Recording
from bt_actions.recording.recorder import BEAT, Recorder, Wish
from bt_actions.recording.unrecorded import told, unrecorded
from bt_actions.recovery.ledger import directory
from tests.support.every_kind import NODES, RUN_ID, WHERE
from tests.support.waiting import until

ROOT = Path(__file__).parents[2]
KILLS = 100 if os.environ.get("BT_THOROUGH") else 20


class Clock:
    """Real time, and a wall clock that can be set."""

    def __init__(self) -> None:
        self.set_by = 0.0

    def __call__(self) -> tuple[float, float, float]:
        return time.monotonic(), time.time() + self.set_by, 1.0


def begin(stream: Stream, run_id: str = RUN_ID, tree: str = "tree", **more: object) -> None:
    stream.add(RunBegan, run_id, tree, NODES, {}, {}, {}, **more)


def end(stream: Stream, status: Status = Status.SUCCESS, code: int = 0) -> None:
    stream.add(NodeChanged, 1, status, "as it is")
    stream.add(TreeFinished, status)
    stream.add(RunEnded, code)


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def recorder(tmp_path: Path, said: list[str]) -> Iterator[Recorder]:
    made = Recorder(Wish(where=tmp_path), said.append)
    yield made
    made.close()


def test_a_run_is_in_its_folder_from_its_first_event_on(recorder: Recorder, tmp_path: Path) -> None:
    stream = Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    until(lambda: len(recorded(tmp_path)) == 1 and read_summary(recorded(tmp_path)[0].first))
    [run] = recorded(tmp_path)
    assert run.is_written
    assert run.first.parent.stat().st_mode & 0o777 == 0o700
    assert (run.summary.tree, run.summary.status, run.summary.failed) == ("tree", "", True)


@pytest.mark.parametrize("values", [True, False])
def test_the_list_says_from_its_beginning_where_a_run_is_and_names_no_computer_without_values(
    tmp_path: Path, *, values: bool
) -> None:
    stream, recorder = Stream(Clock()), Recorder(Wish(where=tmp_path, values=values), print)
    recorder.record(stream, lambda: None)
    begin(stream, where=WHERE)
    until(lambda: len(recorded(tmp_path)) == 1 and read_summary(recorded(tmp_path)[0].first))
    known = WHERE if values else {name: WHERE[name] for name in WHERE if name != "host"}
    assert recorded(tmp_path)[0].summary.where == known
    end(stream)
    recorder.close()
    assert recorded(tmp_path)[0].summary.where == known


def test_the_end_of_a_run_closes_and_finishes_its_file(recorder: Recorder, tmp_path: Path) -> None:
    stream = Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    end(stream, Status.FAILURE, 1)
    until(lambda: recorded(tmp_path) and is_finished(recorded(tmp_path)[0].first))
    [run] = recorded(tmp_path)
    assert not is_written(run.first)
    assert not stream.is_read
    summary = run.summary
    assert (summary.status, summary.exit_code, summary.failed) == ("FAILURE", 1, True)
    assert "as it is" in summary.cause


def test_what_was_closed_in_the_middle_of_a_run_can_be_read(tmp_path: Path) -> None:
    recorder, stream = Recorder(Wish(where=tmp_path), print), Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    stream.add(VariableWritten, "x", 1, None)
    recorder.close()
    [run] = recorded(tmp_path)
    assert Recording(run.first).state().variables["x"].value == 1
    assert (run.summary.status, run.summary.failed) == ("", True)


def test_two_runs_at_once_have_a_folder_each(recorder: Recorder, tmp_path: Path) -> None:
    one, other = Stream(Clock()), Stream(Clock())
    for stream, run_id in ((one, "aa" * 16), (other, "bb" * 16)):
        recorder.record(stream, lambda: None)
        begin(stream, run_id)
    one.add(VariableWritten, "x", "one", None)
    other.add(VariableWritten, "x", "other", None)
    end(one)
    end(other)
    recorder.close()
    runs = {run.summary.run_id[:2]: Recording(run.first).state() for run in recorded(tmp_path)}
    assert runs["aa"].variables["x"].value == "one"
    assert runs["bb"].variables["x"].value == "other"


def test_the_process_tells_each_second_that_it_lives_and_how_long_its_tick_lasts(
    recorder: Recorder, tmp_path: Path
) -> None:
    stream, began = Stream(Clock()), time.monotonic()
    recorder.record(stream, lambda: began)  # a tick that does not return
    begin(stream)
    first = until(lambda: recorded(tmp_path) and recorded(tmp_path)[0].first)

    def beats() -> Recording:
        recording = Recording(first)
        list(recording.items())
        return recording

    until(lambda: beats().tick > BEAT, 20.0)
    assert beats().last_beat == pytest.approx(time.time(), abs=10 * BEAT)


def test_the_log_s_time_never_goes_back_though_the_clock_does(
    recorder: Recorder, tmp_path: Path
) -> None:
    clock = Clock()
    stream = Stream(clock)
    recorder.record(stream, lambda: None)
    begin(stream)
    clock.set_by = -3600.0
    stream.add(VariableWritten, "x", 1, None)
    end(stream)
    recorder.close()
    from bt_actions.recording.mcap_records import Message, records

    [run] = recorded(tmp_path)
    with run.first.open("rb") as file:
        found = [each for each in records(file) if isinstance(each, Message)]
    times = [each.log_time for each in found]
    assert times == sorted(times)
    assert found[0].publish_time - found[-1].publish_time > 3590 * 10**9


@pytest.mark.parametrize("named", [False, True], ids=["at home", "in a folder that was named"])
def test_a_process_of_many_runs_keeps_the_last_of_them_or_all_where_a_user_wants_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: bool
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    where = tmp_path / "mine" if named else home()
    recorder = Recorder(Wish(where=where if named else None), print)
    for number in range(SUCCEEDED + 5):
        stream = Stream(Clock())
        recorder.record(stream, lambda: None)
        begin(stream, f"{number:032x}"[::-1], f"tree{number}")
        end(stream)
        until(lambda stream=stream: not stream.is_read)
    recorder.close()
    kept = {run.summary.tree for run in recorded(where)}
    assert kept == {f"tree{number}" for number in range(0 if named else 5, SUCCEEDED + 5)}


def test_a_folder_that_cannot_be_made_is_said_once(tmp_path: Path, said: list[str]) -> None:
    (tmp_path / "file").write_text("in the way")
    recorder, stream = Recorder(Wish(where=tmp_path / "file"), said.append), Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    end(stream)
    recorder.close()
    assert len(said) == 1
    assert "not recorded" in said[0]
    assert not stream.is_read


@pytest.mark.parametrize("wish", ["where", "first"])
def test_a_beginning_that_fails_leaves_nothing(
    tmp_path: Path, said: list[str], wish: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "run.json")

    monkeypatch.setattr(recorder_module, "write_summary", full)
    path = tmp_path if wish == "where" else tmp_path / "mine.mcap"
    recorder, stream = Recorder(Wish(**{wish: path}), said.append), Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    end(stream)
    recorder.close()
    assert len(said) == 1
    assert "No space left on device" in said[0]
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_in_the_way_stays(tmp_path: Path, said: list[str]) -> None:
    path = tmp_path / "mine.mcap"
    path.write_text("precious")
    recorder, stream = Recorder(Wish(first=path), said.append), Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    recorder.close()
    assert "not recorded" in said[0]
    assert path.read_text() == "precious"


def test_a_bug_in_the_recording_of_one_run_costs_no_other_run_anything(
    recorder: Recorder, tmp_path: Path, said: list[str]
) -> None:
    one, other = Stream(Clock()), Stream(Clock())
    recorder.record(one, lambda: 1 / 0)
    recorder.record(other, lambda: None)
    begin(one, "aa" * 16)
    until(lambda: said, what="it is given up")
    begin(other, "bb" * 16)
    end(other)
    until(lambda: not other.is_read)
    assert ["ZeroDivisionError" in each.why for each in unrecorded()] == [True]
    recorder.close()
    assert len(said) == 1
    assert "not recorded any further: ZeroDivisionError" in said[0]
    runs = {run.summary.run_id[:2]: run for run in recorded(tmp_path)}
    assert runs["bb"].summary.status == "SUCCESS"
    assert not runs["aa"].is_written
    assert Recording(runs["aa"].first).state().began is not None


# What is not recorded


def test_a_run_whose_disk_is_full_goes_on_and_is_told_not_to_be_recorded(
    tmp_path: Path, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder, stream = Recorder(Wish(where=tmp_path), said.append), Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    first = until(lambda: recorded(tmp_path) and recorded(tmp_path)[0].first)
    until(lambda: Recording(first).state() if first.stat().st_size > 5000 else None)

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(writing.os, "write", full)
        stream.add(VariableWritten, "x", 1, None)
        (gap,) = until(unrecorded)
    assert (gap.summary.run_id, gap.why) == (RUN_ID, "the disk is full")
    assert gap.since == pytest.approx(time.time(), abs=10.0)
    assert is_written(first)  # it goes on
    end(stream)
    until(lambda: not stream.is_read)
    until(lambda: not is_written(first))
    assert unrecorded() == []
    summary = read_summary(first)
    assert summary is not None
    assert (summary.status, summary.unrecorded) == ("SUCCESS", str(gap))
    assert len(said) == 1
    recorder.close()


def test_a_run_that_cannot_be_recorded_is_told_while_it_goes_on(
    tmp_path: Path, said: list[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    recorder, stream = Recorder(Wish(where=tmp_path / "file"), said.append), Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    (gap,) = until(unrecorded)
    assert (gap.summary.tree, gap.why) == ("tree", "File exists")
    end(stream)
    recorder.close()
    assert unrecorded() == []


def test_of_a_run_that_is_not_to_be_recorded_nothing_stays(said: list[str]) -> None:
    recorder, stream = Recorder(Wish(why_not="--no-record"), said.append), Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    (gap,) = until(unrecorded)
    assert str(gap).endswith(": --no-record")
    end(stream)
    until(lambda: not unrecorded())
    recorder.close()
    assert (said, home().exists(), list(directory().iterdir())) == ([], False, [])


def test_what_a_killed_process_left_is_not_told_and_goes_with_the_next(tmp_path: Path) -> None:
    summary = Summary("ab" * 16, "tree", time.time())
    with told(summary, 0.0, "--no-record"):
        (file,) = directory().iterdir()
        left = file.read_bytes()
        assert len(unrecorded()) == 1
    file.write_bytes(left)
    assert unrecorded() == []
    with told(replace(summary, run_id="cd" * 16), 0.0, "--no-record"):
        assert [each.name for each in directory().iterdir()] == ["cd" * 16 + ".unrecorded"]


def test_a_run_that_somebody_stopped_has_not_failed(recorder: Recorder, tmp_path: Path) -> None:
    stream = Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    stream.add(StopWanted, "CANCELED", "a client canceled it")
    stream.add(TreeFinished, Status.INVALID)
    stream.add(RunEnded, 20002)
    recorder.close()
    [run] = recorded(tmp_path)
    assert (run.summary.stopped_by, run.summary.failed) == ("CANCELED", False)


def test_nobody_who_tells_an_event_waits_for_the_disk(
    recorder: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on = threading.Event()
    write = os.write

    def slow(descriptor: int, data: bytes) -> int:
        goes_on.wait(30.0)
        return write(descriptor, data)

    monkeypatch.setattr(writing.os, "write", slow)
    stream = Stream(Clock())
    recorder.record(stream, lambda: None)
    begin(stream)
    for number in range(1000):
        stream.add(VariableWritten, "x", number, None)
    goes_on.set()  # not one of them has waited
    end(stream)
    recorder.close()
    assert Recording(recorded(tmp_path)[0].first).state().variables["x"].value == 999


@pytest.mark.slow
def test_a_kill_at_any_moment_loses_half_a_second_at_most(tmp_path: Path) -> None:
    """Twenty kills, or a hundred: ten processes at a time, each of which has told 200 events."""
    chance = random.Random(9)
    for _ in range(KILLS // 10):
        with contextlib.ExitStack() as stack:
            processes = []
            for _ in range(10):
                folder = tmp_path / str(chance.random())
                command = [sys.executable, "-m", "tests.support.recorded_process"]
                process = stack.enter_context(
                    subprocess.Popen(
                        [*command, str(folder), "100"],
                        cwd=ROOT,
                        stdout=subprocess.PIPE,
                        text=True,
                    )
                )
                stack.callback(process.kill)
                processes.append((folder, process))
            for folder, process in processes:
                assert process.stdout is not None
                end = 200 + chance.randrange(30)
                lines = [process.stdout.readline() for _ in range(end)]
                process.kill()
                told = [line.split() for line in (*lines, *process.stdout)]
                whole = [(int(each[0]), float(each[1])) for each in told if len(each) == 2]
                [run] = recorded(folder)
                kept = Recording(run.first).state().variables["x"].value
                assert isinstance(kept, int)
                lost = [at for number, at in whole if number > kept]
                assert not lost or whole[-1][1] - lost[0] < 0.5, (kept, whole[-1])
