"""MoveRobot and Gripper in py_trees' own XML trees, by their ports."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml

from bt_actions import ActionBehaviour, Outcome
from bt_actions.testing import Simulation, VirtualNetwork, VirtualRunner

XML = """\
<root main_tree_to_execute="Fetch">
  <BehaviorTree ID="Fetch">
    <Sequence name="Fetch">
      <Gripper name="Open" position="100.0" timeout="10"/>
      <MoveRobot name="There" distance="2.0" final_pose="{at}" timeout="30.0" attempts="2"/>
      <Gripper name="Grasp" position="0.0" timeout="10"/>
      <MoveRobot name="Again" distance="{at}" timeout="30"/>
    </Sequence>
  </BehaviorTree>
</root>
"""


def parse(folder: Path, text: str = XML) -> Behaviour:
    path = folder / "tree.xml"
    path.write_text(text)
    return parse_behaviour_tree_xml(str(path))


def test_the_tags_stand_for_our_leaves_with_their_settings(tmp_path: Path) -> None:
    root = parse(tmp_path)
    opened, there, _, _ = root.children
    assert isinstance(opened, ActionBehaviour)
    assert isinstance(there, ActionBehaviour)
    assert (opened.action_name, opened.timeouts.result) == ("gripper_control", 10.0)
    assert (there.retry.attempts, there.timeouts.result) == (2, 30.0)


@pytest.mark.parametrize(
    "imports", ["bt_actions, py_trees.parsers", "py_trees.parsers, bt_actions"]
)
def test_importing_the_package_is_enough(imports: str, tmp_path: Path) -> None:
    path = tmp_path / "tree.xml"
    path.write_text(XML)
    code = (
        f"import sys, {imports}\n"
        "from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml as parse\n"
        "print([type(child).__name__ for child in parse(sys.argv[1]).children])\n"
    )
    command = [sys.executable, "-c", code, str(path)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said == f"{['GripperWithPorts', 'MoveRobotWithPorts'] * 2}\n"


def test_an_xml_tree_runs_and_passes_results_from_port_to_port(tmp_path: Path) -> None:
    root = parse(tmp_path)
    network = VirtualNetwork()
    simulation = Simulation(network)
    assert VirtualRunner(root, network).run() is Status.SUCCESS
    assert simulation.world().part.held_by is not None
    again = root.children[3]
    assert again.result.final_pose == pytest.approx(2.0, abs=0.02)  # type: ignore[attr-defined]


def test_a_port_without_data_makes_the_goal_invalid(tmp_path: Path) -> None:
    root = parse(tmp_path, XML.replace('distance="2.0"', 'distance="{nowhere}"'))
    network = VirtualNetwork()
    Simulation(network)
    VirtualRunner(root, network).run()
    assert root.children[1].outcome is Outcome.INVALID_GOAL  # type: ignore[attr-defined]
