"""Who runs a tree is told, once, of goals that a process which has died left running there."""

from __future__ import annotations

import pytest

from bt_actions.goals.ids import Author, new_goal_id
from bt_actions.traffic.endpoint import warn_of_dead


def of_the_dead() -> bytes:
    """An id that this process would have made, had it begun at another moment."""
    made = bytearray(new_goal_id())
    made[10] ^= 0xFF
    return bytes(made)


class Said(list[str]):
    """A log that keeps what is said."""

    info = warning = error = list.append


@pytest.fixture
def said() -> Said:
    return Said()


def test_a_goal_of_the_dead_is_named_once_though_statuses_of_two_servers_take_turns(
    said: Said,
) -> None:
    told, left = set[bytes](), of_the_dead()
    for running in ({left}, {left}, set[bytes](), {left}):
        warn_of_dead("/move", running, told, said)
    [line] = said
    assert line.startswith("/move: a goal of process ")
    assert "`bt-actions cleanup`" in line
    assert left.hex() in line


def test_goals_of_the_living_and_of_other_clients_are_nobodys_concern(said: Said) -> None:
    elsewhere = bytearray(of_the_dead())
    elsewhere[3] ^= 0xFF
    warn_of_dead("/move", {new_goal_id(), bytes(16), b"", bytes(elsewhere)}, set(), said)
    assert not said


def test_who_dies_later_is_found_at_the_next_status(
    said: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    told, goal = set[bytes](), new_goal_id()
    warn_of_dead("/move", {goal}, told, said)
    assert not said
    monkeypatch.setattr(Author, "alive", False)
    warn_of_dead("/move", {goal}, told, said)
    assert len(said) == 1
