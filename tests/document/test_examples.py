"""Each example of docs/yaml.md runs against servers and topics, and ends as it should."""

from __future__ import annotations

import re
import runpy
import textwrap
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from bt_actions_interfaces.action import RunTree
from geometry_msgs.msg import Polygon, PoseStamped
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

from bt_actions.behaviours.kinds import kind as in_words
from bt_actions.document import check_file, load_tree, tree_outputs
from bt_actions.document.formatting.format import format_source
from bt_actions.document.kinds import KINDS
from bt_actions.document.yaml.source import read_source
from bt_actions.events import Logged
from bt_actions.testing import Script, ScriptedServer, Simulation, VirtualNetwork, VirtualRunner
from tests.support.trees import unheard

ROOT = Path(__file__).parents[2]
FILES = sorted(ROOT.glob("examples/*.yaml"))
ALIAS: str = runpy.run_path(str(ROOT / "scripts" / "yaml_doc.py"))["ALIAS_EXAMPLE"]
HEAD = """
tree: t
inputs: {level: {type: float64, default: 1.0}, count: {type: int32, default: 1}}
actions:
  move: {type: robot_control_interfaces/action/MoveRobot, server: move_robot, timeout: 30 s}
root:
"""
NEVER = "its example never ends"
ENDS = {
    **dict.fromkeys(KINDS, Status.SUCCESS),
    "force_failure": Status.FAILURE,
    "failure": Status.FAILURE,
    "subtree": Status.FAILURE,  # recover.yaml reports that the work was not done
    "running": NEVER,
}


class Surroundings:
    """What the examples meet: three robots, a light, a door that tells it is open, other trees."""

    def __init__(self) -> None:
        self.network = VirtualNetwork("/examples")
        self.robots = Simulation(self.network, namespaces=("", "cell/left", "cell/right"))
        answer = RunTree.Result(settled=True, outputs='{"at": 2.0}')
        ScriptedServer(self.network, RunTree, "/r1/run_tree", Script(result=lambda _: answer))
        self.heard: dict[str, list[Any]] = defaultdict(list)
        self.network.provide(SetBool, "light", self._switch)
        for name, kind in (
            ("lamp", Bool),
            ("target", PoseStamped),
            ("route", JointTrajectory),
            ("supply", BatteryState),
            ("area", Polygon),
        ):
            self.network.subscribe(kind, name, self.heard[name].append)
        self._open()

    def _open(self) -> None:
        """Say so ten times a second."""
        self.network.publish("door", Bool(data=True))
        self.network.timeline.call_in(0.1, self._open)

    def _switch(self, request: Any) -> SetBool.Response:
        self.heard["light"].append(request.data)
        return SetBool.Response(success=True)

    def pose(self, robot: str = "") -> float:
        return self.robots.world(robot).robot.current_pose

    def run(self, root: Behaviour, timeout: float = 60.0) -> Status:
        """Run a tree."""
        return VirtualRunner(root, self.network).run(timeout)


@pytest.fixture
def around() -> Surroundings:
    return Surroundings()


Node = Callable[[str], Behaviour]


@pytest.fixture
def node(tmp_path: Path) -> Node:
    """A tree of one node, as the page shows it."""

    def load(example: str) -> Behaviour:
        path = tmp_path / "tree.yaml"
        path.write_text(HEAD + textwrap.indent(example, "  "), encoding="utf-8")
        return load_tree(path)

    return load


def example(name: str) -> Behaviour:
    return load_tree(ROOT / "examples" / f"{name}.yaml")


