"""Which robots --sim serves for a tree. No process, no ROS graph."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_actions import load_tree
from bt_actions.cli.driving.simulated import Wanted, remark, wanted

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

LISTENING = """\
tree: t
topics:
  battery: {topic: battery_state, type: sensor_msgs/msg/BatteryState, qos: sensor}
  level: {topic: level, type: std_msgs/msg/Float64}
  unread: {topic: unread, type: std_msgs/msg/Float64}
root:
  sequence: S
  children:
    - check: $battery.percentage > 0.2
    - {wait_for_message: D, topic: /door, type: std_msgs/msg/Bool, timeout: 3 s}
    - {wait_until: $level.data > 0.0, timeout: 3 s}
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


def test_the_topics_that_a_tree_reads_are_named_beside_a_recorded_run(tmp_path: Path) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(LISTENING)
    found = wanted(load_tree(path), "/cell")
    assert found.topics == ("/cell/battery_state", "/door", "/cell/level")
    assert remark(found, recorded=True) == (
        "--sim-like serves actions; it has no server for /cell/light (SetBool), and it plays no "
        "recorded messages on /cell/battery_state, /door, /cell/level (a robot's battery is full)"
    )
    assert remark(Wanted(("/",), ()), recorded=True) == ""
