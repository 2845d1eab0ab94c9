"""Goal ids tell which process chose them."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from bt_actions.utilities.ids import MACHINE, _name_of_machine, author_of, new_id

MAKE = "from bt_actions.utilities.ids import new_id; print(new_id().hex(), flush=True); input()"


def test_an_id_names_the_process_that_made_it_and_that_it_is_alive() -> None:
    author = author_of(new_id())
    assert author is not None
    assert (author.pid, author.here, author.alive) == (os.getpid(), True, True)


def test_ids_never_repeat_whatever_thread_makes_them() -> None:
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: new_id(), range(5000)))
    assert len(set(made)) == 5000
    assert {len(goal_id) for goal_id in made} == {16}


def test_the_author_of_a_killed_process_is_dead() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", MAKE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        author = author_of(bytes.fromhex(child.stdout.readline().strip()))
        assert author is not None
        assert author.pid == child.pid
        assert author.alive
        child.kill()
        child.wait()
        assert not author.alive


def test_a_pid_that_was_given_to_another_process_is_not_the_author() -> None:
    ours = bytearray(new_id())
    ours[10] ^= 0xFF
    author = author_of(bytes(ours))
    assert author is not None
    assert not author.alive


@pytest.mark.parametrize("error", [PermissionError, FileNotFoundError, OSError])
def test_a_process_that_cannot_be_looked_at_counts_as_alive(
    error: type[OSError], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(self: Path, **_: object) -> str:
        raise error

    author = author_of(new_id())
    assert author is not None
    monkeypatch.setattr(Path, "read_text", refused)
    monkeypatch.setattr("bt_actions.utilities.ids._machine", lambda: b"any")
    assert author.alive
    assert not replace(author, pid=2**22 + 1).alive, "no such process"


def test_an_id_from_another_machine_counts_as_alive() -> None:
    theirs = bytearray(new_id())
    theirs[3] ^= 0xFF
    author = author_of(bytes(theirs))
    assert author is not None
    assert not author.here
    assert author.alive


def test_a_name_of_its_own_makes_a_container_the_same_machine_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("bt_actions.utilities.ids._name_of_machine", lambda _: "of the first start")
    monkeypatch.setattr("bt_actions.utilities.ids._made_by", None)
    unnamed = new_id()
    monkeypatch.setenv(MACHINE, "arm 1")
    monkeypatch.setattr("bt_actions.utilities.ids._made_by", None)
    named = new_id()
    monkeypatch.setattr("bt_actions.utilities.ids._name_of_machine", lambda _: "of the second")
    monkeypatch.setattr("bt_actions.utilities.ids._made_by", None)
    assert [author_of(each).here for each in (unnamed, named)] == [False, True]  # type: ignore[union-attr]
    monkeypatch.setenv(MACHINE, "arm 2")
    assert not author_of(named).here  # type: ignore[union-attr]


def test_ids_that_others_chose_have_no_author() -> None:
    assert author_of(os.urandom(16)) is None
    assert author_of(b"short") is None


def test_another_namespace_of_pids_or_times_is_another_machine(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In each, what identifies a process here is another's, or nobody's."""
    ours = _name_of_machine.__wrapped__(0)
    real = Path.readlink
    for namespace in ("pid", "time"):
        monkeypatch.setattr(
            Path,
            "readlink",
            lambda path, name=namespace: Path(f"{name}:[7]") if path.name == name else real(path),
        )
        assert _name_of_machine.__wrapped__(0) != ours
