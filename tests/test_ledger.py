"""The record of what was sent and is not answered yet."""

from __future__ import annotations

import errno
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bt_actions.goals.ids import new_goal_id
from bt_actions.recovery import ledger as module
from bt_actions.recovery.ledger import KEPT_FOR, LENGTH, Ledger, Sent, left_behind
from bt_actions.traffic.state import Entry
from tests.support import records

SERVERS = frozenset({b"a" * 16, b"b" * 16})
LEAVES = """
import os, sys
from bt_actions.goals.ids import new_goal_id
from bt_actions.recovery.ledger import Ledger
from bt_actions.traffic.state import Entry
ledger, ids = Ledger(print), [new_goal_id() for _ in range(4)]
for number, goal_id in enumerate(ids):
    servers = frozenset({b"a" * 16})
    ledger.enter(goal_id, Entry(f"/robot_{number}/move", number, servers, accept=60.0))
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


def on_record(directory: Path) -> list[Any]:
    """What is there."""
    [path] = directory.iterdir()
    return records.on_record(path)


troubles: list[OSError] = []
"""What could not be read in this test."""


def die() -> list[str]:
    """Run LEAVES; return the ids of its goals."""
    gone = subprocess.run([sys.executable, "-c", LEAVES], capture_output=True, text=True)
    assert gone.returncode == 1, gone.stderr
    return gone.stdout.split()


def found() -> list[Sent]:
    """All that the dead have left."""
    every = list(left_behind())
    troubles.extend(each for each in every if isinstance(each, OSError))
    return [each for each in every if isinstance(each, Sent)]


def test_what_a_dead_process_left_is_found(directory: Path) -> None:
    ids = die()
    seen = [(sent.goal_id.hex(), sent.action, sent.domain, sent.servers) for sent in found()]
    servers = frozenset({b"a" * 16})
    assert seen == [(ids[n], f"/robot_{n}/move", n, servers) for n in (0, 2, 3)]
    assert {sent.accept for sent in found()} == {60.0}
    assert {sent.author.pid for sent in found()} == {int(ids[0][12:20], 16)}


def test_what_is_struck_is_not_found_again(directory: Path) -> None:
    ids = die()
    first, *others = found()
    first.strike()
    assert [sent.goal_id.hex() for sent in found()] == [ids[2], ids[3]]
    for sent in others:
        sent.strike()
    assert list(directory.iterdir()) == []


def test_that_a_server_is_not_in_sight_is_kept() -> None:
    ids = die()
    found()[1].mark_lost()
    assert [(sent.goal_id.hex(), sent.lost) for sent in found()] == [
        (ids[0], False),
        (ids[2], True),
        (ids[3], False),
    ]


def test_nothing_is_found_of_who_is_alive(ledger: Ledger, directory: Path) -> None:
    ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
    assert len(on_record(directory)) == 1
    assert found() == []


def test_what_was_read_before_is_passed_over() -> None:
    die()
    assert list(left_behind({found()[0].path})) == []


def test_what_more_is_known_of_a_goal_takes_its_place(ledger: Ledger, directory: Path) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, Entry("/move", 0, SERVERS, lost=True))
    assert goal_id in ledger
    ledger.enter(goal_id, Entry("/move", 0, frozenset(), accept=1e9))
    [entry] = on_record(directory)
    assert (entry["servers"], entry["lost"], entry["accept"]) == ([], False, KEPT_FOR)
    ledger.strike(goal_id)
    assert goal_id not in ledger
    assert on_record(directory) == []


def test_the_child_of_a_fork_leaves_its_parents_file_alone(ledger: Ledger, directory: Path) -> None:
    goal_id = new_goal_id()
    ledger.enter(goal_id, Entry("/move", 0, SERVERS))
    child = os.fork()
    if not child:
        ledger.disown()
        ledger.strike(goal_id)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert on_record(directory)
    ledger.strike(goal_id)
    assert not on_record(directory)


def test_without_room_it_complains_once_and_the_goal_goes_on(
    ledger: Ledger, complaints: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module.os, "posix_fallocate", fail)
    for _ in range(3):
        ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
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
    ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
    ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
    assert len(complaints) == 1
    assert found() == []
    assert [trouble.filename for trouble in troubles] == [str(directory)]
    if directory.is_dir():
        assert list(directory.iterdir()) == []


def test_where_nobody_has_sent_anything_there_is_nothing_to_read(directory: Path) -> None:
    assert not directory.exists()
    assert found() == []


def test_a_directory_that_depends_on_where_one_stands_is_refused(
    ledger: Ledger, complaints: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(module.DIRECTORY, "records")
    ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
    assert "no absolute path" in complaints[0]
    assert found() == []
    assert [trouble.filename for trouble in troubles] == ["records"]


ENTRY = {"action": "/a", "domain": 0, "servers": [], "accept": 0.0, "lost": False}
WRONG = (
    {"accept": math.inf}, {"accept": "x"}, {"accept": -1}, {"action": ["x"]}, {"domain": "0"},
    {"goal": 1}, {"goal": "00" * 16},
)  # fmt: skip
DEAD = new_goal_id()[:6] + (2**22 + 1).to_bytes(4, "big") + b"ab"


def put(directory: Path, *texts: bytes) -> None:
    """Have these on record of a dead process."""
    directory.mkdir(mode=0o700, parents=True)
    text = b"".join(each.ljust(LENGTH) if each else b"\0" * LENGTH for each in texts)
    (directory / f"{DEAD.hex()}.goals").write_bytes(text)


def entry(number: int, **other: Any) -> bytes:
    """What is on record of a goal of that process."""
    return json.dumps({"goal": (DEAD + bytes([0, 0, 0, number])).hex(), **ENTRY, **other}).encode()


NONSENSE = [b"nonsense", b"[" * 1000, b'"goal"', b"[]", b"\xff\xfe", b'{"goal": ']


@pytest.mark.parametrize(
    "text",
    [*NONSENSE, *(entry(1, **wrong) for wrong in WRONG)],
    ids=["a word", "deep", "a text", "a list", "no text", "cut off", *map(str, WRONG)],
)
def test_what_makes_no_sense_is_told_and_hides_no_other(text: bytes, directory: Path) -> None:
    put(directory, entry(0), text, entry(2))
    assert [sent.goal_id[-1] for sent in found()] == [0, 2]
    [trouble] = troubles
    assert "damaged" in str(trouble)


def test_who_was_killed_before_it_wrote_had_sent_nothing(directory: Path) -> None:
    put(directory, b"", entry(1))
    assert [sent.goal_id[-1] for sent in found()] == [1]
    assert troubles == []


def test_what_cannot_be_read_is_told(directory: Path) -> None:
    put(directory, entry(0))
    (directory / f"{(DEAD[:-1] + b'a').hex()}.goals").mkdir()
    (directory / "nonsense.goals").touch()
    (directory / "00.goals").touch()
    assert [sent.goal_id[-1] for sent in found()] == [0]
    assert [type(trouble) for trouble in troubles] == [IsADirectoryError]


@pytest.mark.parametrize("why", ["it is old", "nothing is on it"])
def test_the_next_process_removes_what_nobody_wants(
    why: str, ledger: Ledger, directory: Path
) -> None:
    die()
    [dead] = directory.iterdir()
    if why == "it is old":
        past = time.time() - KEPT_FOR - 1.0
        os.utime(dead, (past, past))
    else:
        dead.write_bytes(b"\0" * LENGTH)
    ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
    assert dead not in directory.iterdir()
    assert len(on_record(directory)) == 1


def test_who_ends_leaves_nothing_unless_a_goal_is_open(ledger: Ledger, directory: Path) -> None:
    answered, is_open = new_goal_id(), new_goal_id()
    ledger.enter(answered, Entry("/move", 0, SERVERS))
    ledger.enter(is_open, Entry("/move", 0, SERVERS))
    ledger.strike(answered)
    ledger.close()
    assert [each["goal"] for each in on_record(directory)] == [is_open.hex()]
    ledger.enter(answered, Entry("/move", 0, SERVERS))
    assert len(on_record(directory)) == 2
    ledger.strike(answered)
    ledger.close()
    assert len(on_record(directory)) == 1


def test_a_file_is_as_old_as_what_is_on_it(
    ledger: Ledger, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
    [path] = directory.iterdir()
    os.utime(path, (0.0, 0.0))
    monkeypatch.setattr(ledger, "_touched_at", 0.0)
    ledger.enter(new_goal_id(), Entry("/move", 0, SERVERS))
    assert time.time() - path.stat().st_mtime < KEPT_FOR
    path.unlink()  # as who logs out may have all of /dev/shm removed
    monkeypatch.setattr(ledger, "_touched_at", 0.0)
    ledger.enter(new_goal_id(), Entry("/move", 1, SERVERS))
    assert [each["domain"] for each in on_record(directory)] == [1]


def test_what_is_elsewhere_is_told_apart(directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    die()
    assert {sent.author.here for sent in found()} == {True}
    monkeypatch.setenv("BT_ACTIONS_MACHINE", "another")
    assert {sent.author.here for sent in found()} == {False}
