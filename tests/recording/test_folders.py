"""Where runs lie: which one is meant, and which are kept."""

from __future__ import annotations

import fcntl
import os
import shutil
import threading
from pathlib import Path

import pytest

from bt_actions.recording import folders
from bt_actions.recording.folders import (
    FIRST,
    NoRun,
    Summary,
    find,
    folder_for,
    held,
    home,
    is_written,
    prune,
    read_summary,
    recorded,
    summary_of,
    write_summary,
)
from bt_actions.recording.following import Follower


def made(
    where: Path,
    number: int,
    *,
    status: str = "SUCCESS",
    stopped_by: str = "",
    size: int = 100,
    tree: str = "tree",
    run_id: str = "",
) -> Path:
    """Make a run that began at second `number`."""
    run_id = run_id or f"{number:032x}"[::-1]
    folder = folder_for(run_id, tree, 1.8e9 + number, where)
    first = folder / FIRST
    first.write_bytes(bytes(size))
    write_summary(
        first, Summary(run_id, tree, 1.8e9 + number, status=status, stopped_by=stopped_by)
    )
    return first


def numbers(where: Path) -> list[int]:
    """Which runs are left."""
    return sorted(round(run.summary.began - 1.8e9) for run in recorded(where))


def test_runs_lie_in_the_state_directory_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/somewhere")
    assert home() == Path("/somewhere/bt_actions/runs")
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/home/me")
    assert home() == Path("/home/me/.local/state/bt_actions/runs")


def test_the_last_of_each_kind_are_kept(tmp_path: Path) -> None:
    for number in range(6):
        made(tmp_path, number)
        made(tmp_path, 100 + number, status="FAILURE")
        made(tmp_path, 200 + number, status="")
    gone = prune(tmp_path, succeeded=2, failed=8)
    assert numbers(tmp_path) == [4, 5, 104, 105, *range(200, 206)]
    assert len(gone) == 8


def test_a_run_that_somebody_stopped_counts_with_those_that_succeeded(tmp_path: Path) -> None:
    for number, who in enumerate(["SIGINT", "CANCELED", "REPLACED", "HALTED"]):
        made(tmp_path, number, status="INVALID", stopped_by=who)
    made(tmp_path, 10, status="INVALID", stopped_by="TIMEOUT")
    prune(tmp_path, succeeded=1, failed=1)
    assert numbers(tmp_path) == [3, 10]


def test_all_together_are_bounded_in_bytes(tmp_path: Path) -> None:
    for number in range(5):
        made(tmp_path, number, size=1000)
    prune(tmp_path, size=3500)
    assert numbers(tmp_path) == [2, 3, 4]


def test_what_is_written_or_followed_is_never_removed(tmp_path: Path) -> None:
    followed, written = made(tmp_path, 1), made(tmp_path, 2)
    made(tmp_path, 3)
    with held(followed.parent), held(written, alone=True):
        prune(tmp_path, succeeded=0)
        assert numbers(tmp_path) == [1, 2]
    prune(tmp_path, succeeded=0)
    assert numbers(tmp_path) == []


def test_a_folder_that_cannot_be_looked_into_hides_no_other_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stat(path: Path, **options: bool) -> os.stat_result:
        if path == other / FIRST:
            raise PermissionError(13, "Permission denied", str(path))
        return real(path, **options)

    real = Path.stat
    other = tmp_path / "of another user"
    other.mkdir()
    for number in range(3):
        made(tmp_path, number)
    monkeypatch.setattr(Path, "stat", stat)
    assert len(recorded(tmp_path)) == 3
    assert len(prune(tmp_path, succeeded=1)) == 2


def test_a_run_that_somebody_else_removes_meanwhile_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def removed(first: Path) -> None:
        shutil.rmtree(first.parent)

    made(tmp_path, 1)
    monkeypatch.setattr(folders, "read_summary", removed)
    assert recorded(tmp_path) == []
    monkeypatch.undo()
    first = made(tmp_path, 2)
    [run] = recorded(tmp_path)
    monkeypatch.setattr(folders, "parts_of", lambda first: [first, first.with_name("gone.mcap")])
    monkeypatch.setattr(Path, "exists", lambda path: True)
    assert run.size == first.stat().st_size


def test_what_lies_there_and_is_no_run_stays(tmp_path: Path) -> None:
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("keep this")
    (tmp_path / "link").symlink_to(tmp_path / "notes")
    prune(tmp_path, succeeded=0, failed=0)
    assert (tmp_path / "notes" / "mine.txt").exists()


