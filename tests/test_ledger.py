"""The record of what was sent and is not answered yet."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from bt_actions.goals.ids import new_goal_id
from bt_actions.recovery import ledger as module
from bt_actions.recovery.ledger import (
    KEPT_FOR,
    LENGTH,
    ROWS_AT_MOST,
    SERVERS_AT_MOST,
    TIDIED_AT_MOST,
    Ledger,
    Sent,
    left_behind,
    mark_lost,
    strike_left,
)

SERVERS = frozenset({b"a" * 16, b"b" * 16})
LEAVES = """
import os, sys
from bt_actions.goals.ids import new_goal_id
from bt_actions.recovery.ledger import Ledger
ledger, ids = Ledger(print), [new_goal_id() for _ in range(4)]
for number, goal_id in enumerate(ids):
    ledger.enter(goal_id, f"/robot_{number}/move", number, [b"a" * 16], accept=60.0)
ledger.strike(ids[1])
print(*(goal_id.hex() for goal_id in ids), flush=True)
os._exit(1)
"""
"""A process that is gone while three of its four goals are without an answer."""


@pytest.fixture(autouse=True)
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the records are."""
    troubles.clear()
    path = tmp_path / "records" / "here"
    monkeypatch.setenv(module.DIRECTORY, str(path))
    return path


@pytest.fixture
def complaints() -> list[str]:
    """What the ledger complains of."""
    return []


@pytest.fixture
def ledger(complaints: list[str]) -> Iterator[Ledger]:
    """This process's."""
    ours = Ledger(complaints.append)
    yield ours
    ours.disown()


troubles: list[OSError] = []
"""What could not be read in this test."""


def die() -> list[str]:
    """Run LEAVES; return the ids of its goals."""
    gone = subprocess.run([sys.executable, "-c", LEAVES], capture_output=True, text=True)
    assert gone.returncode == 1, gone.stderr
    return gone.stdout.split()


def found() -> list[Sent]:
    """All that the dead have left."""
    return [sent for _, goals in left_behind(troubles.append) for sent in goals]


def rows(directory: Path) -> list[str]:
    """The rows of the only file that are not blank."""
    (path,) = directory.iterdir()
    text = path.read_text()
    return [text[at : at + LENGTH] for at in range(0, len(text), LENGTH) if text[at] == "{"]


def test_what_a_dead_process_left_is_found(directory: Path) -> None:
    ids = die()
    seen = [(sent.goal_id.hex(), sent.action, sent.domain, sent.servers) for sent in found()]
    servers = frozenset({b"a" * 16})
    assert seen == [(ids[n], f"/robot_{n}/move", n, servers) for n in (0, 2, 3)]
    assert {sent.accept for sent in found()} == {60.0}
    assert {sent.author.pid for sent in found()} == {int(ids[0][12:20], 16)}


def test_what_is_struck_is_not_found_again_and_the_last_takes_the_file_away(
    directory: Path,
) -> None:
    ids = die()
    first, *others = found()
    strike_left([first])
    assert [sent.goal_id.hex() for sent in found()] == [ids[2], ids[3]]
    strike_left(others)
    assert list(directory.iterdir()) == []


def test_that_a_server_is_not_in_sight_is_kept() -> None:
    ids = die()
    mark_lost(found()[1:2])
    assert [(sent.goal_id.hex(), sent.lost) for sent in found()] == [
        (ids[0], False),
        (ids[2], True),
        (ids[3], False),
    ]


def test_a_file_is_passed_over() -> None:
    die()
    ((path, _),) = left_behind(troubles.append)
    assert list(left_behind(troubles.append, {path})) == []


def test_nothing_is_found_of_who_is_alive(ledger: Ledger, directory: Path) -> None:
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert len(list(directory.iterdir())) == 1
    assert found() == []


