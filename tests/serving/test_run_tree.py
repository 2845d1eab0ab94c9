"""A tree that runs a tree: the outer one, the server of trees, and the robot in processes apart."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.serving.conftest import MAIN, MOVE, Serve
from tests.support.processes import Journal, Process

OUTER = """\
tree: outer
outputs: {{at: float64}}
root:
  run_tree: Move over there
  tree: {tree}
  server: {space}/run_tree
  inputs: {{distance: = {distance} + 0.0}}
  timeout: 60 s
  expect: outputs.at > 0.0 and result.settled
  save: {{at: outputs.at}}
"""
Outer = Callable[..., Process]


@pytest.fixture
def outer(start_program: Callable[..., Process], tmp_path: Path, space: str) -> Outer:
    """Start `bt-actions run` of a tree that has the served one run."""

    def start(distance: float, tree: str = "move") -> Process:
        file = tmp_path / "outer.yaml"
        file.write_text(OUTER.format(tree=tree, space=space, distance=distance))
        return start_program("-c", MAIN, "run", str(file), "--json", short_lease=True)

    return start


def result_of(process: Process, code: int) -> dict[str, object]:
    """The last line, when the process has ended with a code."""
    assert process.wait(60.0) == code, process
    return dict(json.loads(process.lines[-1]))


def test_a_tree_runs_a_tree_of_another_process_and_keeps_its_output(
    serve: Callable[..., Journal], serve_trees: Serve, outer: Outer
) -> None:
    serve()
    serve_trees()
    assert result_of(outer(0.3), 0)["outputs"] == {"at": pytest.approx(0.3)}


def test_the_chain_of_a_run_below_is_the_reason_of_the_failure(
    serve: Callable[..., Journal], serve_trees: Serve, outer: Outer
) -> None:
    serve("1:abort=0.1")
    serve_trees()
    assert "Move / Go: ABORTED" in str(result_of(outer(0.3), 1))


def test_a_rejection_says_where_its_reason_is_told(serve_trees: Serve, outer: Outer) -> None:
    serve_trees()
    assert "~/rejections" in str(result_of(outer(0.3, "nothing"), 1))


def test_a_cancel_goes_down_to_the_robot_and_is_waited_for(
    serve: Callable[..., Journal], serve_trees: Serve, outer: Outer
) -> None:
    journal = serve("1:delay_cancel=0.5")
    serve_trees()
    process = outer(20.0)
    journal.wait_for("accepted", within=20.0)
    process.send(signal.SIGINT)
    assert not result_of(process, 130)["unaccounted"]
    assert journal.ends() == ["canceled"]


@pytest.mark.chaos
def test_a_run_that_left_a_goal_behind_is_not_accounted_for_here_either(
    serve: Callable[..., Journal], serve_trees: Serve, outer: Outer, folder: Path, name: str
) -> None:
    text = MOVE.format(server=name, cancel="500 ms").replace("result: 60 s", "result: 300 ms")
    (folder / "move.yaml").write_text(text)
    serve("1:ignore_cancel")
    serve_trees()
    (left,) = result_of(outer(4.0), 3)["unaccounted"]  # type: ignore[misc]
    assert left.startswith("Move over there on ")