def test_the_page_shows_these_examples_and_no_others() -> None:
    page = (ROOT / "docs" / "yaml.md").read_text(encoding="utf-8")
    shown = re.findall(r"^```yaml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    run = [path.read_text(encoding="utf-8") for path in FILES]
    run += [f"{text}\n" for text in (ALIAS, *(kind.example for kind in KINDS.values()))]
    assert sorted(shown) == sorted(run)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_an_example_is_without_warnings_and_in_canonical_form(path: Path) -> None:
    assert check_file(path) == []
    assert format_source(read_source(path)) == path.read_text(encoding="utf-8")


# Kinds


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_the_example_of_a_kind_ends_as_it_should(
    around: Surroundings, node: Node, kind: str
) -> None:
    root = node(KINDS[kind].example)
    if ENDS[kind] is NEVER:
        with pytest.raises(TimeoutError):
            around.run(root, timeout=0.5)
    else:
        assert around.run(root) is ENDS[kind]


def test_a_behaviour_is_called_as_its_kind(node: Node) -> None:
    called = {name: in_words(node(kind.example)).partition(",")[0] for name, kind in KINDS.items()}
    assert called == {**{name: name for name in KINDS}, "python": "Periodic"}


def test_what_looks_at_nothing_but_its_children_or_its_goal_costs_no_ticks(node: Node) -> None:
    def watches(root: Behaviour) -> bool:
        visitor = unheard()
        root.status = Status.RUNNING
        visitor.run(root)
        visitor.finish()
        return visitor.watching

    watching = {name for name, kind in KINDS.items() if watches(node(kind.example))}
    assert KINDS.keys() - watching == {
        *("sequence", "fallback", "parallel", "retry", "repeat", "for_each", "subtree"),
        "pipeline",
        *("invert", "force_success", "force_failure", "run_once", "action", "run_tree"),
    }


@pytest.mark.parametrize("text", [ALIAS, KINDS["action"].example], ids=["alias", "action"])
def test_the_robot_is_where_the_example_of_an_action_sends_it(
    around: Surroundings, node: Node, text: str
) -> None:
    around.run(node("{action: Away, type: robot_control_interfaces/action/MoveRobot,"
                    " server: move_robot, goal: {distance: 1.0}}"))  # fmt: skip
    around.run(node(text))
    assert around.pose() == pytest.approx(2.0, abs=0.02)


def test_the_robot_is_home_after_the_example_of_a_subtree(around: Surroundings, node: Node) -> None:
    around.run(node(ALIAS))
    around.run(node(KINDS["subtree"].example))
    assert around.pose() == pytest.approx(0.0, abs=0.02)


def test_the_light_is_switched_by_the_example_of_a_service(
    around: Surroundings, node: Node
) -> None:
    around.run(node(KINDS["service"].example))
    assert around.heard["light"] == [True]


def test_the_lamp_hears_the_example_of_publish(around: Surroundings, node: Node) -> None:
    around.run(node(KINDS["publish"].example))
    assert [message.data for message in around.heard["lamp"]] == [True]


# Files


def test_the_first_example_fetches(around: Surroundings) -> None:
    root = example("fetch")
    assert around.run(root) is Status.SUCCESS
    assert tree_outputs(root) == {"final_pose": pytest.approx(2.0, abs=0.02)}


def test_messages_arrive_with_what_their_conveniences_stand_for(around: Surroundings) -> None:
    while around.network.now() < 5.0:
        around.network.timeline.advance(5.0)
    names = ("target", "route", "supply", "area")
    assert around.run(example("messages")) is Status.SUCCESS
    target, route, supply, area = (around.heard[name][-1] for name in names)
    assert target.header.stamp.sec == 5
    assert (target.header.frame_id, target.pose.position.x) == ("map", 1.5)
    turned = target.pose.orientation
    assert (turned.z, turned.w) == (pytest.approx(0.5**0.5), pytest.approx(0.5**0.5))
    starts = [point.time_from_start for point in route.points]
    assert [(start.sec, start.nanosec) for start in starts] == [(0, 500_000_000), (2, 0)]
    assert supply.power_supply_status == type(supply).POWER_SUPPLY_STATUS_CHARGING
    assert [(point.x, point.y) for point in area.points] == [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]


def test_a_topic_is_read_as_a_variable(around: Surroundings) -> None:
    root = example("topics")
    assert around.run(root) is Status.SUCCESS
    assert tree_outputs(root) == {"was_open": True}


def test_a_tree_s_own_words_win_over_those_that_it_imports(around: Surroundings) -> None:
    root = example("imports")
    assert around.run(root) is Status.SUCCESS
    assert around.pose() == pytest.approx(2.0, abs=0.02)
    _, opening, move = root.children
    settings: list[Any] = [opening, move]
    assert [leaf.timeouts.result for leaf in settings] == [5.0, 30.0]
    assert [leaf.retry.attempts for leaf in settings] == [2, 2]


def test_defaults_merge_key_by_key(around: Surroundings) -> None:
    root = example("defaults")
    assert around.run(root) is Status.SUCCESS
    leaves: list[Any] = list(root.children)
    times = [
        (leaf.timeouts.server, leaf.timeouts.result, leaf.timeouts.feedback) for leaf in leaves
    ]
    assert times == [(3.0, 30.0, 2.0), (3.0, 60.0, 2.0)]
    assert [leaf.retry.attempts for leaf in leaves] == [3, 1]


def test_a_tree_recovers_before_its_last_attempt(around: Surroundings) -> None:
    root = example("recovering")
    assert around.run(root) is Status.SUCCESS
    assert around.pose() == pytest.approx(2.0, abs=0.02)
    behind = load_tree(ROOT / "examples" / "recovering.yaml", {"to": -1.0})
    assert around.run(behind) is Status.FAILURE
    assert around.pose() == pytest.approx(0.0, abs=0.02)


def test_what_comes_first_is_done_again_while_the_robot_moves(around: Surroundings) -> None:
    runner = VirtualRunner(example("following"), around.network)
    assert runner.run() is Status.SUCCESS
    said = [event for event in runner.events if isinstance(event, Logged)]
    assert len(said) >= 2
    assert around.pose() == pytest.approx(1.0, abs=0.02)
    assert VirtualRunner(runner.tree, around.network).run() is Status.SUCCESS
    assert around.pose() == pytest.approx(2.0, abs=0.02)


def test_namespaces_tell_two_robots_apart(around: Surroundings) -> None:
    assert around.run(example("namespaces")) is Status.SUCCESS
    assert around.pose("cell/left") == pytest.approx(1.0, abs=0.02)
    assert around.pose("cell/right") == pytest.approx(2.0, abs=0.02)


def test_a_robot_goes_on_to_where_the_target_is_now(around: Surroundings) -> None:
    root = example("guided")
    runner = VirtualRunner(root, around.network)
    runner.start()
    runner.advance(1.0)
    around.network.publish("target_distance", Float64(data=1.0))
    assert runner.run() is Status.SUCCESS
    assert around.pose() == pytest.approx(1.0, abs=0.02)
    assert tree_outputs(root) == {"why": ""}


def test_a_robot_goes_no_farther_than_it_may_and_tells_why_it_failed(around: Surroundings) -> None:
    for target, status, why in ((1e9, Status.FAILURE, "REJECTED"), (6.0, Status.SUCCESS, "")):
        root = example("guided")
        runner = VirtualRunner(root, around.network)
        runner.start()
        runner.advance(1.0)
        around.network.publish("target_distance", Float64(data=target))
        assert runner.run() is status
        assert tree_outputs(root) == {"why": why}
    assert 4.0 < around.pose() < 5.0


def test_a_gripper_opens_on_the_way(around: Surroundings) -> None:
    runner = VirtualRunner(example("on_the_way"), around.network)
    assert runner.run() is Status.SUCCESS
    assert around.pose() == pytest.approx(4.0, abs=0.02)
    ended = [name for name, _ in runner.outcomes]
    assert ended == ["Open", "To the part"]


def test_a_class_of_py_trees_is_a_kind(around: Surroundings) -> None:
    root = example("own_kinds")
    assert around.run(root) is Status.SUCCESS
    assert [type(child).__name__ for child in root.children] == ["FailureIsSuccess", "Success"]
