"""Cancel requests wait for room in the queue of their server, and none of them for ever."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bt_actions.traffic.cancel_queue import (
    ANSWERED_WITHIN,
    AT_MOST,
    ask_to_cancel,
    forget,
    make_room,
    send_more,
    send_now,
)
from bt_actions.traffic.state import CancelQueue

GOALS = [bytes([number]) for number in range(3 * AT_MOST)]


class Server(SimpleNamespace):
    """An endpoint to one server, at a time of the test's; `sent` is what left for it."""

    def __init__(self) -> None:
        super().__init__(cancels=CancelQueue(), now=0.0, transport=self, host=self, leaves=True)
        self.sent: list[bytes] = []

    def steady(self) -> float:
        return float(self.now)

    def cancel(self, goal_id: bytes) -> None:
        if not self.leaves:
            raise RuntimeError("no space left")
        self.sent.append(goal_id)

    def warn_once(self, what: str, error: Exception) -> None: ...


@pytest.fixture
def server() -> Any:
    """With more to cancel than there is room for, asked at 0.0."""
    server: Any = Server()
    for goal in GOALS:
        ask_to_cancel(server, goal)
    return server


def test_so_many_are_sent_and_each_answer_makes_room_for_one(server: Any) -> None:
    assert server.sent == GOALS[:AT_MOST]
    for count, goal in enumerate(GOALS, start=1):
        make_room(server, goal, 0.1)
        assert server.sent == GOALS[: AT_MOST + count]


def test_what_is_not_answered_makes_room_after_a_while(server: Any) -> None:
    send_more(server, ANSWERED_WITHIN - 0.1)
    assert server.sent == GOALS[:AT_MOST]
    for rounds in (1, 2):
        send_more(server, rounds * ANSWERED_WITHIN)
    assert server.sent == GOALS


def test_who_is_asked_for_again_keeps_its_turn(server: Any) -> None:
    server.now = 0.5
    for goal in reversed(GOALS[AT_MOST:]):
        ask_to_cancel(server, goal)
    for goal in GOALS:
        make_room(server, goal, 0.6)
    assert server.sent == GOALS


def test_what_has_ended_is_not_asked_for_and_makes_room(server: Any) -> None:
    forget(server, GOALS[AT_MOST])
    forget(server, GOALS[0])
    send_more(server, 0.1)
    assert server.sent == [*GOALS[:AT_MOST], GOALS[AT_MOST + 1]]


def test_what_cannot_wait_is_sent_at_once_and_once(server: Any) -> None:
    for goal in GOALS:
        send_now(server, goal)
        make_room(server, goal, 0.1)
    assert server.sent == GOALS


def test_what_could_not_be_sent_takes_no_room() -> None:
    server: Any = Server()
    server.leaves = False
    for goal in GOALS:
        ask_to_cancel(server, goal)
    server.leaves = True
    for goal in GOALS:
        ask_to_cancel(server, goal)
    assert server.sent == GOALS[:AT_MOST]
