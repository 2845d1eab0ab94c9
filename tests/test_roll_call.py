"""When all servers of an action have had the time to tell what they run."""

from __future__ import annotations

from collections.abc import Iterator

from bt_actions.recovery.roll_call import (
    ASK_AGAIN,
    SETTLE,
    SETTLE_AFTER_SILENCE,
    Answers,
    RollCall,
)

A, B = b"a", b"b"


class Roll(RollCall):
    """One whose questions and answers come as a test says."""

    def __init__(self) -> None:
        self.now = 100.0
        self._numbers: Iterator[int] = iter(range(1000))
        super().__init__("/move")

    def shows(self, *shown: bytes) -> None:
        self.sees(frozenset(shown), self.now)

    def ask(self, answers: int, *, after: float = 0.02) -> None:
        """Ask, and take so many answers after a while; then let it be time for the next."""
        assert self.due(self.now)
        number = next(self._numbers)
        self.asked(number, self.now)
        for _ in range(answers):
            self.answer_came(number, self.now + after)
        self.now += max(after, ASK_AGAIN)

    def settle(self, answers: int = 1) -> None:
        """Ask for as long as it takes."""
        began = self.now
        while not self.known:
            assert self.now - began < SETTLE_AFTER_SILENCE + 2 * ASK_AGAIN
            self.ask(answers)
        assert self.now - began > SETTLE


def test_it_is_known_when_all_questions_were_answered_for_long_enough() -> None:
    roll = Roll()
    roll.shows(A)
    roll.settle()
    assert roll.known
    assert not roll.overdue(roll.now)


def test_it_is_known_when_a_server_that_is_alone_has_told_its_goals() -> None:
    roll = Roll()
    roll.tells()
    assert not roll.known, "none is in sight"
    roll.shows(A)
    roll.tells()
    assert roll.known
    roll.shows(A, B)
    roll.tells()
    assert not roll.known, "nobody knows which of them has told"


def test_an_answer_alone_is_no_proof() -> None:
    """It was stopped after the first, with a status that it had not delivered."""
    roll = Roll()
    roll.shows(A)
    roll.ask(1)
    for _ in range(10):
        roll.ask(0)
    assert not roll.known
    assert roll.overdue(roll.now)
    assert roll.trouble == "no server of {} answers"
    roll.settle()
    assert roll.known


def test_who_was_silent_has_to_answer_for_longer() -> None:
    """What it offered when it was woken up may have been lost, and is offered again after 3 s."""
    for silences in (lambda roll: roll.ask(0), lambda roll: roll.begin()):
        roll = Roll()
        roll.shows(A)
        silences(roll)
        roll.shows(A)
        for _ in range(int(SETTLE_AFTER_SILENCE / ASK_AGAIN)):
            roll.ask(1)
            assert not roll.known
        roll.ask(1)
        assert roll.known


def test_each_server_has_to_answer() -> None:
    roll = Roll()
    roll.shows(A, B)
    for _ in range(10):
        roll.ask(1)
    assert not roll.known
    assert roll.trouble.startswith("not every server of {} ")
    roll.settle(answers=2)
    assert roll.known


def test_one_that_comes_newly_begins_anew() -> None:
    roll = Roll()
    roll.shows(A)
    roll.settle()
    roll.shows(A, B)
    assert not roll.known
    assert not roll.overdue(roll.now), "it is on the way"
    roll.settle(answers=2)
    assert roll.known


class Denied(Answers):
    """One whose questions and answers come as a test says."""

    def __init__(self) -> None:
        self.now = 100.0
        self._numbers: Iterator[int] = iter(range(1000))
        super().__init__()

    def question(self, *of: bytes) -> int:
        """Ask `of` these; return the number."""
        number = next(self._numbers)
        self.asked(number, frozenset(of), self.now)
        self.now += ASK_AGAIN
        return number

    def ask(self, denials: int, *of: bytes, times: int = 1) -> None:
        """Ask `of` these, so many times, and have it denied so often each time."""
        for _ in range(times):
            number = self.question(*of)
            for _ in range(denials):
                self.answer_came(number)


LONG = 30


def test_a_goal_is_denied_for_good_after_a_long_row_of_denials() -> None:
    goal = Denied()
    goal.ask(1, A, times=LONG)
    assert goal.lasted < LONG
    goal.ask(1, A)
    assert goal.lasted >= LONG


def test_each_of_two_servers_has_to_deny_it() -> None:
    goal = Denied()
    goal.ask(1, A, B, times=LONG + 2)
    assert goal.lasted < LONG
    goal.ask(2, A, B, times=LONG + 1)
    assert goal.lasted >= LONG
