"""The runs of a server on its topics ~/events and ~/tree."""

from __future__ import annotations

import importlib
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from py_trees.common import Status
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from bt_actions.events import RunEnded
from bt_actions.serving import TreeServer
from tests.serving.conftest import Serve
from tests.support.listener import Listener
from tests.support.processes import Journal, Process
from tests.support.tree_client import Sent, TreeClient
from tests.support.waiting import until

SECRET = "hunter2"
FAR = "0.71825"
TELLS = """\
tree: tells
description: Values and a secret, wherever a tree can have them.
inputs:
  far: {{type: float64}}
  pin: {{type: string, secret: true, default: {secret}}}
outputs: {{at: float64, code: string}}
root:
  sequence: All
  children:
    - action: Go
      type: robot_control_interfaces/action/MoveRobot
      server: {server}
      goal: {{distance: $far}}
      timeout: 20 s
      expect: result.final_pose == $far
      save: {{at: result.final_pose}}
    - {{log: "at $(at) with $(pin)"}}
    - {{set: {{code: $pin}}}}
    - {{check: $at < 0.0}}
"""


@pytest.fixture
def listener(client: TreeClient, space: str) -> Listener:
    return Listener(client.node, f"{space}/bt_actions_serve")


def request(sent: Sent) -> str:
    return bytes(sent.handle.goal_id.uuid).hex()


def test_two_runs_of_one_server_are_told_apart(
    serve: Callable[..., Journal], serve_trees: Serve, client: TreeClient, listener: Listener
) -> None:
    serve()
    serve_trees("--policy", "parallel")
    client.until(lambda: listener.trees, "the topics are there")
    sent = [client.send("move", f"{{distance: {far}}}") for far in (0.6, 0.8)]
    client.until(lambda: any(len(each.runs) == 2 for each in listener.trees), "both run")
    results = [client.told(each) for each in sent]
    client.until(lambda: all(each.ended for each in listener.runs.values()), "both have ended")
    runs = {state.began.request: state for state in listener.runs.values() if state.began}
    assert runs.keys() == set(map(request, sent))
    for each, (_, code, _) in zip(sent, results, strict=True):
        state = runs[request(each)]
        assert state.status is Status.SUCCESS
        assert state.ended is not None
        assert state.ended.exit_code == code
    for run_id in listener.runs:
        numbers = [each.number for each in listener.events if bytes(each.run_id).hex() == run_id]
        assert numbers == list(range(1, len(numbers) + 1))
    client.until(lambda: len(listener.trees[-1].runs) == 1, "the latest stays")


def test_the_example_tells_of_each_event_and_why_a_run_has_failed(
    start_program: Callable[..., Process],
    serve_trees: Serve,
    client: TreeClient,
    folder: Path,
    space: str,
) -> None:
    (folder / "fails.yaml").write_text("tree: fails\nroot: {failure: No luck}\n")
    serve_trees()
    watching = start_program("-u", "examples/watch_runs.py", f"{space}/bt_actions_serve")

    def has_heard() -> bool:
        client.told(client.send("fails"))
        return any("RunEnded" in line for line in watching.lines)

    client.until(has_heard, "an end is told")
    watching.line("NodeChanged No luck")
    watching.line("fails.yaml:2:8")
    watching.send(signal.SIGINT)
    assert watching.wait() == 0, watching
    assert not watching.errors, watching


def test_the_topics_go_with_the_server(new_node: Callable[[str], Node], folder: Path) -> None:
    node = new_node("ours")
    server = TreeServer(node, trees=folder)
    topics = [f"{node.get_fully_qualified_name()}/{name}" for name in ("events", "tree")]
    assert [node.count_publishers(each) for each in topics] == [1, 1]
    server.close()
    until(lambda: not any(node.count_publishers(each) for each in topics))
    assert not [each for each in threading.enumerate() if each.name == "bt_actions-topics"]


@pytest.mark.parametrize("options", [[], ["--publish-values"]], ids=["no values", "values"])
def test_values_go_over_ros_where_that_is_wanted_and_secrets_never(
    serve: Callable[..., Journal],
    serve_trees: Serve,
    client: TreeClient,
    listener: Listener,
    folder: Path,
    name: str,
    space: str,
    options: list[str],
) -> None:
    serve()
    (folder / "tells.yaml").write_text(TELLS.format(server=name, secret=SECRET))
    said: list[bytes] = []
    messages = importlib.import_module("bt_actions_interfaces.msg")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    for kind, topic, qos in (("RunEvent", "events", 1000), ("RunStates", "tree", latched)):
        base = f"{space}/bt_actions_serve"
        client.node.create_subscription(
            getattr(messages, kind), f"{base}/{topic}", said.append, qos, raw=True
        )
    serve_trees(*options)
    client.until(lambda: len(said) and listener.trees, "the topics are there")
    client.told(client.send("tells", f"{{far: {FAR}}}"))
    client.until(
        lambda: (
            any(RunEnded.__name__.encode() in each for each in said)
            and any(state.ended for state in listener.runs.values())
        ),
        "the end is told",
    )
    whole = b"".join(said)
    assert (FAR.encode() in whole) is bool(options)
    assert SECRET.encode() not in whole
    (state,) = listener.runs.values()
    assert state.status is Status.FAILURE
    assert [failure.node.kind for failure in state.failures] == ["check"]
