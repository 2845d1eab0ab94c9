"""Trees run for other nodes: server, client and the servers below in processes apart."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import ActionReport, TreeInfo
from bt_actions_interfaces.srv import CheckTree, ListTrees
from rclpy.action.server import RCLError

from bt_actions.recording.reading import Recording
from bt_actions.serving import TreeServer
from bt_actions.serving.outcome import Code, RunOutcome
from tests.serving.conftest import MOVE, Serve
from tests.support.processes import Journal, Process
from tests.support.tree_client import PATIENCE, TreeClient
from tests.support.waiting import until

R = RunTree.Result
LONG = "{distance: 20.0}"


def test_a_tree_runs_to_its_end_and_tells_what_it_did(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, name: str, folder: Path
) -> None:
    serve()
    serve_trees()
    status, result = client.result(client.send("move", "{distance: 0.3}"))
    told = (status, result.error_code, result.settled)
    assert told == (GoalStatus.STATUS_SUCCEEDED, R.NONE, True)
    assert json.loads(result.outputs).keys() == {"at"}
    (action,) = result.actions
    assert (action.path, action.server, action.attempts) == ("Move / Go", name, 1)
    assert (action.outcome, action.end) == (ActionReport.SUCCEEDED, ActionReport.END_SUCCEEDED)
    assert action.place.startswith(str(folder / "move.yaml"))


def test_feedback_names_what_runs_and_counts_what_has_ended(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    serve()
    serve_trees()
    sent = client.send("move", "{distance: 2.5}")
    client.result(sent)
    running = [each for each in sent.feedback if each.running]
    assert running[0].running[0].path == "Move / Go"
    assert running[0].running[0].attempts == 1
    assert len(running) >= 2, "at least once a second"


@pytest.mark.parametrize(
    ("tree", "inputs", "code"),
    [
        ("nothing", "", "UNKNOWN_TREE"),
        ("broken", "", "BT201"),
        ("move", "{distance: 1.0} #" + "x" * 1_000_000, "INPUTS"),
    ],
    ids=["unknown", "broken tree", "1 MB"],
)
def test_a_goal_that_cannot_be_run_is_rejected_and_the_reason_is_told_to_all(
    serve_trees: Serve, client: TreeClient, tree: str, inputs: str, code: str
) -> None:
    server = serve_trees()
    assert not client.send(tree, inputs, "mine").accepted
    client.until(lambda: client.rejections, "the rejection is published")
    told = client.rejections[0]
    assert (told.tree, told.goal_name, told.code) == (tree, "mine", code)
    assert told.stamp.sec > 0
    client.until(
        lambda: any(told.message[:60] in line for line in server.errors), "it is in the log"
    )
    answer = client.call(CheckTree, tree=tree, inputs=inputs)
    assert not answer.accepted
    assert [(each.code, each.message) for each in answer.findings] == [
        (code, told.message.removesuffix(f" ({answer.findings[0].place})"))
    ]


def test_a_queue_that_is_full_rejects_and_a_goal_in_it_can_be_canceled(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    journal = serve()
    serve_trees("--policy", "queue", "--max", "1")
    first, second = client.send("move", LONG), client.send("move", LONG)
    assert not client.send("move", LONG).accepted
    journal.wait_for("accepted")
    assert client.cancel(second) == 1
    status, result = client.result(second)
    assert (status, result.error_code, result.settled) == (
        GoalStatus.STATUS_CANCELED, R.CANCELED, True,
    )  # fmt: skip
    assert not result.actions
    client.cancel(first)
    client.result(first)
    assert journal.count("accepted") == 1


def test_replace_begins_the_newer_tree_when_all_goals_of_the_older_have_ended(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    journal = serve("1:delay_cancel=0.5")
    serve_trees("--policy", "replace")
    older = client.send("move", LONG)
    journal.wait_for("accepted")
    newer = client.send("move", "{distance: 0.2}")
    assert client.told(older) == (GoalStatus.STATUS_ABORTED, R.REPLACED, True)
    assert client.result(newer)[0] == GoalStatus.STATUS_SUCCEEDED
    assert journal.max_live == 1


def test_a_cancel_is_answered_as_canceled_only_when_every_goal_below_has_ended(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    journal = serve("1:delay_cancel=0.5")
    serve_trees()
    sent = client.send("move", LONG)
    journal.wait_for("accepted")
    assert client.cancel(sent) == 1
    status, result = client.result(sent)
    assert journal.ends() == ["canceled"]
    assert (status, result.error_code, result.settled) == (
        GoalStatus.STATUS_CANCELED, R.CANCELED, True,
    )  # fmt: skip
    assert result.actions[0].end == ActionReport.END_CANCELED


def test_a_goal_below_that_cannot_be_accounted_for_makes_the_answer_unsettled(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, folder: Path, name: str
) -> None:
    (folder / "move.yaml").write_text(MOVE.format(server=name, cancel="500 ms"))
    journal = serve("1:ignore_cancel")
    server = serve_trees()
    sent = client.send("move", "{distance: 4.0}")
    journal.wait_for("accepted")
    client.cancel(sent)
    status, result = client.result(sent)
    assert (status, result.error_code, result.settled) == (
        GoalStatus.STATUS_ABORTED, R.CANCELED, False,
    )  # fmt: skip
    assert f"may still be running: Go on {name}" in result.error_msg
    assert result.actions[0].end == ActionReport.END_UNKNOWN
    server.send(signal.SIGINT)
    assert server.wait() == 3
    (told,) = [line for line in server.errors if f"Go on {name}" in line]
    assert "not accounted for: Go on" in told
    assert server.errors[-1].endswith("1 goal is not accounted for; the log names each"), server


def test_a_failure_names_the_action_to_blame_with_its_place(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, folder: Path
) -> None:
    serve("1:abort=0.1")
    serve_trees()
    status, result = client.result(client.send("move", "{distance: 0.2}"))
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == R.ACTION_FAILED + ActionReport.ABORTED
    cause, place = result.error_msg.splitlines()
    assert re.match(r"\d\d:\d\d:\d\d  Move / Go: ABORTED: .*; goal {distance: 0.2}", cause)
    assert place.startswith(f"  {folder / 'move.yaml'}:8:7; passed on by Move (")
    assert result.settled


def test_a_failure_tells_where_its_recording_lies(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    serve("1:abort=0.1")
    serve_trees()
    _, failed = client.result(client.send("move", "{distance: 0.2}"))
    host, _, path = failed.recording.partition(":")
    assert (host, Recording(Path(path)).first) == (socket.gethostname(), Path(path))
    assert Path(path).is_file()
    _, succeeded = client.result(client.send("move", "{distance: 0.2}"))
    assert (succeeded.error_code, succeeded.recording) == (R.NONE, "")


def test_without_a_recording_a_failure_tells_of_none(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    serve("1:abort=0.1")
    serve_trees("--no-record")
    _, failed = client.result(client.send("move", "{distance: 0.2}"))
    assert (failed.error_code > R.ACTION_FAILED, failed.recording) == (True, "")


def test_a_failure_without_an_action_to_blame_has_a_code_of_its_own(
    serve_trees: Serve, client: TreeClient, folder: Path
) -> None:
    (folder / "empty.yaml").write_text("tree: empty\nroot: {failure: Never}\n")
    serve_trees()
    status, result = client.result(client.send("empty"))
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, R.TREE_FAILED)


def test_a_behaviour_that_raises_is_named(
    serve_trees: Serve, client: TreeClient, folder: Path
) -> None:
    (folder / "empty.yaml").write_text(
        "tree: empty\nroot: {python: tests.support.trees.Raises, arguments: {method: update}}\n"
    )
    serve_trees("--python", "tests")
    status, result = client.result(client.send("empty"))
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, R.EXCEPTION)
    assert "  Raises: tick raised " in result.error_msg
    assert client.send("empty").accepted, "the server goes on"


def test_trees_are_listed_with_their_inputs_and_with_what_runs(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    serve()
    serve_trees()
    sent = client.send("move", LONG)
    trees = {tree.name: tree for tree in client.call(ListTrees).trees}
    assert {name: tree.state for name, tree in trees.items()} == {
        "broken": TreeInfo.INVALID, "empty": TreeInfo.OK, "move": TreeInfo.OK,
    }  # fmt: skip
    move = trees["move"]
    assert move.description == "Move, and say where it ended."
    assert [bytes(each.uuid) for each in move.running] == [bytes(sent.handle.goal_id.uuid)]
    (distance,) = move.inputs
    assert (distance.name, distance.type, distance.unit) == ("distance", "float64", "m")
    assert (distance.required, distance.default_json) == (True, "")
    assert trees["broken"].findings[0].code == "BT201"
    client.cancel(sent)
    client.result(sent)


def test_a_signal_drains_all_goals_and_answers_before_the_process_ends(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    journal = serve("1:delay_cancel=0.5")
    server = serve_trees("--policy", "queue")
    running, waiting = client.send("move", LONG), client.send("move", LONG)
    journal.wait_for("accepted")
    server.send(signal.SIGTERM)
    for sent in (running, waiting):
        status, result = client.result(sent)
        assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, R.DEACTIVATED)
        assert result.settled
    assert server.wait() == 0
    assert journal.ends() == ["canceled"]


@pytest.mark.chaos
def test_a_tick_that_does_not_return_does_not_hold_the_process_at_the_second_signal(
    serve_trees: Serve, client: TreeClient, folder: Path
) -> None:
    hangs = "tree: hangs\nroot: {python: tests.support.trees.Hangs}\n"
    (folder / "hangs.yaml").write_text(hangs)
    server = serve_trees("--python", "tests")
    sent = client.send("hangs")
    client.until(lambda: sent.feedback, "it runs")
    until(
        lambda: server.popen.poll() is not None,
        PATIENCE,
        meanwhile=lambda: server.send(signal.SIGINT),  # those within a moment count once
    )
    assert server.wait() == 3
    assert "hangs: a behaviour does not return from its tick" in server.errors[-1]


def test_a_cancel_is_forgotten_with_a_goal_whose_client_vanished(
    node: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, request = TreeServer(node, trees=folder), RunTree.Impl.SendGoalService.Request()

    def vanish(*_: object) -> None:
        server._on_cancel(request)
        raise RCLError("gone")

    monkeypatch.setattr(server._action, "_admit", AsyncMock())
    monkeypatch.setattr(type(server._action._handle), "send_goal_response", vanish)
    asyncio.run(server._action._execute_goal_request((None, request)))
    assert not server._canceled_early
    server.close()


def test_who_has_a_result_may_send_the_next_goal_at_once(
    node: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, refusals = TreeServer(node, trees=folder), list[str]()
    goal: Any = SimpleNamespace(id=bytes(16), tree="empty", label="it", begun_at=None)
    server._turns.running.append(goal)
    assert server._turns.refusal()
    monkeypatch.setattr(server, "_answer", lambda *_: refusals.append(server._turns.refusal()))
    server._ended(goal, RunOutcome(int(Code.NONE), ""))
    assert refusals == [""]
    server.close()


OWN_NODE = """
import sys, rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from bt_actions.serving import TreeServer
rclpy.init()
node = rclpy.create_node("bt_actions_serve", namespace=sys.argv[2])
executor = SingleThreadedExecutor()
executor.add_node(node)
server = TreeServer(node, trees=sys.argv[1])
print("ready: ", flush=True)
try:
    executor.spin()
