"""Which robots --sim serves for a tree. No process, no ROS graph."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions import load_tree
from bt_actions.cli.driving.simulated import remark, wanted

FOREIGN = """\
tree: t
actions:
  arm: {type: robot_control_interfaces/action/MoveRobot, server: arm, timeout: 3 s}
  move: {type: robot_control_interfaces/action/MoveRobot, server: /r1/move_robot, timeout: 3 s}
root:
  sequence: S
  children:
    - {arm: A, goal: {distance: 1.0}}
    - {move: M, goal: {distance: 1.0}}
    - {service: L, type: std_srvs/srv/SetBool, server: light}
"""


@pytest.mark.parametrize(
    ("tree", "namespace", "robots"),
    [
        ("pick_and_place", "", ("/",)),
        ("pick_and_place", "/r1", ("/r1",)),
        ("sorting_cell", "", ("/left", "/right")),
        ("sorting_cell", "/cell", ("/cell/left", "/cell/right")),
    ],
)
def test_the_tree_s_own_leaves_name_the_robots(
    tree: str, namespace: str, robots: tuple[str, ...]
) -> None:
    found = wanted(load_tree(tree), namespace)
    assert (tuple(found.namespaces), remark(found)) == (robots, "")


def test_servers_that_no_robot_has_are_named(tmp_path: Path) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(FOREIGN)
    found = wanted(load_tree(path), "/cell")
    assert found.namespaces == ("/r1",)
    assert remark(found).endswith(
        "it has no server for /cell/arm (MoveRobot), /cell/light (SetBool)"
    )
