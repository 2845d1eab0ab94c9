"""Cancel requests wait for room in the queue of their server, and none of them for ever."""

from __future__ import annotations

import pytest

from bt_actions.traffic.cancel_queue import ANSWERED_WITHIN, AT_MOST, Cancels

GOALS = [bytes([number]) for number in range(3 * AT_MOST)]


class Sent(Cancels):
    """Of one server; `sent` is what left for it."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[bytes] = []
        self.leaves = True

    def send(self, goal_id: bytes) -> bool:
        self.sent += [goal_id] if self.leaves else []
        return self.leaves


@pytest.fixture
def cancels() -> Sent:
    """With more to cancel than there is room for, asked at 0.0."""
    cancels = Sent()
    for goal in GOALS:
        cancels.ask(goal, cancels.send, 0.0)
    return cancels


def test_so_many_are_sent_and_each_answer_makes_room_for_one(cancels: Sent) -> None:
    assert cancels.sent == GOALS[:AT_MOST]
    for count, goal in enumerate(GOALS, start=1):
        cancels.answered(goal, 0.1)
        assert cancels.sent == GOALS[: AT_MOST + count]


def test_what_is_not_answered_makes_room_after_a_while(cancels: Sent) -> None:
    cancels.send_more(ANSWERED_WITHIN - 0.1)
    assert cancels.sent == GOALS[:AT_MOST]
    for rounds in (1, 2):
        cancels.send_more(rounds * ANSWERED_WITHIN)
    assert cancels.sent == GOALS


def test_who_is_asked_for_again_keeps_its_turn(cancels: Sent) -> None:
    for goal in reversed(GOALS[AT_MOST:]):
        cancels.ask(goal, cancels.send, 0.5)
    for goal in GOALS:
        cancels.answered(goal, 0.6)
    assert cancels.sent == GOALS


def test_what_has_ended_is_not_asked_for_and_makes_room(cancels: Sent) -> None:
    cancels.forget(GOALS[AT_MOST])
    cancels.forget(GOALS[0])
    cancels.send_more(0.1)
    assert cancels.sent == [*GOALS[:AT_MOST], GOALS[AT_MOST + 1]]


def test_what_cannot_wait_is_sent_at_once_and_once(cancels: Sent) -> None:
    for goal in GOALS:
        cancels.send_now(goal)
        cancels.answered(goal, 0.1)
    assert cancels.sent == GOALS


def test_what_could_not_be_sent_takes_no_room() -> None:
    cancels = Sent()
    cancels.leaves = False
    for goal in GOALS:
        cancels.ask(goal, cancels.send, 0.0)
    cancels.leaves = True
    for goal in GOALS:
        cancels.ask(goal, cancels.send, 0.0)
    assert cancels.sent == GOALS[:AT_MOST]
