"""Each tree of docs/recipes.md does what the page says of it, in virtual time."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import pytest
from bt_actions_interfaces.action import RunTree
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool

from bt_actions import Outcome, load_tree
from bt_actions.document import check_file, tree_outputs
from bt_actions.testing import Script, ScriptedServer, Simulation, VirtualNetwork, VirtualRunner

PAGE = (Path(__file__).parents[1] / "docs" / "recipes.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```yaml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
RECIPES = {text.split()[1]: text for text in BLOCKS}


class Kitchen:
    """Cooks one recipe."""

    def __init__(self, name: str, folder: Path) -> None:
        path = folder / f"{name}.yaml"
        path.write_text(RECIPES[name], encoding="utf-8")
        assert list(check_file(path)) == []
        self.network = VirtualNetwork()
        self.tree = load_tree(path)
        self.runner = VirtualRunner(self.tree, self.network)

    def outcomes(self) -> list[str]:
        return [
            leaf if outcome is Outcome.SUCCEEDED else f"{leaf}: {outcome}"
            for leaf, outcome in self.runner.outcomes
        ]


def test_a_group_is_tried_again_after_what_recovers(tmp_path: Path) -> None:
    kitchen = Kitchen("retry_group", tmp_path)
    Simulation(kitchen.network)  # its gripper is closed at first, and grips nothing so
    assert kitchen.runner.run() is Status.SUCCESS
    assert kitchen.outcomes() == [
        *("To the part", "Grasp: UNEXPECTED_RESULT", "Open again"),
        *("To the part", "Grasp"),
    ]


def test_failures_are_counted_over_a_loop(tmp_path: Path) -> None:
    kitchen = Kitchen("count_failures", tmp_path)
    Simulation(kitchen.network)
    assert kitchen.runner.run() is Status.SUCCESS
    assert tree_outputs(kitchen.tree) == {"failed": 1}
    assert kitchen.outcomes() == [*("To the station", "To the station: REJECTED", "To the station")]


def test_a_robot_charges_from_the_lower_threshold_to_the_upper(tmp_path: Path) -> None:
    kitchen = Kitchen("hysteresis", tmp_path)
    robot = ScriptedServer(kitchen.network, MoveRobot, "move_robot", Script(duration=2.0))
    battery = kitchen.network.publisher(BatteryState, "battery_state")
    kitchen.runner.start()

    def pass_by(seconds: int, level: float) -> None:
        for _ in range(seconds):
            battery.publish(BatteryState(percentage=level))
            assert kitchen.runner.advance(1.0) is None

    pass_by(3, 0.5)
    pass_by(3, 0.1)
    assert kitchen.outcomes() == ["There", "Back"], "the round was finished"
    pass_by(9, 0.5)
    assert kitchen.outcomes()[2:] == ["Home"]
    assert robot.live_goals == [], "it charges"
    pass_by(1, 0.9)
    assert len(robot.live_goals) == 1
    battery.publish(BatteryState(percentage=0.9))
    assert kitchen.runner.run() is Status.SUCCESS
    assert kitchen.outcomes()[3:] == ["There", "Back"]


def test_a_round_that_a_while_leaves_in_the_middle_fails_no_patrol(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, round_of_it = RECIPES["hysteresis"].split("    else:\n")
    around = "force_success: Or not\nchild:\n  while: $battery.percentage > 0.2\n  child:\n"
    inside = around + textwrap.indent(textwrap.dedent(round_of_it), "    ")
    left = before + "    else:\n" + textwrap.indent(inside, "      ")
    monkeypatch.setitem(RECIPES, "hysteresis", left)
    kitchen = Kitchen("hysteresis", tmp_path)
    ScriptedServer(kitchen.network, MoveRobot, "move_robot", Script(duration=2.0))
    battery = kitchen.network.publisher(BatteryState, "battery_state")
    kitchen.runner.start()
    for level in [0.5] * 3 + [0.1] * 6:
        battery.publish(BatteryState(percentage=level))
        assert kitchen.runner.advance(1.0) is None
    assert kitchen.outcomes() == ["There: CANCELED", "Home"]


@pytest.mark.parametrize(
    ("recipe", "takes"), [("pause", 0.5 + 2.0 + 5.0 + 2.0 + 0.5), ("rate", 2.0 + 5.0 + 2.0)]
)
def test_a_pause_is_from_end_to_begin_and_a_rate_from_begin_to_begin(
    recipe: str, takes: float, tmp_path: Path
) -> None:
    kitchen = Kitchen(recipe, tmp_path)
    seconds = iter([0.5, 5.0, 0.5])
    script = Script(duration=lambda _goal: next(seconds))
    ScriptedServer(kitchen.network, MoveRobot, "move_robot", script)
    assert kitchen.runner.run() is Status.SUCCESS
    assert kitchen.network.now() == pytest.approx(takes, abs=0.1)


def test_a_button_interrupts_what_runs(tmp_path: Path) -> None:
    kitchen = Kitchen("button", tmp_path)
    Simulation(kitchen.network)
    button = kitchen.network.publisher(Bool, "button")
    kitchen.runner.start()
    assert kitchen.runner.advance(3.0) is None
    button.publish(Bool(data=True))
    assert kitchen.runner.run() is Status.SUCCESS
    assert kitchen.outcomes() == ["A long way: CANCELED", "Home"]


def test_one_robot_of_a_fleet_at_a_time(tmp_path: Path) -> None:
    kitchen = Kitchen("corridor", tmp_path)
    script = Script(duration=5.0, result=lambda _goal: RunTree.Result(settled=True, outputs="{}"))
    robots = [
        ScriptedServer(kitchen.network, RunTree, f"/r{number}/run_tree", script)
        for number in (1, 2)
    ]
    kitchen.runner.start()
    while kitchen.runner.advance(0.5) is None:
        assert sum(len(robot.live_goals) for robot in robots) == 1
    assert kitchen.outcomes() == ["First robot", "Second robot"]


def test_the_page_has_no_other_recipe() -> None:
    tests = Path(__file__).read_text(encoding="utf-8")
    assert [name for name in RECIPES if f'("{name}", ' not in tests] == []
