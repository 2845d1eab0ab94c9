"""A process that serves trees, a client of it, and servers below that keep a journal."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.support.processes import Process

if TYPE_CHECKING:
    from rclpy.node import Node

    from tests.support.tree_client import TreeClient

MAIN = "import sys; from bt_actions.cli import main; sys.exit(main())"
MOVE = """\
tree: move
description: Move, and say where it ended.
inputs: {{distance: {{type: float64, unit: m}}}}
outputs: {{at: float64}}
root:
  sequence: Move
  children:
    - action: Go
      type: robot_control_interfaces/action/MoveRobot
      server: {server}
      goal: {{distance: $distance}}
      timeout: {{queue: 60 s, result: 60 s, cancel: {cancel}}}
      save: {{at: result.final_pose}}
    - {{success: Done}}
"""

Serve = Callable[..., Process]


@pytest.fixture
def folder(tmp_path: Path, name: str) -> Path:
    """The folder of trees that is served."""
    folder = tmp_path / "trees"
    folder.mkdir()
    (folder / "move.yaml").write_text(MOVE.format(server=name, cancel="5 s"))
    (folder / "empty.yaml").write_text("tree: empty\nroot: {success: }\n")
    (folder / "broken.yaml").write_text("tree: broken\nroot: {sucess: }\n")
    return folder


@pytest.fixture
def space(name: str) -> str:
    """The namespace of the server."""
    return name.rpartition("/")[0]


@pytest.fixture
def serve_trees(start_program: Callable[..., Process], folder: Path, space: str) -> Serve:
    """Start `bt-actions serve` in the test's namespace, and wait until it is ready."""

    def start(*options: str) -> Process:
        command = ["-c", MAIN, "serve", "--trees", str(folder), "--namespace", space, *options]
        process = start_program(*command, short_lease=True)
        process.line("ready: ")
        return process

    return start


@pytest.fixture
def start_managed(start_program: Callable[..., Process], folder: Path, space: str) -> Serve:
    """Start `bt-actions serve --managed`, and wait until it can be managed."""

    def start(*options: str) -> Process:
        command = ["-c", MAIN, "serve", "--managed", "--trees", str(folder), *options]
        process = start_program(*command, "--namespace", space, short_lease=True)
        process.line("unconfigured: ")
        return process

    return start


@pytest.fixture(scope="module")
def fresh_context(domain: int) -> Iterator[Any]:
    """A young participant, as a client has it.

    That of all tests was seen to get no answers from new processes late in a whole run, which
    bt_actions' own clients make up for (traffic/route.py), and rclpy's do not.
    """
    from rclpy.context import Context

    context = Context()
    context.init(domain_id=domain)
    yield context
    context.shutdown()


@pytest.fixture
def client(fresh_context: Any, space: str) -> Iterator[TreeClient]:
    """A client of the server in the test's namespace."""
    from tests.support.tree_client import TreeClient

    client = TreeClient(fresh_context, space)
    yield client
    client.close()


@pytest.fixture
def new_node(context: Any, space: str) -> Iterator[Callable[[str], Node]]:
    """Make nodes in the test's namespace, which are spun."""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    executor = SingleThreadedExecutor(context=context)
    nodes: list[Node] = []

    def make(name: str) -> Node:
        nodes.append(Node(name, context=context, namespace=space))
        executor.add_node(nodes[-1])
        return nodes[-1]

    thread = threading.Thread(target=executor.spin)
    thread.start()
    yield make
    executor.shutdown()
    thread.join()
    for each in nodes:
        each.destroy_node()
