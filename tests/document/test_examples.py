"""Each example of docs/yaml.md runs against servers and topics, and ends as it should."""

from __future__ import annotations

import re
import runpy
import textwrap
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions import TreeRunner
from bt_actions.document import check_file, load_tree, tree_outputs
from bt_actions.document.formatting.format import format_source
from bt_actions.document.language.kinds import KINDS
from bt_actions.document.yaml.source import read_source
from tests.support.waiting import until

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

    def __init__(self, context: Any) -> None:
        from bt_actions_interfaces.action import RunTree
        from geometry_msgs.msg import Polygon, PoseStamped
        from rclpy.node import Node
        from sensor_msgs.msg import BatteryState
        from std_msgs.msg import Bool
        from std_srvs.srv import SetBool
        from trajectory_msgs.msg import JointTrajectory

        from bt_actions.ros.topics import qos_profile
        from bt_actions.simulation import Script, ScriptedServer, Simulation

        self.node = Node("examples", context=context, namespace=f"/examples{id(self)}")
        robots = ("", "cell/left", "cell/right")
        self.robots = Simulation(self.node, namespaces=robots, speed=30.0)
        answer = RunTree.Result(settled=True, outputs='{"at": 2.0}')
        self.trees = ScriptedServer(
            self.node, RunTree, "/r1/run_tree", Script(result=lambda _: answer)
        )
        self.heard: dict[str, list[Any]] = defaultdict(list)
        self.node.create_service(SetBool, "light", self._switch)
        for name, kind, qos in (
            ("lamp", Bool, "default"),
            ("target", PoseStamped, "latched"),
            ("route", JointTrajectory, "latched"),
            ("supply", BatteryState, "latched"),
            ("area", Polygon, "latched"),
        ):
            hear = self.heard[name].append
            self.node.create_subscription(kind, name, hear, qos_profile(qos))
        door = self.node.create_publisher(Bool, "door", 10)
        self.node.create_timer(0.1, lambda: door.publish(Bool(data=True)))

    def _switch(self, request: Any, response: Any) -> Any:
        self.heard["light"].append(request.data)
        response.success = True
        return response

    def pose(self, robot: str = "") -> float:
        return self.robots.world(robot).robot.current_pose

    def run(self, root: Behaviour, *, hears: Sequence[str] = (), timeout: float = 30.0) -> Status:
        """Run a tree whose publishers have found their subscribers, until they all were heard."""
        for heard in self.heard.values():
            heard.clear()
        for behaviour in root.iterate():
            behaviour.setup(node=self.node)
        for publisher in self.node.publishers:
            if publisher.topic_name.removeprefix(f"{self.node.get_namespace()}/") in self.heard:
                until(publisher.get_subscription_count, what=f"{publisher.topic_name} is heard")
        with TreeRunner(root, node=self.node) as runner:
            status = runner.run(timeout=timeout)
            until(lambda: all(self.heard[name] for name in hears), what=f"{hears} are heard")
        return status

    def close(self) -> None:
        self.trees.close()
        self.robots.close()
        self.node.destroy_node()


@pytest.fixture(scope="module")
def shared(context: Any) -> Iterator[Surroundings]:
    surroundings = Surroundings(context)
    yield surroundings
    surroundings.close()


@pytest.fixture
def around(shared: Surroundings, no_leaks: None) -> Surroundings:
    return shared


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
    around.run(node(KINDS["publish"].example), hears=["lamp"])
    assert [message.data for message in around.heard["lamp"]] == [True]


# Files


def test_the_first_example_fetches(around: Surroundings) -> None:
    root = example("fetch")
    assert around.run(root) is Status.SUCCESS
    assert tree_outputs(root) == {"final_pose": pytest.approx(2.0, abs=0.02)}


def test_messages_arrive_with_what_their_conveniences_stand_for(around: Surroundings) -> None:
    before = around.node.get_clock().now().nanoseconds
    names = ("target", "route", "supply", "area")
    assert around.run(example("messages"), hears=names) is Status.SUCCESS
    target, route, supply, area = (around.heard[name][-1] for name in names)
    assert target.header.stamp.sec >= before // 10**9
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


def test_namespaces_tell_two_robots_apart(around: Surroundings) -> None:
    assert around.run(example("namespaces")) is Status.SUCCESS
    assert around.pose("cell/left") == pytest.approx(1.0, abs=0.02)
    assert around.pose("cell/right") == pytest.approx(2.0, abs=0.02)
