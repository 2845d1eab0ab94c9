"""`bt-actions list`: the trees of a server in another process."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from bt_actions_interfaces.msg import TreeInfo, TreeInput
from bt_actions_interfaces.srv import ListTrees
from rclpy.node import Node

from bt_actions.cli.commands.list_trees import text_of, tree_data
from bt_actions.document.load import open_tree
from bt_actions.ros.serving.endpoints import Endpoints
from bt_actions.serving.catalog import ServedTree
from bt_actions.serving.client import trees_in_sight
from bt_actions.serving.messages import info
from bt_actions.utilities.plain_text import as_json
from tests.serving.conftest import MAIN, Serve
from tests.support.processes import Process


def test_trees_are_listed_with_inputs_and_what_is_wrong_with_them(
    serve_trees: Serve, start_program: Callable[..., Process], space: str
) -> None:
    serve_trees()
    process = start_program("-c", MAIN, "list", "--namespace", space, short_lease=True)
    assert process.wait(30.0) == 0, process
    assert process.lines[0] == f"{space}/bt_actions_serve"
    at = process.lines.index("  move  Move, and say where it ended.")
    assert process.lines[at + 1] == "    distance: float64 [m]"
    at = process.lines.index("  broken")
    assert process.lines[at + 1].startswith("    INVALID: ")
    assert "broken.yaml:2:" in process.lines[at + 1]

    process = start_program("-c", MAIN, "list", "--namespace", space, "--json", short_lease=True)
    assert process.wait(30.0) == 0, process
    (trees,) = json.loads(process.lines[0]).values()
    assert {each["name"]: each["state"] for each in trees} == {
        "broken": "INVALID", "empty": "OK", "move": "OK",
    }  # fmt: skip


def test_where_no_server_is_in_sight_it_says_what_to_look_for(
    start_program: Callable[..., Process], space: str
) -> None:
    process = start_program("-c", MAIN, "list", "--namespace", space, short_lease=True)
    assert process.wait(30.0) == 1, process
    assert "is `bt-actions serve` running" in "\n".join(process.errors)


def test_what_a_server_says_cannot_command_the_terminal() -> None:
    hostile = "\x1b[2J\nx"
    tree = TreeInfo(
        name=hostile, description=hostile, inputs=[TreeInput(name=hostile, default_json=hostile)]
    )
    text = "".join(text_of({"/s": [tree_data(tree)]}))
    assert "\x1b" not in text
    assert "\n" not in text


def test_the_default_of_a_secret_is_not_listed(tmp_path: Path) -> None:
    file = tmp_path / "t.yaml"
    file.write_text(
        "tree: t\ninputs: {pin: {type: string, secret: true, default: x}}\nroot: {log: $pin}\n"
    )
    (pin,) = info(ServedTree("t", file, open_tree(file), "", (), {}), ()).inputs
    assert (pin.name, pin.default_json) == ("pin", as_json("•••"))


def test_a_server_that_was_not_asked_at_first_is_asked_again(
    new_node: Callable[[str], Node], space: str
) -> None:
    """As where another server of the service, which leaves it to this one, was discovered first."""
    asked: list[ListTrees.Request] = []

    def answer(request: ListTrees.Request, response: ListTrees.Response) -> ListTrees.Response:
        asked.append(request)
        return response

    endpoints = Endpoints(new_node("bt_actions_serve"))
    endpoints.service(ListTrees, "~/list_trees", answer, silent=lambda: len(asked) < 2)
    assert trees_in_sight(space) == {f"{space}/bt_actions_serve": []}
    endpoints.close()
