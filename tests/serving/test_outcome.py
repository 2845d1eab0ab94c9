"""A run's outcome: its numbers are those of the interfaces, its text is the story of the run."""

from __future__ import annotations

import pytest
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import ActionReport, TreeInfo

from bt_actions import load_tree
from bt_actions.goals.policy import End, Outcome
from bt_actions.serving.catalog import FileState
from bt_actions.serving.diagnostics import TreeStanding, judge
from bt_actions.serving.outcome import ENDS, OUTCOMES, Code, outcome_of
from bt_actions.story.why import why
from bt_actions.testing import Simulation, VirtualNetwork, VirtualRunner


@pytest.mark.parametrize("outcome", Outcome)
def test_each_outcome_has_its_number(outcome: Outcome) -> None:
    assert OUTCOMES[outcome] == getattr(ActionReport, outcome.value)


@pytest.mark.parametrize("end", End)
def test_each_end_has_its_number(end: End) -> None:
    assert ENDS[end] == getattr(ActionReport, f"END_{end.value}")


@pytest.mark.parametrize("code", Code)
def test_each_error_code_has_its_number(code: Code) -> None:
    assert code == getattr(RunTree.Result, code.name)


@pytest.mark.parametrize("state", FileState)
def test_each_state_of_a_tree_has_its_number(state: FileState) -> None:
    assert state.value == getattr(TreeInfo, state.name)


def test_a_failure_is_told_as_in_a_terminal_and_its_first_line_is_enough() -> None:
    network = VirtualNetwork()
    Simulation(network, faults=["move_robot:12:abort"])
    runner = VirtualRunner(load_tree("examples/night/night.yaml"), network)
    runner.run()
    outcome = outcome_of(runner.state, succeeded=False, unaccounted=["Home on /move_robot"])
    cause, *rest, left = outcome.message.splitlines()
    path, reason, *more = why(runner.state)
    assert cause == f"{path}: {reason.strip()}"
    assert rest == more
    assert "failed before, and dealt with:" in rest
    assert left == "may still be running: Home on /move_robot"
    settled = outcome_of(runner.state, succeeded=False)
    assert judge(TreeStanding("night", last=settled), "")[1] == f"the last run failed: {cause}"