def test_an_answer_blanks_the_line_which_the_next_goal_gets(
    ledger: Ledger, directory: Path
) -> None:
    first, second, third = (new_goal_id() for _ in range(3))
    ledger.enter(first, "/move", 0, SERVERS)
    ledger.enter(second, "/move", 0, SERVERS)
    ledger.strike(first)
    ledger.enter(third, "/move", 0, SERVERS)
    (path,) = directory.iterdir()
    assert path.stat().st_size == 2 * LENGTH
    entries = [json.loads(line)["goal"] for line in path.read_text().splitlines()]
    assert entries == [third.hex(), second.hex()]


def test_what_more_is_known_of_a_goal_takes_its_line(ledger: Ledger, directory: Path) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, "/move", 0, [])
    assert goal_id in ledger
    ledger.enter(goal_id, "/move", 0, SERVERS, lost=True)
    (path,) = directory.iterdir()
    (line,) = path.read_text().splitlines()
    assert json.loads(line)["servers"] == ["61" * 16, "62" * 16]
    assert json.loads(line)["lost"] is True


def test_the_file_goes_when_nothing_is_on_record(ledger: Ledger, directory: Path) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, "/move", 0, SERVERS)
    ledger.close()
    assert len(list(directory.iterdir())) == 1, "there is an open goal"
    ledger.strike(goal_id)
    ledger.close()
    assert list(directory.iterdir()) == []
    ledger.enter(goal_id, "/move", 0, SERVERS)
    assert len(list(directory.iterdir())) == 1


def test_the_child_of_a_fork_leaves_its_parents_file_alone(ledger: Ledger, directory: Path) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, "/move", 0, SERVERS)
    child = os.fork()
    if not child:
        ledger.disown()
        ledger.strike(goal_id)
        ledger.close()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert rows(directory)
    ledger.strike(goal_id)
    assert not rows(directory)


def test_a_goal_of_the_child_has_a_file_of_its_own(ledger: Ledger, directory: Path) -> None:
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    child = os.fork()
    if not child:
        ledger.disown()
        ledger.enter(new_goal_id(), "/child", 0, SERVERS)
        os._exit(0)
    os.waitpid(child, 0)
    assert [sent.action for sent in found()] == ["/child"]


