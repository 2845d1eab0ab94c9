"""The sample trees in trees/ end as they say, against the simulation."""

from __future__ import annotations

from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.document import check_file, load_tree, tree_outputs
from bt_actions.testing import Simulation, VirtualNetwork, VirtualRunner

TREES = Path(__file__).parents[2] / "trees"


@pytest.mark.parametrize("path", sorted(TREES.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_sample_trees_are_clean_with_and_without_types(path: Path) -> None:
    assert path.stem == "nav2" or check_file(path) == []  # whose types are not installed
    assert check_file(path, types=False) == []


def simulated(root: Behaviour, *namespaces: str) -> Simulation:
    """Run a tree against robots in these namespaces."""
    network = VirtualNetwork()
    simulation = Simulation(network, namespaces=namespaces or ("",))
    VirtualRunner(root, network).run()
    return simulation


def test_four_steps_end_in_success() -> None:
    root = load_tree(TREES / "four_steps.yaml")
    simulation = simulated(root)
    assert root.status is Status.SUCCESS
    assert simulation.world().robot.current_pose == pytest.approx(5.0, abs=0.02)


def test_pick_and_place_ends_with_the_part_at_the_shelf() -> None:
    root = load_tree(TREES / "pick_and_place.yaml")
    simulation = simulated(root)
    assert root.status is Status.SUCCESS
    assert simulation.world().part.station == "shelf"
    assert tree_outputs(root)["final_pose"] == pytest.approx(5.0, abs=0.02)


def test_pick_and_place_that_cannot_grasp_recovers_and_ends_in_failure() -> None:
    root = load_tree(TREES / "pick_and_place.yaml", {"pick_at": 3.0})
    simulation = simulated(root)
    assert root.status is Status.FAILURE
    assert simulation.world().robot.current_pose == pytest.approx(0.0, abs=0.02)
    assert tree_outputs(root) == {}


def test_the_patrol_visits_each_station_in_each_round() -> None:
    root = load_tree(TREES / "patrol.yaml", {"rounds": 2, "stations": [1.0, 0.5]})
    simulated(root)
    assert root.status is Status.SUCCESS
    assert tree_outputs(root) == {"visits": 4}


def test_the_patrol_ends_when_the_battery_is_low() -> None:
    inputs = {"rounds": 1000, "stations": [9.0, -9.0], "reserve": 0.95}
    root = load_tree(TREES / "patrol.yaml", inputs)
    simulated(root)
    assert root.status is Status.FAILURE
    assert 0 < tree_outputs(root)["visits"] < 2000  # type: ignore[operator]


def test_the_sorting_cell_works_with_two_robots() -> None:
    root = load_tree(TREES / "sorting_cell.yaml", {"inspect": [4.0, 1.0]})
    simulation = simulated(root, "left", "right")
    assert root.status is Status.SUCCESS
    for side in ("left", "right"):
        assert simulation.world(side).part.station == "shelf"
    assert tree_outputs(root) == {
        "left_at": pytest.approx(1.0, abs=0.02),
        "right_at": pytest.approx(1.0, abs=0.02),
    }
