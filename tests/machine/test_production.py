"""The same histories with the production ros/line.py and ros/traffic.py (production.py).

BT_SEED and BT_PRODUCTION_HISTORIES as in test_histories.py.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from bt_actions.ros.line import Line
from bt_actions.ros.shared import Domain
from bt_actions.ros.traffic import Traffic
from bt_actions.standstill import Standstill
from tests.machine.conftest import THOROUGH
from tests.machine.histories import first_broken, random_history, shrink, tell
from tests.machine.production import ProductionPlay, installed

FIRST = int(os.environ.get("BT_SEED", "1"))
COUNT = int(os.environ.get("BT_PRODUCTION_HISTORIES", "20000" if THOROUGH else "2000"))
ENOUGH = 2_000
"""Histories in which each mistake must be found."""


@pytest.fixture(autouse=True)
def model_world() -> Iterator[None]:
    with installed():
        yield


@pytest.mark.timeout(600)
def test_no_history_breaks_a_rule() -> None:
    seed = first_broken(range(FIRST, FIRST + COUNT), ProductionPlay)
    if seed is not None:
        shortest = tell(shrink(random_history(seed), ProductionPlay), ProductionPlay)
        pytest.fail(f"BT_SEED={seed} shows it again; the shortest history found:\n{shortest}")


MISTAKES: dict[str, tuple[type, str, Callable[..., Any]]] = {
    "takes over nothing that another node lost": (Line, "_take_over", lambda self, now: None),
    "adopts nothing that was left": (Line, "_adopt", lambda self: None),
    "knows of nothing in the way": (Traffic, "_in_the_way_of", lambda self, ticket: False),
    "takes preemption for a failure": (Line, "_rival_sent", lambda self, ticket: False),
    "remembers nothing that is lost": (Domain, "keep_lost", lambda self, *lost: None),
    "takes who is not in sight yet for lost": (
        Standstill,
        "servers_take",
        lambda self, now: False,
    ),
    "takes what has not come in yet for late": (Standstill, "answers_take", lambda self, now: 0.0),
}
"""What callers.py cannot show, as these are the parts that it copies."""


@pytest.mark.parametrize("mistake", list(MISTAKES))
def test_every_mistake_is_found(monkeypatch: pytest.MonkeyPatch, mistake: str) -> None:
    where, name, instead = MISTAKES[mistake]
    monkeypatch.setattr(where, name, instead)
    assert first_broken(range(ENOUGH), ProductionPlay) is not None
