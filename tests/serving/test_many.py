"""Many things at once: two clients, files that change under load, cancels in every phase."""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from bt_actions_interfaces.action import RunTree
from bt_actions_interfaces.msg import TreeInfo
from bt_actions_interfaces.srv import ListTrees

from bt_actions.simulation import journal as journals
from tests.serving.conftest import MOVE, Serve
from tests.support.processes import Journal
from tests.support.tree_client import TreeClient
from tests.support.waiting import until

R = RunTree.Result
LONG = "{distance: 20.0}"
GOOD = """\
tree: busy
inputs: {{{inputs}}}
outputs: {{first: int32, last: int32}}
root: {{sequence: Both, children: [{{set: {{first: {n}}}}}, {{set: {{last: {n}}}}}]}}
"""
BROKEN = "tree: busy\nroot: {sucess: }\n"


@pytest.fixture
def other_client(domain: int, space: str) -> Iterator[TreeClient]:
    """A client with a participant of its own."""
    from rclpy.context import Context

    context = Context()
    context.init(domain_id=domain)
    client = TreeClient(context, space)
    yield client
    client.close()
    context.shutdown()


def test_two_clients_get_their_own_results_and_feedback(
    serve: Callable[..., Journal],
    serve_trees: Serve,
    client: TreeClient,
    other_client: TreeClient,
    folder: Path,
    name: str,
) -> None:
    both = [serve(), serve(name=f"{name}_2")]
    second = MOVE.format(server=f"{name}_2", cancel="5 s").replace("action: Go", "action: Other")
    (folder / "other.yaml").write_text(second.replace("tree: move", "tree: other"))
    serve_trees("--policy", "parallel")
    clients = [(client, "move", "Move / Go", 0.4), (other_client, "other", "Move / Other", 0.5)]
    sent = [
        (each, each.send(tree, f"{{distance: {distance}}}"), path, distance)
        for each, tree, path, distance in clients * 2
    ]
    seen: dict[str, set[str]] = {}
    for each, goal, path, distance in sent:
        status, result = each.result(goal)
        assert status == GoalStatus.STATUS_SUCCEEDED
        assert json.loads(result.outputs) == {"at": distance}
        paths = {leaf.path for message in goal.feedback for leaf in message.running}
        assert paths <= {path, "Move / Done"}
        seen.setdefault(path, set()).update(paths)  # the first may come before it is discovered
    assert all(path in seen[path] for path in seen)
    entries = [entry for each in both for entry in each.entries()]
    assert journals.max_live(sorted(entries, key=lambda entry: entry.t)) == 2


def test_each_goal_runs_one_version_of_a_file_that_changes_all_the_time(
    serve_trees: Serve, client: TreeClient, folder: Path
) -> None:
    file, versions, over = folder / "busy.yaml", itertools.count(1), threading.Event()
    file.write_text(GOOD.format(inputs="", n=0))
    serve_trees("--policy", "queue")

    def change() -> None:
        while not over.wait(0.002):
            n = next(versions)
            inputs = ["", "", "much: {type: float64}"][n % 3]
            file.write_text(BROKEN if n % 3 == 1 else GOOD.format(inputs=inputs, n=n))

    changing = threading.Thread(target=change)
    changing.start()
    ran: list[int] = []
    states: set[int] = set()
    try:

        def busy() -> bool:
            goals = [client.begin("busy") for _ in range(5)]
            for sent in map(client.accepted, goals):
                if sent.accepted:
                    status, result = client.result(sent)
                    outputs = json.loads(result.outputs)
                    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_msg
                    assert outputs["first"] == outputs["last"]
                    ran.append(outputs["first"])
            states.update(
                each.state for each in client.call(ListTrees).trees if each.name == "busy"
            )
            codes = {told.code for told in client.rejections}
            return len(set(ran)) > 20 and len(states) > 1 and "INPUTS" in codes

        until(busy, 60.0, what="20 versions have run, and all that can be told was told")
    finally:
        over.set()
        changing.join()
    assert {told.code for told in client.rejections} == {"INPUTS"}
    assert states == {TreeInfo.OK, TreeInfo.KEPT_LAST_GOOD}
    file.write_text(GOOD.format(inputs="", n=-1))
    client.result(client.send("busy"))
    file.write_text(BROKEN)
    (busy_tree,) = (each for each in client.call(ListTrees).trees if each.name == "busy")
    assert busy_tree.state == TreeInfo.KEPT_LAST_GOOD
    assert [each.code for each in busy_tree.findings] == ["BT201"]
    _, result = client.result(client.send("busy"))
    assert json.loads(result.outputs) == {"first": -1, "last": -1}


# Cancels: of one that waits in a queue and of one that runs, see test_tree_server.py


def test_a_goal_can_be_canceled_as_soon_as_it_is_accepted(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    journal = serve()
    serve_trees()
    for _ in range(20):
        sent = client.send("move", LONG)
        assert client.cancel(sent) == 1
        assert client.told(sent) == (GoalStatus.STATUS_CANCELED, R.CANCELED, True)
    assert None not in journal.ends()


@pytest.mark.chaos
def test_a_goal_that_waits_for_the_one_it_replaces_can_be_canceled(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient
) -> None:
    journal = serve("1:delay_cancel=1")
    serve_trees("--policy", "replace")
    older = client.send("move", LONG)
    journal.wait_for("accepted")
    newer = client.send("move", LONG)
    assert client.cancel(newer) == 1
    assert client.told(newer) == (GoalStatus.STATUS_CANCELED, R.CANCELED, True)
    assert client.told(older) == (GoalStatus.STATUS_ABORTED, R.REPLACED, True)
    assert journal.count("accepted") == 1


def test_a_goal_that_has_ended_cannot_be_canceled(serve_trees: Serve, client: TreeClient) -> None:
    serve_trees()
    sent = client.send("empty")
    assert client.told(sent) == (GoalStatus.STATUS_SUCCEEDED, R.NONE, True)
    assert client.cancel(sent) == 0
