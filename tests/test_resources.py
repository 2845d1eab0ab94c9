"""Who holds what, and who waits for it."""

from __future__ import annotations

from itertools import combinations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from bt_actions.goals.policy import Busy
from bt_actions.goals.resources import Resources
from bt_actions.goals.terms import Event

BASE, ARM, BOTH = frozenset({"base"}), frozenset({"arm"}), frozenset({"base", "arm"})


def held_by(*holders: str) -> Resources[str]:
    table: Resources[str] = Resources()
    for holder in holders:
        table.request(holder, BASE, Busy.SHARE)
    return table


def test_what_is_free_is_granted() -> None:
    table: Resources[str] = Resources()
    assert table.request("a", BASE, Busy.WAIT) is Event.GRANTED
    assert table.request("b", ARM, Busy.WAIT) is Event.GRANTED
    assert table.holders(BOTH) == ["a", "b"]


@pytest.mark.parametrize(
    ("busy", "answer"),
    [
        (Busy.WAIT, None),
        (Busy.FAIL, Event.TAKEN),
        (Busy.REPLACE, Event.GRANTED),
        (Busy.SHARE, Event.GRANTED),
    ],
)
def test_there_are_four_ways_to_meet_a_taken_resource(busy: Busy, answer: Event | None) -> None:
    assert held_by("a").request("b", BASE, busy) is answer


def test_a_release_grants_to_who_waits_longest() -> None:
    table = held_by("a")
    for waiter in ("b", "c"):
        table.request(waiter, BASE, Busy.WAIT)
    assert table.release("a") == ["b"]
    assert table.release("b") == ["c"]


def test_who_shares_keeps_the_others_waiting_until_the_last_has_left() -> None:
    table = held_by("a", "b")
    table.request("c", BASE, Busy.WAIT)
    assert table.release("a") == []
    assert table.release("b") == ["c"]


def test_all_of_them_or_none() -> None:
    table = held_by("a")
    assert table.request("b", BOTH, Busy.WAIT) is None
    assert table.holders(ARM) == []


def test_nobody_overtakes_on_a_name_that_an_earlier_one_waits_for() -> None:
    table = held_by("a")
    table.request("b", BOTH, Busy.WAIT)
    assert table.request("c", ARM, Busy.WAIT) is None, "arm is free, but b was first"
    assert table.request("d", ARM, Busy.FAIL) is Event.TAKEN
    assert table.release("a") == ["b"]
    assert table.release("b") == ["c"]


def test_who_gives_up_waiting_lets_those_behind_it_through() -> None:
    table = held_by("a")
    table.request("b", BOTH, Busy.WAIT)
    table.request("c", ARM, Busy.WAIT)
    assert table.release("b") == ["c"]


class AnyOrder(RuleBasedStateMachine):
    """Requests and releases in any order, beside a list of who came when."""

    def __init__(self) -> None:
        super().__init__()
        self.table: Resources[int] = Resources()
        self.open: dict[int, tuple[frozenset[str], Busy]] = {}
        self.waiting: list[int] = []
        self.count = 0

    @rule(names=st.sampled_from([BASE, ARM, BOTH]), busy=st.sampled_from(list(Busy)))
    def request(self, names: frozenset[str], busy: Busy) -> None:
        self.count += 1
        answer = self.table.request(self.count, names, busy)
        if answer is not Event.TAKEN:
            self.open[self.count] = (names, busy)
        if answer is None:
            self.waiting.append(self.count)

    @precondition(lambda self: self.open)
    @rule(which=st.integers(0, 99))
    def release(self, which: int) -> None:
        holder = sorted(self.open)[which % len(self.open)]
        del self.open[holder]
        self.waiting = [waiter for waiter in self.waiting if waiter != holder]
        granted = self.table.release(holder)
        assert granted == [waiter for waiter in self.waiting if waiter in granted], "in order"
        self.waiting = [waiter for waiter in self.waiting if waiter not in granted]

    @invariant()
    def two_hold_the_same_only_where_one_asked_for_it(self) -> None:
        for older, newer in combinations(self.table.holders(BOTH), 2):
            if self.open[older][0] & self.open[newer][0]:
                ways = {self.open[older][1], self.open[newer][1]}
                assert ways & {Busy.REPLACE, Busy.SHARE}

    @invariant()
    def who_waits_has_a_reason(self) -> None:
        wanted: frozenset[str] = frozenset()
        for waiter in self.waiting:
            names = self.open[waiter][0]
            assert names & wanted or self.table.holders(names)
            wanted |= names

    @invariant()
    def nobody_is_lost(self) -> None:
        assert len(self.table) == len(self.open)


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=100, deadline=None)
