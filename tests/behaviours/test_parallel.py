"""Children beside each other, of which one raises, or decides how all end."""

from __future__ import annotations

import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure, StatusQueue, Success
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


@pytest.mark.parametrize(
    ("decides", "at_least", "status"),
    [(Failure, None, Status.FAILURE), (Failure, 3, Status.FAILURE), (Success, 1, Status.SUCCESS)],
)
def test_a_child_behind_the_one_that_decides_is_not_begun(
    decides: type[Behaviour], at_least: int | None, status: Status
) -> None:
    before, behind = Runs("before"), Runs("behind")
    children = [before, decides("decides"), behind]
    parallel = Parallel("all", children, at_least=at_least)
    ticked = [node.name for node in parallel.tick()]
    assert ticked == ["before", "decides", "all"]
    assert parallel.status is status
    assert (before.status, behind.status) == (Status.INVALID, Status.INVALID)


def test_a_child_is_not_ticked_once_one_before_it_has_decided() -> None:
    decides = StatusQueue("decides", [Status.RUNNING], eventually=Status.SUCCESS)
    runs = Runs("runs")
    parallel = Parallel("one", [decides, runs], at_least=1)
    parallel.tick_once()
    assert runs.status is Status.RUNNING
    assert [node.name for node in parallel.tick()] == ["decides", "one"]
    assert (parallel.status, runs.status) == (Status.SUCCESS, Status.INVALID)


def test_a_parallel_fails_after_so_many_failures_though_it_might_still_succeed() -> None:
    fails, other, runs = Failure("a"), Failure("b"), Runs("c")
    parallel = Parallel("one", [fails, other, runs], at_least=1, fails_after=2)
    assert [node.name for node in parallel.tick()] == ["a", "b", "one"]
    assert (parallel.status, runs.status) == (Status.FAILURE, Status.INVALID)
