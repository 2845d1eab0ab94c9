"""Children beside each other, of which one raises."""

from __future__ import annotations

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from bt_actions.behaviours.parallel import Parallel


class Runs(Behaviour):
    def update(self) -> Status:
        return Status.RUNNING


class Raises(Behaviour):
    def update(self) -> Status:
        raise ZeroDivisionError


def test_who_runs_is_stopped_from_the_root_though_the_first_tick_raised() -> None:
    runs = Runs("runs")
    root = Sequence("root", memory=True, children=[Parallel("both", [runs, Raises("raises")])])
    with pytest.raises(ZeroDivisionError):
        root.tick_once()
    assert runs.status is Status.RUNNING
    root.stop(Status.INVALID)
    assert runs.status is Status.INVALID
