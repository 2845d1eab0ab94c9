"""Nodes of runs have valid names of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from rclpy.validate_node_name import validate_node_name

from bt_actions.ros import naming
from bt_actions.ros.naming import Outlook, named_node, node_name
from bt_actions.ros.workarounds import participant
from tests.support.waiting import until


@pytest.mark.parametrize(
    ("tree", "name"),
    [
        ("pick_and_place", "bt_actions_pick_and_place"),
        ("Größe 2/b", "bt_actions_Groudfe_2_b"),
        ("部", "bt_actions_u90e8"),
        ("x" * 300, "bt_actions_" + "x" * 89),
    ],
)
def test_a_tree_of_any_name_gives_a_node_a_valid_one(tree: str, name: str) -> None:
    assert node_name(tree) == name
    assert validate_node_name(name)


def test_a_name_that_is_seen_already_gets_a_number_and_a_warning(
    context: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from rclpy.node import Node

    file = tmp_path / "parameters.yaml"
    file.write_text("/taken/deliver:\n  ros__parameters: {use_sim_time: true}\n")
    monkeypatch.setattr("sys.argv", ["", "--ros-args", "--params-file", str(file)])
    said: list[str] = []
    monkeypatch.setattr(naming.log, "warning", said.append)
    others = [Node(name, context=context, namespace="/taken") for name in ("deliver", "deliver_2")]
    outlook = Outlook()
    until(lambda: {("deliver", "/taken"), ("deliver_2", "/taken")}
          <= set(outlook._node.get_node_names_and_namespaces()), 10.0)  # fmt: skip
    node = named_node("deliver", outlook.context, "/taken")
    assert node.get_name() == "deliver_3"
    assert node.get_parameter("use_sim_time").value is True, "parameters are of the name asked for"
    free = named_node("deliver", outlook.context, "/free")
    assert free.get_name() == "deliver"
    assert said == [
        f"another node is called /taken/{taken}: this one is /taken/{mine}; "
        "--ros-args -r __node:=NAME gives another"
        for taken, mine in (("deliver", "deliver_2"), ("deliver_2", "deliver_3"))
    ]
    free.destroy_node()
    outlook.hand_over()
    participant.close(node)
    for each in others:
        each.destroy_node()
