"""Two servers of one action: the one that has been there longest answers, the other says so."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.srv import CheckTree
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.action import ActionServer
from rclpy.node import Node

from bt_actions.ros.graph import servers
from bt_actions.serving import TreeServer
from bt_actions.utilities.ids import new_id
from tests.serving.conftest import MAIN, Serve
from tests.support.processes import Process
from tests.support.tree_client import TreeClient
from tests.support.waiting import until


@pytest.fixture
def start_second(start_program: Callable[..., Process], folder: Path, space: str) -> Serve:
    """Start `bt-actions serve` in the same namespace, without waiting for anything."""

    def start(*options: str) -> Process:
        command = ["-c", MAIN, "serve", "--trees", str(folder), "--namespace", space, *options]
        return start_program(*command, short_lease=True)

    return start


def waits(second: Process, first: Process, space: str) -> None:
    """See the second say that the first one answers."""
    told = f"process {first.popen.pid} has served {space}/run_tree for longer"
    assert told in second.line("waiting: ")
    until(lambda: any(f"accepts no goals: {told}" in line for line in second.errors))


def begun(process: Process) -> int:
    return sum(" begins (" in line for line in process.errors)


def test_a_second_server_says_so_and_leaves_every_goal_to_the_first(
    serve_trees: Serve, start_second: Serve, client: TreeClient, space: str
) -> None:
    first = serve_trees()
    second = start_second()
    waits(second, first, space)
    levels: dict[str, set[bytes]] = {}

    def hear(message: DiagnosticArray) -> None:
        for each in message.status:
            if each.hardware_id == space and each.name.endswith(": empty"):
                levels.setdefault(each.name, set()).add(each.level)

    client.node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    for _ in range(5):
        sent = client.send("empty")
        assert client.result(sent)[0] == GoalStatus.STATUS_SUCCEEDED
        assert client.cancel(sent) == 0
        asked = client.call(CheckTree, tree="empty")
        assert not any(each.code == "INACTIVE" for each in asked.findings), "the first is asked"
    until(lambda: begun(first) == 5)
    assert begun(second) == 0
    node = f"{space}/bt_actions_serve"
    told = {
        f"{node}: empty": {DiagnosticStatus.OK},
        f"{node} (process {second.popen.pid}): empty": {DiagnosticStatus.ERROR},
    }
    client.until(lambda: levels == told, "it is in the diagnostics")
    first.send(signal.SIGTERM)
    assert first.wait() == 0
    second.line("ready: ")
    assert client.result(client.send("empty"))[0] == GoalStatus.STATUS_SUCCEEDED
    until(lambda: begun(second) == 1)


def test_where_the_first_was_killed_on_this_machine_the_second_answers_at_once(
    serve_trees: Serve, start_second: Serve, client: TreeClient, space: str
) -> None:
    first = serve_trees()
    second = start_second()
    waits(second, first, space)
    first.send(signal.SIGKILL)
    second.line("ready: ")
    third = start_second()
    waits(third, second, space)


def test_of_two_that_have_both_begun_the_later_one_yields(
    new_node: Callable[[str], Node], folder: Path
) -> None:
    first, second = (TreeServer(new_node(name), trees=folder) for name in ("one", "two"))
    until(lambda: second.precedence.why)
    assert not first.precedence.yields()
    first.close()
    until(lambda: not second.precedence.why)
    second.close()


def test_a_server_that_is_none_of_trees_comes_first(
    new_node: Callable[[str], Node], folder: Path
) -> None:
    foreign = ActionServer(new_node("other"), RunTree, "run_tree", lambda goal: RunTree.Result())
    server = TreeServer(new_node("ours"), trees=folder)
    until(lambda: "no server of trees" in server.precedence.why)
    foreign.destroy()
    until(lambda: not server.precedence.why)
    server.close()


AUTHORS = {
    "this process": new_id,
    "a dead one": lambda: bytes.fromhex(subprocess.check_output(MAKE_ID, text=True)),
    "another machine's": lambda: new_id()[:3] + b"???" + new_id()[6:],
}
MAKE_ID = [
    sys.executable,
    "-c",
    "from bt_actions.utilities.ids import new_id; print(new_id().hex())",
]


@pytest.mark.parametrize(
    ("author", "why"),
    [
        ("this process", f"process {os.getpid()} has served"),
        ("a dead one", ""),
        ("another machine's", "a process on another machine has served"),
    ],
    ids=AUTHORS,
)
def test_who_was_there_earlier_counts_unless_it_is_dead(
    new_node: Callable[[str], Node], folder: Path, author: str, why: str
) -> None:
    node, ours = new_node("other"), new_node("ours")
    claim = f"run_tree/_since/t{1:020d}_{AUTHORS[author]().hex()}"
    node.create_publisher(Time, claim, 1)
    other = ActionServer(node, RunTree, "run_tree", lambda goal: RunTree.Result())
    until(lambda: servers(ours, "run_tree"))
    until(lambda: ours.count_publishers(claim))
    server = TreeServer(ours, trees=folder)
    until(lambda: len(servers(ours, "run_tree")) == 2)
    server.precedence.yields()
    assert server.precedence.why.startswith(why)
    assert bool(server.precedence.why) is bool(why)
    server.close()
    other.destroy()


def test_one_that_yields_sees_its_own_goals_to_their_end_and_answers_no_other_question(
    new_node: Callable[[str], Node],
    client: TreeClient,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (folder / "waits.yaml").write_text("tree: waits\nroot: {wait: 1 h}\n")
    server = TreeServer(new_node("ours"), trees=folder)
    ours = client.send("waits")
    monkeypatch.setattr(server.precedence, "_look", lambda: "another has")
    new = client.begin("empty")
    unknown = client.begin_cancel(bytes(range(16)))
    assert client.cancel(ours) == 1
    assert client.result(ours)[0] == GoalStatus.STATUS_CANCELED
    assert not new.request.done()
    assert not unknown.done()
    server.close()
