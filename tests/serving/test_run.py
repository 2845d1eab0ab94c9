"""A served run, as its server tells of it while it goes on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any
from unittest.mock import Mock

import py_trees
import pytest
from py_trees.common import Status

from bt_actions.events import RunEnded
from bt_actions.events.stream import Reader
from bt_actions.running.runner import TreeRunner
from bt_actions.serving import run as serving_run
from bt_actions.serving.messages import feedback
from bt_actions.serving.outcome import RunOutcome, outcome_of
from bt_actions.serving.run import Run
from tests.support.waiting import until


def test_a_tick_that_does_not_return_is_told_in_the_feedback_while_it_lasts(node: Any) -> None:
    class Stuck(py_trees.behaviours.Running):
        def update(self) -> Status:
            assert may_return.wait(30.0)
            return Status.SUCCESS

    may_return, outcomes = threading.Event(), list[Any]()
    tree = Mock(build=lambda inputs: Stuck("Grasp"))
    run = Run(tree, {}, node, begins=lambda servers: None, ended=outcomes.append)
    run.start()

    def told() -> list[tuple[str, str]]:
        with run.told() as state:
            running = feedback(state, paused=False, begun=True).running
        return [(each.path, each.message) for each in running]

    until(lambda: told() == [("Grasp", "in its tick")])
    may_return.set()
    assert run.join(9.0)
    assert outcomes[0].code == 0
    assert told() == []


def test_who_watches_a_run_is_told_its_end_though_its_story_cannot_be_told(
    node: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tell(*args: Any, error: BaseException | None = None, **more: Any) -> RunOutcome:
        if error is None:
            raise KeyError(3)
        return outcome_of(*args, error=error, **more)

    def watch(runner: TreeRunner) -> Callable[[], str]:
        readers.append(runner.stream.reader())
        return str

    monkeypatch.setattr(serving_run, "outcome_of", tell)
    readers, outcomes = list[Reader](), list[RunOutcome]()
    tree = Mock(build=lambda inputs: py_trees.behaviours.Failure("Grasp"))
    run = Run(tree, {}, node, watch=watch, begins=lambda servers: None, ended=outcomes.append)
    run.start()
    assert run.join(9.0)
    ended = readers[0].take()[-1]
    assert isinstance(ended, RunEnded)
    assert ended.exit_code == outcomes[0].code != 0