except (KeyboardInterrupt, ExternalShutdownException):
    pass
server.close()
"""


@pytest.mark.chaos
def test_where_the_context_is_shut_down_first_all_goals_are_drained_and_nobody_can_be_answered(
    serve: Callable[..., Journal],
    start_program: Callable[..., Process],
    client: TreeClient,
    folder: Path,
    space: str,
) -> None:
    journal = serve()
    server = start_program("-c", OWN_NODE, str(folder), space, short_lease=True)
    server.line("ready: ")
    client.send("move", LONG)
    journal.wait_for("accepted")
    server.send(signal.SIGINT)
    assert server.wait() == 0
    assert journal.ends() == ["canceled"]
    assert any("its client could not be answered" in line for line in server.errors)
    assert "Traceback" not in "\n".join(server.errors)


CLOSED_WHILE_SPUN = """
import sys, threading, rclpy
from bt_actions_interfaces.srv import ListTrees
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from bt_actions.serving import TreeServer
rclpy.init()
node = rclpy.create_node("bt_actions_serve", namespace=sys.argv[2])
spun, asking = MultiThreadedExecutor(2), SingleThreadedExecutor()
spun.add_node(node)
spinning = threading.Thread(target=spun.spin)
spinning.start()
asker = rclpy.create_node("asker", namespace=sys.argv[2])
asking.add_node(asker)
client = asker.create_client(ListTrees, "bt_actions_serve/list_trees")
is_over = threading.Event()

def ask():
    while not is_over.is_set():
        if client.service_is_ready():
            client.call_async(ListTrees.Request())
        asking.spin_once(0.001)

threading.Thread(target=ask).start()
for _ in range(10):
    TreeServer(node, trees=sys.argv[1]).close()
print(spinning.is_alive(), flush=True)
is_over.set()
rclpy.shutdown()
"""


def test_a_server_is_closed_while_its_node_is_spun_and_it_is_asked(
    start_program: Callable[..., Process], folder: Path, space: str
) -> None:
    program = start_program("-c", CLOSED_WHILE_SPUN, str(folder), space)
    assert program.line(within=60.0) == "True", program
