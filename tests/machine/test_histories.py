"""Random histories of the production code in a model world keep the rules (judge.py).

BT_SEED says where to begin (a failure prints the seed that shows it again at once), and
BT_HISTORIES how many to play.
"""

from __future__ import annotations

import os

import pytest

from bt_actions.goals.facts import drop
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.table import TABLE
from bt_actions.goals.terms import Event, State
from tests.machine.conftest import THOROUGH
from tests.machine.histories import first_broken, play, random_history, shrink, tell

FIRST = int(os.environ.get("BT_SEED", "1"))
COUNT = int(os.environ.get("BT_HISTORIES", "50000" if THOROUGH else "5000"))


RARE = {(State.NOT_RECEIVED, event) for event in Event} | {
    (State.PRESUMED_NOT_RECEIVED, Event.REPLACED),
    (State.REPLACED, Event.FEEDBACK),
    (State.REPLACED, Event.PARKED),
    (State.REPLACED, Event.RESULT_UNKNOWN),
    (State.REPLACED, Event.SERVER_AMBIGUOUS),
    (State.UNWANTED, Event.SERVER_AMBIGUOUS),
}
"""What comes in one of some thousand histories; test_goal.py has it."""


@pytest.mark.timeout(600)
def test_no_history_breaks_a_rule() -> None:
    seed = first_broken(range(FIRST, FIRST + COUNT))
    if seed is not None:
        shortest = tell(shrink(random_history(seed)))
        pytest.fail(f"BT_SEED={seed} shows it again; the shortest history found:\n{shortest}")


def test_the_histories_come_everywhere() -> None:
    """Every decision of the table, every outcome and every end: or silence proves nothing."""
    unreached = {key for key, step in TABLE.items() if step is not drop}
    unreached -= RARE | {(State.UNWANTED, Event.SEND_FAILED)}  # no caller that is in order tells it
    unseen: set[object] = {*Outcome, *End} - {Outcome.UNEXPECTED_RESULT}  # which a leaf decides

    for seed in range(6_000):
        caller = play(random_history(seed)).caller
        unreached -= caller.steps
        for handle in caller.handles:
            unseen -= {handle.goal.outcome, handle.goal.end}
        if not unreached and not unseen:
            return
    assert (unreached, unseen) == (set(), set())


def test_a_seed_tells_the_same_history_each_time() -> None:
    assert random_history(7) == random_history(7)
    assert random_history(7) != random_history(8)
    assert tell(random_history(7)) == tell(random_history(7))