@pytest.mark.parametrize(
    "data", [b"", b"{", b"[]", b'{"began": "soon"}', b"\xff" * 99, b"[" * 9999]
)
def test_a_summary_that_is_none_costs_what_it_says(tmp_path: Path, data: bytes) -> None:
    first = made(tmp_path, 1)
    summary_of(first).write_bytes(data)
    assert read_summary(first) is None
    [run] = recorded(tmp_path)
    assert (run.summary.tree, run.summary.failed) == ("tree", True)


def test_a_summary_shows_nothing_that_a_terminal_obeys(tmp_path: Path) -> None:
    first = made(tmp_path, 1, tree="a")
    write_summary(first, Summary("00", "\x1b[31mred\n", 1.0, cause="\x07\u202e"))
    summary = read_summary(first)
    assert summary is not None
    assert (summary.tree, summary.cause.strip()) == (" [31mred ", "")


class TestLocks:
    def test_those_who_ask_whether_a_run_is_written_do_not_see_each_other(
        self, tmp_path: Path
    ) -> None:
        first = made(tmp_path, 1)
        with held(first) as is_free:
            assert is_free
            assert not is_written(first)
        with held(first, alone=True):
            assert is_written(first)

    def test_an_error_within_comes_out_as_it_is(self, tmp_path: Path) -> None:
        with pytest.raises(BlockingIOError, match="full"), held(tmp_path):
            raise BlockingIOError("full")

    def test_a_reader_waits_for_whoever_removes_the_run(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        first, order, asks, flock = made(tmp_path, 1), list[str](), threading.Event(), fcntl.flock

        def asked(descriptor: int, how: int) -> None:
            asks.set()
            flock(descriptor, how)

        def follow() -> None:
            with Follower(first):
                order.append("followed")

        reader = threading.Thread(target=follow)
        with held(first.parent, alone=True):
            monkeypatch.setattr(fcntl, "flock", asked)
            reader.start()
            assert asks.wait(10.0)
            reader.join(0.1)  # one that does not wait is done by then
            order.append("removed")
        reader.join()
        assert order == ["removed", "followed"]


class TestFind:
    def test_without_a_text_the_newest_is_meant(self, tmp_path: Path) -> None:
        made(tmp_path, 1)
        newest = made(tmp_path, 2)
        assert find("", tmp_path) == newest

    def test_the_first_letters_of_an_id(self, tmp_path: Path) -> None:
        one = made(tmp_path, 1, run_id="abcd" * 8)
        made(tmp_path, 2, run_id="abce" * 8)
        assert find("abcd", tmp_path) == one
        with pytest.raises(NoRun, match="abc begins 2 ids"):
            find("abc", tmp_path)

    def test_a_tree_means_its_newest_run(self, tmp_path: Path) -> None:
        made(tmp_path, 1, tree="patrol")
        newest = made(tmp_path, 2, tree="patrol")
        made(tmp_path, 3, tree="other")
        assert find("patrol", tmp_path) == newest

    def test_a_path_is_a_file_or_a_folder(self, tmp_path: Path) -> None:
        first = made(tmp_path, 1)
        assert find(str(first)) == first
        assert find(str(first.parent)) == first
        (tmp_path / "bag").mkdir()
        (tmp_path / "bag" / "bag_0.mcap").touch()
        assert find(str(tmp_path / "bag")) == tmp_path / "bag" / "bag_0.mcap"

    def test_a_file_that_lies_here_is_meant_and_not_a_tree_of_its_name(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        made(tmp_path, 1, tree="README.md")
        (tmp_path / "README.md").touch()
        assert find("README.md", tmp_path) == Path("README.md")

    def test_a_folder_that_lies_here_is_meant_where_it_holds_a_recording(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        bag, patrol = Path("my_bag"), Path("patrol")
        for each in (bag, patrol):
            each.mkdir()
        (bag / "bag_0.mcap").touch()
        assert find("my_bag", tmp_path) == bag / "bag_0.mcap"
        newest = made(tmp_path, 1, tree="patrol")
        assert find("patrol", tmp_path) == newest

    def test_what_there_is_not_is_said_with_what_is_near(self, tmp_path: Path) -> None:
        with pytest.raises(NoRun, match="no run is recorded yet"):
            find("", tmp_path)
        made(tmp_path, 1, tree="patrol")
        with pytest.raises(NoRun, match="did you mean 'patrol'"):
            find("patrool", tmp_path)
        with pytest.raises(NoRun, match="is no recording"):
            find(f"{tmp_path}/none")


def test_the_folder_of_a_run_stays_below_the_others_whatever_its_tree_is_called(
    tmp_path: Path,
) -> None:
    for name in ("../../etc", "/", "a" * 500, "", "\x00\n", "ä/b"):
        folder = folder_for(os.urandom(16).hex(), name, 1.8e9, tmp_path)
        assert folder.parent == tmp_path
        assert folder.is_dir()
