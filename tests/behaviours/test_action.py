"""What a user of the leaf sees, beyond outcomes."""

from collections.abc import Callable
from typing import Any

import py_trees
import pytest

from bt_actions import MoveRobot, Outcome, TreeRunner
from bt_actions.behaviours import action


def test_an_unexpected_result_says_what_was_expected_and_what_came(
    host: Any, name: str, run: Callable[..., Any]
) -> None:
    host.open(name)
    leaf = run(MoveRobot("m", 0.1, action_name=name, expect="result.final_pose > 4.0"))
    assert leaf.outcome is Outcome.UNEXPECTED_RESULT
    assert leaf.reason.startswith("result.final_pose > 4.0 was expected, but the result is: ")
    assert "final_pose 0.1" in leaf.reason
    host.close_server(name)


def test_the_first_leaf_that_is_shut_down_closes_for_the_whole_tree(
    node: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    walks = []
    original = action._leaves_of_tree

    def walk(leaf: Any) -> Any:
        walks.append(leaf)
        return original(leaf)

    monkeypatch.setattr(action, "_leaves_of_tree", walk)
    leaves = [MoveRobot(f"m{n}", 1.0, action_name=name) for n in range(20)]
    root = py_trees.composites.Sequence("all", memory=True, children=list(leaves))
    with TreeRunner(root, node=node) as runner:
        runner.interrupt()
        runner.run()
    assert len(walks) == 1