def test_no_more_than_so_many_are_on_record_and_that_is_told(
    ledger: Ledger, complaints: list[str], directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ROWS_AT_MOST", 2)
    ids = [new_goal_id() for _ in range(3)]
    for goal_id in ids:
        ledger.enter(goal_id, "/move", 0, SERVERS)
    assert len(rows(directory)) == 2
    assert len(complaints) == 1
    ledger.strike(ids[2])
    ledger.strike(ids[0])
    assert len(rows(directory)) == 1


def test_without_room_it_complains_once_and_the_goal_goes_on(
    ledger: Ledger, complaints: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module.os, "pwrite", lambda *_: 100)
    for _ in range(3):
        ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    (complaint,) = complaints
    assert "No space left on device" in complaint


@pytest.mark.parametrize("obstacle", ["a file", "a link", "open to others", "another user's"])
def test_a_directory_that_others_may_have_made_is_not_used(
    obstacle: str,
    ledger: Ledger,
    complaints: list[str],
    directory: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    directory.parent.mkdir()
    if obstacle == "a file":
        directory.touch()
    elif obstacle == "a link":
        (tmp_path / "elsewhere").mkdir()
        directory.symlink_to(tmp_path / "elsewhere")
    else:
        directory.mkdir()
        if obstacle == "open to others":
            directory.chmod(0o777)
        else:
            somebody = os.geteuid() + 1
            monkeypatch.setattr(module.os, "geteuid", lambda: somebody)
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert len(complaints) == 1
    assert found() == []
    assert [trouble.filename for trouble in troubles] == [str(directory)]
    if directory.is_dir():
        assert list(directory.iterdir()) == []


def test_where_nobody_has_sent_anything_there_is_nothing_to_read(directory: Path) -> None:
    assert not directory.exists()
    assert found() == []


def test_a_record_that_cannot_be_read_is_no_empty_one_and_hides_no_other(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = [die(), die()]
    real, sooner = module._read, min(directory.iterdir())

    def fail(path: Path) -> bytes:
        if path == sooner:
            raise OSError(24, "Too many open files")
        return real(path)

    monkeypatch.setattr(module, "_read", fail)
    [other] = [each for each in ids if not sooner.name.startswith(each[0][:24])]
    assert [sent.goal_id.hex() for sent in found()] == [other[0], other[2], other[3]]
    assert [trouble.strerror for trouble in troubles] == ["Too many open files"]


def test_what_cannot_be_opened_once_is_tried_again(
    ledger: Ledger, complaints: list[str], directory: Path
) -> None:
    directory.parent.mkdir()
    directory.touch()
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert len(complaints) == 1
    directory.unlink()
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert len(rows(directory)) == 1
    assert len(complaints) == 1


def test_a_file_that_somebody_removes_is_written_again(ledger: Ledger, directory: Path) -> None:
    """As systemd does with all of a user's /dev/shm, when that user has logged out."""
    first, second = new_goal_id(), new_goal_id()
    ledger.enter(first, "/move", 0, SERVERS)
    shutil.rmtree(directory)
    ledger.enter(second, "/move", 0, SERVERS)
    assert [json.loads(row)["goal"] for row in rows(directory)] == [first.hex(), second.hex()]
    ledger.strike(first)
    assert [json.loads(row)["goal"] for row in rows(directory)] == [second.hex()]


def test_who_has_replaced_a_program_goes_on_behind_what_that_has_left(
    ledger: Ledger, directory: Path
) -> None:
    """After exec the process is the same, and so is the name of its file."""
    first, second = new_goal_id(), new_goal_id()
    ledger.enter(first, "/move", 0, SERVERS)
    ledger.disown()
    ledger.enter(second, "/move", 0, SERVERS)
    assert [json.loads(row)["goal"] for row in rows(directory)] == [first.hex(), second.hex()]
    ledger.strike(second)
    ledger.close()
    assert [json.loads(row)["goal"] for row in rows(directory)] == [first.hex()]


def test_a_file_that_cannot_be_written_again_at_once_is_later(
    ledger: Ledger, complaints: list[str], directory: Path
) -> None:
    first, second, third = (new_goal_id() for _ in range(3))
    ledger.enter(first, "/move", 0, SERVERS)
    shutil.rmtree(directory)
    directory.touch()
    ledger.enter(second, "/move", 0, SERVERS)
    assert len(complaints) == 1
    directory.unlink()
    ledger.enter(third, "/move", 0, SERVERS)
    assert [json.loads(row)["goal"] for row in rows(directory)] == [first.hex(), third.hex()]


def test_what_cannot_be_added_does_not_take_a_goal_off(
    ledger: Ledger, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, "/move", 0, SERVERS)
    with monkeypatch.context() as patch:
        patch.setattr(module.os, "pwrite", lambda *_: 0)
        ledger.enter(goal_id, "/move", 0, SERVERS, lost=True)
    assert [json.loads(row)["lost"] for row in rows(directory)] == [False]
    ledger.strike(goal_id)
    assert rows(directory) == []


@pytest.mark.parametrize("reused", [True, False])
def test_who_closes_its_descriptor_loses_neither_the_record_nor_a_file_of_his(
    reused: bool, ledger: Ledger, complaints: list[str], directory: Path, tmp_path: Path
) -> None:
    first, second = new_goal_id(), new_goal_id()
    ledger.enter(first, "/move", 0, SERVERS)
    number = ledger._file
    assert number is not None
    os.close(number)
    theirs = tmp_path / "theirs"
    theirs.write_text("theirs")
    if reused:
        other = os.open(theirs, os.O_RDWR)
        assert other == number
    ledger.enter(second, "/move", 0, SERVERS)
    ledger.strike(second)
    if reused:
        assert os.pread(number, 100, 0) == b"theirs"
        os.close(number)
    assert theirs.read_text() == "theirs"
    assert [json.loads(row)["goal"] for row in rows(directory)] == [first.hex()]
    assert complaints == []


def test_to_strike_a_goal_writes_nothing_into_a_file_of_others(
    ledger: Ledger, directory: Path, tmp_path: Path
) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, "/move", 0, SERVERS)
    number = ledger._file
    assert number is not None
    os.close(number)
    theirs = tmp_path / "theirs"
    theirs.write_text("theirs")
    other = os.open(theirs, os.O_RDWR)
    assert other == number
    ledger.strike(goal_id)
    ledger.disown()
    assert os.pread(other, 100, 0) == b"theirs"
    os.close(other)


def test_a_directory_that_depends_on_where_one_stands_is_refused(
    ledger: Ledger, complaints: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(module.DIRECTORY, "records")
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert "no absolute path" in complaints[0]
    assert found() == []
    assert [trouble.filename for trouble in troubles] == ["records"]


def test_nothing_is_written_through_a_link(
    ledger: Ledger, complaints: list[str], directory: Path, tmp_path: Path
) -> None:
    goal_id = new_goal_id()
    directory.mkdir(mode=0o700, parents=True)
    (tmp_path / "elsewhere").touch()
    (directory / f"{goal_id[:12].hex()}.goals").symlink_to(tmp_path / "elsewhere")
    ledger.enter(goal_id, "/move", 0, SERVERS)
    assert len(complaints) == 1
    assert (tmp_path / "elsewhere").read_bytes() == b""


def test_of_many_servers_none_is_on_record(ledger: Ledger, directory: Path) -> None:
    many = [bytes([number]) * 16 for number in range(SERVERS_AT_MOST + 1)]
    ledger.enter(new_goal_id(), "/" + "m" * 254, 0, many[:-1])
    ledger.enter(new_goal_id(), "/" + "m" * 254, 0, many)
    assert [len(json.loads(row)["servers"]) for row in rows(directory)] == [SERVERS_AT_MOST, 0]


def test_what_does_not_fit_is_not_on_record(ledger: Ledger, complaints: list[str]) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, "/" + "m" * LENGTH, 0, SERVERS)
    assert goal_id not in ledger
    assert len(complaints) == 1


@pytest.mark.parametrize(
    "text",
    [b"nonsense", b"[" * 1000, b'"goal"', b"[]", b"\0" * LENGTH, b"\xff\xfe", b'{"goal": '],
    ids=["a word", "deep", "a text", "a list", "zeros", "no text", "cut off"],
)
def test_what_is_no_row_is_skipped(text: bytes, directory: Path) -> None:
    ids = die()
    (path,) = directory.iterdir()
    good = path.read_bytes()[2 * LENGTH : 3 * LENGTH]
    path.write_bytes(text.ljust(LENGTH) + good)
    assert [sent.goal_id.hex() for sent in found()] == [ids[2]]
    assert [trouble.filename for trouble in troubles] == [str(path)]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("goal", 3),
        ("goal", "00"),
        ("goal", "of another process"),
        ("goal", "too long"),
        ("domain", "0"),
        ("domain", True),
        ("action", "/" + "a" * 255),
        ("action", "relative"),
        ("action", "/a\n"),
        ("action", "/\x1b[2J"),
        ("action", ["/a"]),
        ("servers", 3),
        ("servers", ["x"]),
        ("lost", 0),
        ("at", "x"),
        ("at", 10**400),
        ("at", float("nan")),
        ("at", float("inf")),
        ("accept", "no"),
        ("accept", -1.0),
        ("accept", float("nan")),
        ("accept", 1e6),
        *((key, None) for key in ("goal", "domain", "action", "servers", "lost", "at", "accept")),
    ],
)
def test_a_row_with_a_wrong_field_is_skipped(key: str, value: object, directory: Path) -> None:
    ids = die()
    (path,) = directory.iterdir()
    text = path.read_bytes()
    first, good = text[:LENGTH], text[2 * LENGTH : 3 * LENGTH]
    entry = json.loads(first)
    if value == "of another process":
        value = ids[0][:20] + "ffff" + ids[0][24:]
    elif value == "too long":
        value = ids[0] + "00"
    bad = entry | {key: value} if value is not None else entry.keys() - {key}
    given = bad if isinstance(bad, dict) else {name: entry[name] for name in bad}
    path.write_bytes(json.dumps(given).encode().ljust(LENGTH) + good)
    assert [sent.goal_id.hex() for sent in found()] == [ids[2]]


