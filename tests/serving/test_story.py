"""What a server says of its runs, on its log and on /rosout."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from rcl_interfaces.msg import Log

from bt_actions.document import Tree, open_tree
from bt_actions.ros.serving.endpoints import kept
from bt_actions.serving.outcome import Code, RunOutcome
from bt_actions.serving.story import begins, ends
from tests.serving.conftest import Serve
from tests.support.processes import Journal
from tests.support.tree_client import Sent, TreeClient

LONG = 1000


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    path = tmp_path / "go.yaml"
    path.write_text(
        "tree: go\n"
        "inputs:\n"
        "  speed: {type: float64, default: 0.5}\n"
        "  points: {type: 'float64[]', default: []}\n"
        "  words: {type: string, default: ''}\n"
        "  more: {type: 'string[]', default: []}\n"
        "root: {success: }\n"
    )
    return open_tree(path)


def test_a_begin_names_file_inputs_and_the_callers_name(tree: Tree) -> None:
    told = begins("/trees/go.yaml", tree, {"points": [1.0, 2.0]}, "mine")
    given = "speed=0.5, points=[1.0, 2.0], words='', more=[]"
    assert told == f"begins (/trees/go.yaml) with {given}, called 'mine'"


def test_large_inputs_are_told_in_short(tree: Tree) -> None:
    inputs = {"points": [0.0] * 100_000, "words": "x\n" * 100_000, "more": ["y" * 50] * 15}
    told = begins("go.yaml", tree, inputs, "")
    assert len(told) < LONG
    assert "100000 items" in told
    assert "\n" not in told


@pytest.mark.parametrize(
    ("outcome", "seconds", "told"),
    [
        (RunOutcome(Code.NONE), 1.234, "ends: SUCCESS after 1.23 s"),
        (RunOutcome(20104, "Go: ABORTED"), 2.0, "ends: FAILURE after 2.00 s: Go: ABORTED"),
        (RunOutcome(20104, "Go: ABORTED\n  x.yaml:8:7"), 2.0,
         "ends: FAILURE after 2.00 s:\nGo: ABORTED\n  x.yaml:8:7"),
        (RunOutcome(Code.CANCELED, "a client canceled it"), 0.5,
         "ends: STOPPED after 0.50 s: a client canceled it"),
        (RunOutcome(Code.HALTED, "it was halted before it began"), None,
         "ends: STOPPED: it was halted before it began"),
        (RunOutcome(Code.EXCEPTION, "no device"), 0.0, "ends: FAILURE after 0.00 s: no device"),
        (RunOutcome(Code.UNKNOWN, unaccounted=("Go",)), 1.0,
         "ends: SUCCESS after 1.00 s, and not all of its goals are accounted for"),
    ],
)  # fmt: skip
def test_an_end_has_status_seconds_and_reason(
    outcome: RunOutcome, seconds: float | None, told: str
) -> None:
    assert ends(outcome, seconds) == told


def test_log_and_rosout_tell_two_runs_of_one_tree_apart(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, folder: Path, space: str
) -> None:
    serve("2:abort=0.1")
    heard: list[Log] = []
    client.node.create_subscription(Log, "/rosout", heard.append, kept(100))
    server = serve_trees()

    def told(text: str) -> bool:
        """Whether both say it."""
        there = any(f"]: {space}/bt_actions_serve: {text}" in line for line in server.errors)
        name = f"{space.strip('/')}.bt_actions_serve"
        return there and any(each.name == name and each.msg.startswith(text) for each in heard)

    def run(name: str) -> Sent:
        sent = client.send("move", "{distance: 0.2}", name)
        client.result(sent)
        return sent

    first, second = run("the first"), run("the\nsecond")
    assert not client.send("move", "", "third").accepted
    for sent, name in ((first, "the first"), (second, "the second")):
        run_id = bytes(sent.handle.goal_id.uuid).hex()
        begin = f"move {run_id} begins ({folder}/move.yaml) with distance=0.2, called {name!r}"
        client.until(lambda text=begin: told(text), begin)
    end = f"move {bytes(first.handle.goal_id.uuid).hex()} ends: SUCCESS after "
    client.until(lambda: told(end), end)
    end = f"move {bytes(second.handle.goal_id.uuid).hex()} ends: FAILURE after "
    client.until(lambda: told(end), end)
    client.until(lambda: told("goal for 'move', called 'third', rejected: INPUTS: "), "rejected")
    client.until(lambda: told("activating"), "activating")
