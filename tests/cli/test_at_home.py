"""A run as ROS sees it from another process: its node, what it says on /rosout, its parameters."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from bt_actions import TreeError, TreeRunner, load_tree
from bt_actions.cli import main
from bt_actions.cli.arguments.ros_arguments import as_inputs, parameters
from bt_actions.document import tree_inputs
from bt_actions.running.shown import ShownRun
from tests.cli.conftest import Start
from tests.support.parameter_dump import dumped
from tests.support.processes import Host
from tests.support.trees import Raises
from tests.support.waiting import until

INPUTS = """\
tree: inputs
inputs:
  distance: {type: float64, default: 1.0, unit: m, description: How far}
  times: {type: uint8, default: 3}
  most: {type: uint64, default: 18446744073709551615}
  names: {type: "string[]", default: []}
  at: {type: geometry_msgs/msg/Point, default: {x: 1.5}}
  area: {type: geometry_msgs/msg/Polygon, default: {points: [{x: 2.0}]}}
  use_sim_time: {type: bool, default: true}
root:
  sequence: Work
  children:
    - wait: 60 s
    - check: $distance > 0.0 and $times > 0 and $most > 0 and len($names) == 0
    - check: $at.x > 0.0 and len($area.points) == 1 and $use_sim_time
"""


class Watcher:
    """Another process's node: it hears /rosout, and sees the graph."""

    def __init__(self, context: Any) -> None:
        from rcl_interfaces.msg import Log
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self.node = Node("watcher", context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.heard: list[Any] = []
        latched = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(Log, "/rosout", self.heard.append, latched)

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        def spin() -> None:
            self.executor.spin_once(timeout_sec=0.02)

        return until(condition, 20.0, what=what, meanwhile=spin)

    def hears(self, name: str, text: str) -> list[tuple[int, str]]:
        """Wait for a line of the node; return all of that node so far."""
        return list(
            self.until(
                lambda: [
                    (each.level, each.msg) for each in self.heard if each.name == name
                ] if any(each.name == name and text in each.msg for each in self.heard) else [],
                f"{name} says {text!r}",
            )
        )  # fmt: skip


@pytest.fixture(scope="module")
def young_context(domain: int) -> Iterator[Any]:
    from rclpy.context import Context

    context = Context()
    context.init(domain_id=domain)
    yield context
    context.shutdown()


@pytest.fixture
def watcher(young_context: Any) -> Iterator[Watcher]:
    watcher = Watcher(young_context)
    yield watcher
    watcher.executor.shutdown()
    watcher.node.destroy_node()


def test_node_wins_over_name_which_wins_over_the_tree_s(
    start: Start, watcher: Watcher, tree: Callable[..., Path], namespace: str
) -> None:
    run = ("run", str(tree(server=f"{namespace}/nobody")), "--namespace")
    start(*run, f"{namespace}/a")
    start(*run, f"{namespace}/b", "--name", "deliver")
    start(*run, f"{namespace}/c", "--name", "deliver", "--ros-args", "-r", "__node:=launched")
    wanted = {f"{namespace}/a": "bt_actions_one_move", f"{namespace}/b": "deliver",
              f"{namespace}/c": "launched"}  # fmt: skip

    def seen() -> dict[str, str]:
        nodes = watcher.node.get_node_names_and_namespaces()
        return {space: name for name, space in nodes if name in wanted.values()}

    watcher.until(lambda: seen() == wanted, "each is called as it should be")


def test_a_failure_is_told_on_rosout_with_its_reason_and_is_printed_once(
    start: Start, watcher: Watcher, host: Host, tree: Callable[..., Path], namespace: str
) -> None:
    server = f"{namespace}/move_robot"
    path = tree(server=server, timeout="{server: 20 s, result: 20 s}")
    run = start("run", str(path), "--namespace", namespace)
    logger = f"{namespace[1:]}.bt_actions_one_move"
    (begins,) = watcher.hears(logger, "begins")
    host.open(server, "1:abort")
    try:
        assert run.wait() == 1, run
    finally:
        host.close_server(server)
    _, reason, ends = watcher.hears(logger, "ends")
    assert begins == (20, f"one_move begins ({path})")
    assert reason[0] == 40
    assert reason[1].startswith("one_move: ")
    assert "ABORTED: aborted by" in reason[1].splitlines()[0], "for who shows one line"
    assert f"\n    {path}:" in reason[1]
    assert ends[0] == 40
    assert ends[1].startswith("one_move ends: FAILURE after ")
    assert not any("begins" in line or "ends:" in line for line in [*run.lines, *run.errors])


@pytest.mark.parametrize("options", [[], ["--publish-values"]], ids=["no values", "values"])
def test_events_and_states_are_topics_of_the_node_to_the_end_of_the_tree(
    start: Start,
    watcher: Watcher,
    host: Host,
    tree: Callable[..., Path],
    namespace: str,
    options: list[str],
) -> None:
    from tests.support.listener import Listener

    server = f"{namespace}/move_robot"
    listener = Listener(watcher.node, f"{namespace}/bt_actions_one_move")
    path = tree(server=server, timeout="{server: 20 s, result: 20 s}")
    run = start("run", str(path), "--namespace", namespace, *options)
    watcher.until(lambda: listener.runs, "a state")
    host.open(server, "1:abort")
    try:
        assert run.wait() == 1, run
    finally:
        host.close_server(server)
    (run_id,) = listener.runs
    watcher.until(lambda: listener.runs[run_id].finished, "the tree's end")
    (failure,) = listener.runs[run_id].failures
    (goal,) = failure.attempts
    assert (goal.goal is not None) is bool(options)


def test_the_topics_are_closed_with_the_run(no_leaks: None, tmp_path: Path) -> None:
    path = tmp_path / "quick.yaml"
    path.write_text("tree: quick\nroot: {success: }\n")
    assert main(["run", str(path), "--no-record"]) == 0
    assert "bt_actions-topics" not in [each.name for each in threading.enumerate()]


def test_a_program_of_the_users_shows_its_runs_so_too(watcher: Watcher, tmp_path: Path) -> None:
    path = tmp_path / "quick.yaml"
    path.write_text("tree: quick\ninputs: {speed: {type: float64, default: 0.2}}\n"
                    "root: {check: $speed < 1.0}\n")  # fmt: skip
    root = load_tree(path)
    with TreeRunner(root, name="of_a_program") as runner:
        ShownRun(runner, root)
        assert runner.node.get_parameter("speed").value == 0.2
        runner.run()
        (begins,) = watcher.hears("of_a_program", "begins")
        threading.Thread(target=runner.shutdown).start()
        ends = watcher.hears("of_a_program", "ends")[-1]
    assert begins == (20, f"quick begins ({path}) with speed=0.2")
    assert ends[1].startswith("quick ends: SUCCESS after ")


def test_what_a_behaviour_raised_in_a_program_is_told_on_rosout(watcher: Watcher) -> None:
    root = Raises("bad", "update")
    with TreeRunner(root, name="of_a_bad_program") as runner:
        ShownRun(runner, root)
        with pytest.raises(TreeError):
            runner.run()
        watcher.hears("of_a_bad_program", "begins")
        threading.Thread(target=runner.shutdown).start()
        _, (level, reason), (_, ends) = watcher.hears("of_a_bad_program", "ends")
    assert level == 40
    assert "  bad: tick raised RuntimeError: on purpose in update (" in reason
    assert ends.startswith("bad ends: FAILURE after ")


def test_a_run_that_is_ended_by_a_signal_says_so_last_of_all(
    start: Start, watcher: Watcher, namespace: str, tree: Callable[..., Path]
) -> None:
    path = tree(server=f"{namespace}/nobody", timeout="{server: 60 s, result: 5 s}")
    run = start("run", str(path), "--namespace", namespace, "--name", "stopped")
    watcher.hears(f"{namespace[1:]}.stopped", "begins")
    run.send(signal.SIGTERM)
    level, said = watcher.hears(f"{namespace[1:]}.stopped", "ends")[-1]
    assert (level, said.rpartition(" after ")[0]) == (20, "one_move ends: STOPPED")
    assert run.wait() == 143, run


def given_back(dump: str, tree: Path) -> dict[str, Any]:
    """Return the inputs that a run of a tree takes from the dump of another."""
    file = tree.with_name("dump.yaml")
    file.write_text(dump)
    node = dump.partition(":")[0]
    namespace, _, name = node.rpartition("/")
    given = parameters(["--params-file", str(file)], name, namespace)
    inputs = as_inputs(given, tree_inputs(tree), "inputs")
    inputs["at"] = [inputs["at"].x, inputs["at"].y, inputs["at"].z]
    inputs["area"] = [point.x for point in inputs["area"].points]
    return inputs


def test_inputs_are_parameters_that_nobody_can_change(
    start: Start, watcher: Watcher, namespace: str, tmp_path: Path
) -> None:
    from rclpy.parameter import Parameter, parameter_value_to_python
    from rclpy.parameter_client import AsyncParameterClient

    path = tmp_path / "inputs.yaml"
    path.write_text(INPUTS)
    run = start(
        *("run", str(path), "--namespace", namespace, "--set", "times=4"),
        *("--ros-args", "-p", "distance:=2", "-p", "at.y:=3"),
    )
    node = AsyncParameterClient(watcher.node, f"{namespace}/bt_actions_inputs")

    def answer(future: Any) -> Any:
        watcher.until(future.done, "the run answers")
        return future.result()

    watcher.until(node.services_are_ready, "the run's parameters are there")
    listed = answer(node.list_parameters([], 0)).result.names
    values = answer(node.get_parameters(listed)).values
    shown = dict(zip(listed, map(parameter_value_to_python, values), strict=True))
    assert shown == {
        "use_sim_time": False,  # ROS's own
        "start_type_description_service": True,
        "distance": 2.0,
        "times": 4,
        "most": "18446744073709551615",
        "names": [],
        "at.x": 1.5,
        "at.y": 3.0,
        "at.z": 0.0,
        "area.points": '[{"x": 2.0, "y": 0.0, "z": 0.0}]',
    }
    assert isinstance(shown["distance"], float)
    assert any("the input 'use_sim_time' is shown as no parameter" in line for line in run.errors)
    far, times = answer(node.describe_parameters(["distance", "times"])).descriptors
    assert (far.description, far.read_only, far.type) == ("How far (m)", True, 3)
    assert [(each.from_value, each.to_value) for each in times.integer_range] == [(0, 255)]
    (names,) = answer(node.describe_parameters(["names"])).descriptors
    assert (names.type, values[listed.index("names")].type) == (9, 9), "an array of texts"
    assert given_back(dumped(f"{namespace}/bt_actions_inputs", listed, values), path) == {
        "distance": 2.0, "times": 4, "most": 2**64 - 1, "names": [], "at": [1.5, 3.0, 0.0],
        "area": [2.0],
    }  # fmt: skip
    (refused,) = answer(node.set_parameters([Parameter("distance", value=9.0)])).results
    assert not refused.successful
    assert refused.reason == "Trying to set a read-only parameter: distance."
    assert answer(node.get_parameters(["distance"])).values[0].double_value == 2.0
    run.send(signal.SIGTERM)
    assert run.wait() == 143, run
