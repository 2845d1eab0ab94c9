"""A server of trees that is killed while a tree runs, and one below it that is."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import ActionReport

from tests.serving.conftest import MAIN, MOVE, Serve
from tests.support.processes import HostFactory, Journal, Process
from tests.support.tree_client import TreeClient

PARTS = ("send_goal", "cancel_goal", "get_result", "feedback", "status")
LONG = "{distance: 20.0}"


@pytest.mark.parametrize("remapped", [False, True])
def test_after_a_crash_what_was_left_is_canceled_before_goals_are_accepted(
    remapped: bool,
    serve: Callable[..., Journal],
    serve_trees: Serve,
    client: TreeClient,
    folder: Path,
    name: str,
) -> None:
    words = list[str]()
    if remapped:
        used = f"{name}/nobody_is_here"
        (folder / "move.yaml").write_text(MOVE.format(server=used, cancel="5 s"))
        rules = [f"{used}/_action/{part}:={name}/_action/{part}" for part in PARTS]
        words = ["--ros-args", *(word for rule in rules for word in ("-r", rule))]
    journal = serve()
    killed = serve_trees(*words)
    client.send("move", LONG)
    journal.wait_for("accepted")
    killed.send(signal.SIGKILL)
    killed.wait()
    assert not journal.ends()[0], "it runs on"
    again = serve_trees(*words)
    assert journal.ends() == ["canceled"]
    again.send(signal.SIGINT)
    assert again.wait() == 0
    third = serve_trees(*words)
    assert not any("cleaning up" in line for line in third.errors), "nothing is left"


@pytest.mark.chaos
def test_where_nobody_can_see_what_was_left_no_goal_is_accepted_and_it_is_said_what_to_do(
    new_host: HostFactory,
    serve_trees: Serve,
    start_program: Callable[..., Process],
    client: TreeClient,
    folder: Path,
    name: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    host = new_host()
    journal = host.open(name)
    killed = serve_trees()
    client.send("move", LONG)
    journal.wait_for("accepted")
    killed.send(signal.SIGKILL)
    host.kill()
    killed.wait()
    program = "import bt_actions.recovery.sweep as c; c.LOOK_LONGEST = 2.0; " + MAIN
    again = start_program("-c", program, "serve", "--trees", str(folder), short_lease=True)
    assert again.wait() == 3
    assert not again.lines
    said = "\n".join(again.errors)
    assert f"{name}" in said
    assert "nobody can see the goals there; start it, or remove /" in said
    assert again.errors[-1].endswith("accepts no goals before that is settled")


@pytest.mark.chaos
def test_a_server_below_that_is_killed_aborts_the_run_and_it_is_settled(
    new_host: HostFactory, serve_trees: Serve, client: TreeClient, name: str
) -> None:
    host = new_host()
    journal = host.open(name)
    serve_trees()
    sent = client.send("move", LONG)
    journal.wait_for("accepted")
    host.kill()
    status, result = client.result(sent)
    lost = RunTree.Result.ACTION_FAILED + ActionReport.SERVER_LOST
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, lost)
    assert result.settled
    assert [each.end for each in result.actions] == [ActionReport.END_SERVER_GONE]
