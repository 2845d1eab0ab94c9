"""`bt-actions call`: the command, the server of trees, and the robot in processes apart."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.serving.conftest import MAIN, MOVE, Serve
from tests.support.processes import Journal, Process

Call = Callable[..., Process]


@pytest.fixture
def call(start_program: Callable[..., Process], space: str) -> Call:
    """Start `bt-actions call` for the server in the test's namespace."""

    def start(*words: str) -> Process:
        return start_program("-c", MAIN, "call", "--namespace", space, *words, short_lease=True)

    return start


def test_a_call_is_told_as_a_run_is(
    serve: Callable[..., Journal], serve_trees: Serve, call: Call, name: str
) -> None:
    serve("2:abort=0.1")
    serve_trees()
    process = call("move", "--set", "distance=2.5")
    assert process.wait(60.0) == 0, process
    table = next(at for at, line in enumerate(process.lines) if line.startswith("action "))
    assert process.lines[table + 1].split()[:4] == ["Go", name, "1", "SUCCEEDED"]
    assert process.lines[table + 2] == "at: 2.5"
    assert any(line.startswith("  Move / Go: executing") for line in process.lines[:table])

    process = call("move", "--set", "distance=0.5", "--json")
    assert process.wait(60.0) == 1, process
    told = json.loads(process.lines[-1])
    reasons = [each["reason"] for each in (*told["failures"], *told["actions"])]
    assert "goal_name" not in str([told["why"], reasons]), "which the command has made up"
    assert (told["exit_code"], told["error_code"], told["outputs"]) == (1, 20104, {})
    assert [each["outcome"] for each in told["actions"]] == ["ABORTED"]
    assert "Move / Go: ABORTED" in told["failures"][0]["reason"]


def test_a_chain_of_failures_is_told_once(
    serve: Callable[..., Journal], serve_trees: Serve, call: Call
) -> None:
    serve("1:abort=0.1")
    serve_trees()
    process = call("move", "--set", "distance=0.5")
    assert process.wait(60.0) == 1, process
    assert str(process).count("Move / Go: ABORTED") == 1, process
    assert process.lines[-1].startswith("ABORTED: aborted by "), process


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["mov", "--json"], "UNKNOWN_TREE: there is no tree 'mov' here; did you mean 'move'?"),
        (["move", "--ros-args", "-p", "distnce:=1.0"], "did you mean 'distance'?"),
    ],
)
def test_what_the_server_refuses_is_bad_input_and_it_says_why(
    serve_trees: Serve, call: Call, words: list[str], said: str
) -> None:
    serve_trees()
    process = call(*words)
    assert process.wait(60.0) == 2, process
    assert said in "\n".join(process.errors)
    if "--json" in words:
        told = json.loads(process.lines[-1])
        assert (told["exit_code"], told["error"][: len(said)]) == (2, said)


def test_ctrl_c_cancels_and_a_server_that_is_busy_is_no_bad_input(
    serve: Callable[..., Journal], serve_trees: Serve, call: Call
) -> None:
    journal = serve("1:delay_cancel=0.3")
    serve_trees()
    first = call("move", "--set", "distance=30.0")
    journal.wait_for("accepted", within=20.0)
    second = call("move", "--set", "distance=0.1")
    assert second.wait(60.0) == 1, second
    assert "BUSY: " in "\n".join(second.errors)
    first.send(signal.SIGINT)
    assert first.wait(60.0) == 130, first
    assert journal.ends() == ["canceled"]


def test_a_run_that_left_a_goal_behind_ends_with_3(
    serve: Callable[..., Journal], serve_trees: Serve, call: Call, folder: Path, name: str
) -> None:
    (folder / "move.yaml").write_text(MOVE.format(server=name, cancel="500 ms"))
    journal = serve("1:ignore_cancel")
    serve_trees()
    process = call("move", "--set", "distance=6.0", "-q")
    journal.wait_for("accepted", within=20.0)
    process.send(signal.SIGINT)
    assert process.wait(60.0) == 3, process
