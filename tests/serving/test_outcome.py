"""The numbers of a run's outcome are those of the interfaces."""

from __future__ import annotations

import pytest
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import ActionReport, TreeInfo

from bt_actions.goals.policy import End, Outcome
from bt_actions.serving.catalog import State
from bt_actions.serving.outcome import ENDS, OUTCOMES, Code


@pytest.mark.parametrize("outcome", Outcome)
def test_each_outcome_has_its_number(outcome: Outcome) -> None:
    assert OUTCOMES[outcome] == getattr(ActionReport, outcome.value)


@pytest.mark.parametrize("end", End)
def test_each_end_has_its_number(end: End) -> None:
    assert ENDS[end] == getattr(ActionReport, f"END_{end.value}")


@pytest.mark.parametrize("code", Code)
def test_each_error_code_has_its_number(code: Code) -> None:
    assert code == getattr(RunTree.Result, code.name)


@pytest.mark.parametrize("state", State)
def test_each_state_of_a_tree_has_its_number(state: State) -> None:
    assert state.value == getattr(TreeInfo, state.name)
