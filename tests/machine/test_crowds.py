"""Histories of several servers of one name (crowds.py) break no rule.

BT_SEED and BT_CROWDED_HISTORIES as in test_histories.py.
"""

from __future__ import annotations

import os

import pytest

from tests.machine.conftest import THOROUGH
from tests.machine.crowds import CrowdPlay, crowded_history
from tests.machine.histories import first_broken, shrink, tell

FIRST = int(os.environ.get("BT_SEED", "1"))
COUNT = int(os.environ.get("BT_CROWDED_HISTORIES", "20000" if THOROUGH else "2000"))


@pytest.mark.timeout(600)
def test_no_history_breaks_a_rule() -> None:
    seed = first_broken(range(FIRST, FIRST + COUNT), CrowdPlay, crowded_history)
    if seed is not None:
        shortest = tell(shrink(crowded_history(seed), CrowdPlay), CrowdPlay)
        pytest.fail(f"BT_SEED={seed} shows it again; the shortest history found:\n{shortest}")
