"""Histories of several servers of one name (crowds.py) break no rule.

BT_SEED and BT_CROWDED_HISTORIES as in test_histories.py.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import pytest

from bt_actions.servers import replies as replies
from bt_actions.servers.duplicates import DuplicateReplies
from bt_actions.traffic.ended import Past
from tests.machine.conftest import THOROUGH
from tests.machine.crowds import CrowdPlay, crowded_history
from tests.machine.histories import first_broken, shrink, tell

FIRST = int(os.environ.get("BT_SEED", "1"))
COUNT = int(os.environ.get("BT_CROWDED_HISTORIES", "20000" if THOROUGH else "2000"))
ENOUGH = 2_000
"""Histories in which each mistake must be found."""


@pytest.mark.timeout(600)
def test_no_history_breaks_a_rule() -> None:
    seed = first_broken(range(FIRST, FIRST + COUNT), CrowdPlay, crowded_history)
    if seed is not None:
        shortest = tell(shrink(crowded_history(seed), CrowdPlay), CrowdPlay)
        pytest.fail(f"BT_SEED={seed} shows it again; the shortest history found:\n{shortest}")


MISTAKES: dict[str, tuple[Any, str, Callable[..., Any]]] = {
    "believes two of three": (replies, "_answers_wanted", lambda watch: 2),
    "waits for who is not there": (replies, "_answers_wanted", lambda watch: 3),
    "takes what was told before for news": (DuplicateReplies, "_news", lambda self, ended: ended),
    "takes any answer for all": (replies.Replies, "_may_be_at_two", lambda self, watch: False),
    "is alone with whom it does not know": (
        DuplicateReplies,
        "_is_alone",
        lambda self, watch: True,
    ),
    "hears the first of two acceptances": (Past, "accepted", lambda self, *answer: None),
    "forgets what has ended": (Past, "keep", lambda self, handle: None),
}


@pytest.mark.parametrize("mistake", list(MISTAKES))
def test_every_mistake_is_found(monkeypatch: pytest.MonkeyPatch, mistake: str) -> None:
    where, name, instead = MISTAKES[mistake]
    monkeypatch.setattr(where, name, instead)
    assert first_broken(range(ENOUGH), CrowdPlay, crowded_history) is not None