def test_no_more_is_read_than_is_ever_written(directory: Path) -> None:
    die()
    (path,) = directory.iterdir()
    good = path.read_bytes()[:LENGTH]
    path.write_bytes(good * (ROWS_AT_MOST + 10))
    assert len(found()) == ROWS_AT_MOST


def test_what_is_no_file_of_ours_is_not_opened(directory: Path, tmp_path: Path) -> None:
    die()
    (path,) = directory.iterdir()
    text = path.read_bytes()
    path.unlink()
    (tmp_path / "elsewhere").write_bytes(text)
    path.symlink_to(tmp_path / "elsewhere")
    os.mkfifo(directory / f"{changed(path).name}")
    (directory / "nonsense.goals").write_bytes(text)
    (directory / "00.goals").write_bytes(text)
    assert found() == []


def changed(path: Path) -> Path:
    """The file of another dead process."""
    return path.with_stem(path.stem[:-1] + ("0" if path.stem[-1] != "0" else "1"))


def test_the_next_process_removes_what_is_over_and_what_nobody_wants(
    ledger: Ledger, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    die()
    (old,) = directory.iterdir()
    later = time.clock_gettime(time.CLOCK_BOOTTIME) + KEPT_FOR
    with monkeypatch.context() as patch:
        patch.setattr(module, "_boot_time", lambda: later - 60.0)
        ledger.enter(new_goal_id(), "/move", 0, SERVERS)
        assert old.exists()
        ledger.disown()
        patch.setattr(module, "_boot_time", lambda: later + 60.0)
        ledger.enter(new_goal_id(), "/move", 0, SERVERS)
        assert not old.exists()
        ledger.disown()
    shutil.rmtree(directory)
    die()
    (recent,) = directory.iterdir()
    blank = changed(recent)
    damaged = recent.with_stem(recent.stem[:-2] + ("00" if recent.stem[-2] != "0" else "11"))
    blank.write_bytes(b" " * LENGTH)
    damaged.write_bytes(b"a newer form")
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert recent.exists()
    assert damaged.exists()
    assert not blank.exists()


@pytest.mark.parametrize("clock", ["another machine's", "set back by a start", "damaged"])
def test_whose_age_no_clock_of_ours_tells_is_removed_by_that_of_its_file(
    clock: str, ledger: Ledger, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    die()
    (path,) = directory.iterdir()
    if clock == "another machine's":
        monkeypatch.setenv("BT_ACTIONS_MACHINE", "another")
    elif clock == "damaged":
        path.write_bytes(b"a newer form")
    later = 1.0 if clock == "set back by a start" else 1e9
    monkeypatch.setattr(module, "_boot_time", lambda: later)
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert path.exists()
    ledger.disown()
    past = time.time() - KEPT_FOR - 1.0
    os.utime(path, (past, past))
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert not path.exists()


def test_it_does_not_look_at_all_of_many(ledger: Ledger, directory: Path) -> None:
    die()
    (path,) = directory.iterdir()
    for number in range(TIDIED_AT_MOST + 10):
        path.with_stem(f"{path.stem[:-2]}{number:02x}").write_bytes(b"")
    before = len(list(directory.iterdir()))
    ledger.enter(new_goal_id(), "/move", 0, SERVERS)
    assert before - len(list(directory.iterdir())) < TIDIED_AT_MOST


def test_what_is_elsewhere_is_told_apart(directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    die()
    assert {sent.author.here for sent in found()} == {True}
    monkeypatch.setenv("BT_ACTIONS_MACHINE", "another")
    assert {sent.author.here for sent in found()} == {False}
