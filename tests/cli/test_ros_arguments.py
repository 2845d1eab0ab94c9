"""`bt-actions ... --ros-args`: rcl gets its words, and ROS parameters are inputs of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bt_actions import load_tree
from bt_actions.cli import main
from bt_actions.cli.arguments.loading import load
from bt_actions.cli.arguments.ros_arguments import as_inputs, parameters
from bt_actions.cli.exits import BadInput
from bt_actions.document import tree_inputs
from tests.cli.conftest import Start

INPUTS = """\
tree: t
inputs:
  far: float64
  many: int32
  names: string[]
  on: bool
  at: geometry_msgs/msg/Point
root: {check: $far > 0.0 and $many > 0 and len($names) > 0 and $on and $at.x > 0.0}
"""
FIELDS = """\
tree: t
inputs:
  at: {type: geometry_msgs/msg/Pose, default: {position: {x: 1.0}, orientation: {w: 0.5}}}
  area: geometry_msgs/msg/Polygon
root: {check: $at.position.x > 0.0 and len($area.points) > 0}
"""
FILE = """\
/**:
  ros__parameters:
    pick_at: 2.0
    place_at: 3.0
/of/somebody/else:
  ros__parameters:
    place_at: 9.0
"""
DEMO = ("run", "pick_and_place", "--sim", "--speed", "20")


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    path = tmp_path / "t.yaml"
    path.write_text(INPUTS)
    return path


@pytest.mark.usefixtures("domain")
def test_parameters_are_what_rcl_reads_for_a_node_of_the_run(tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(FILE)
    words = ["--params-file", str(path), "-p", "pick_at:=4", "-p", "bt:other:=1"]
    assert parameters([]) == {}
    assert parameters([*words, "-p", "use_sim_time:=false"]) == {"pick_at": 4, "place_at": 3.0}


def test_parameters_become_what_the_inputs_are(tree: Path) -> None:
    given = {"far": 2, "many": 3, "names": ["a"], "on": True, "at": "{x: 1.5}"}
    inputs: dict[str, Any] = as_inputs(given, tree_inputs(tree), "t")
    assert (inputs["far"], inputs["many"], inputs["names"]) == (2.0, 3, ["a"])
    assert isinstance(inputs["far"], float)
    assert (inputs["on"], inputs["at"].x) == (True, 1.5)
    assert load_tree(tree, inputs).name


def test_a_field_of_an_input_is_a_parameter_and_the_others_are_those_of_the_default(
    tmp_path: Path,
) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(FIELDS)
    given = {"at.position.y": 2, "area.points": "[{x: 1.5}]"}
    inputs: dict[str, Any] = as_inputs(given, tree_inputs(path), "t")
    assert (inputs["at"].position.x, inputs["at"].position.y) == (1.0, 2.0)
    assert inputs["at"].orientation.w == 0.5
    assert [point.x for point in inputs["area"].points] == [1.5]
    with pytest.raises(BadInput, match=r"the parameter 'on\.y' is no input of the tree 't'"):
        as_inputs({"on.y": 2}, tree_inputs(path), "t")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("far", "2.0", "the parameter 'far' is '2.0', and the input is float64: a number"),
        ("many", 1.5, "the parameter 'many' is 1.5, and the input is int32: "),
        ("on", 1, "the parameter 'on' is 1, and the input is bool: "),
        ("at", "{z: far}", "the parameter 'at' is '{z: far}', and the input is geometry_msgs/"),
        ("fra", 1.0, "'fra' is no input of the tree 't'; its inputs are far, many, names, on, at"),
    ],
)
def test_a_parameter_that_does_not_fit_is_told_by_its_name(
    tree: Path, name: str, value: object, message: str
) -> None:
    with pytest.raises(BadInput, match=r"^--ros-args: ") as raised:
        as_inputs({name: value}, tree_inputs(tree), "t")
    assert message in str(raised.value)


@pytest.mark.ros
def test_an_option_of_ours_that_stands_behind_is_told_where_it_belongs() -> None:
    with pytest.raises(BadInput) as raised:
        parameters(["-p", "a:=1", "--check-part", "5.0"])
    assert str(raised.value) == (
        "--ros-args: ROS does not know --check-part 5.0; "
        "options of bt-actions stand before --ros-args"
    )


def test_what_is_set_wins_over_parameters_and_they_over_defaults() -> None:
    given = {"pick_at": 4.0, "place_at": 6.0}
    root: Any = load("pick_and_place", ["place_at=7.0"], parameters=given)
    read = root._bt_actions_loaded.scope.read
    assert (read("pick_at"), read("place_at")) == (4.0, 7.0)
    root = load("pick_and_place", [], parameters={"place_at": 6.0})
    assert root._bt_actions_loaded.scope.read("pick_at") == 2.0


@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-p", "pick_at:=far"], "the parameter 'pick_at' is 'far', and the input is float64"),
        (["-p", "pick:=1.0"], "its inputs are pick_at, place_at"),
        (["-p", "pick_at"], "Couldn't parse parameter override rule: '-p pick_at'"),
        (["--params-file", "no_such.yaml"], "no_such.yaml"),
        (["--nonsense"], "--nonsense"),
        (["-p", "use_sim_time:=3"], "use_sim_time is true or false, not 3"),
        (["-p", "pick_at:=2.0", "--", "--json"], "--"),
    ],
)
def test_what_is_wrong_after_ros_args_is_told_with_exit_code_2(
    words: list[str], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    is_refused(["run", "pick_and_place", "--ros-args", *words], message, capfd)


@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize(
    "command", ["sim", "send move_robot MoveRobot distance=1", "cleanup move_robot"]
)
def test_so_it_is_of_the_other_commands_that_use_ros(
    command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    message = "Couldn't parse remap rule: '-r a:b'"
    is_refused([*command.split(), "--ros-args", "-r", "a:b"], message, capfd)


def is_refused(arguments: list[str], message: str, capfd: pytest.CaptureFixture[str]) -> None:
    try:
        code = main(arguments)
    except SystemExit as error:
        code = int(error.code or 0)
    said = capfd.readouterr()
    assert (code, said.out) == (2, "")
    assert message in said.err.splitlines()[-1]
    assert "Traceback" not in said.err


def test_launch_starts_a_server_a_goal_and_a_cleanup_with_names_and_parameters(
    start: Start, tmp_path: Path
) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(FILE)
    launch = ("--ros-args", "-r", "__node:=launched", "-r", "__ns:=/by_launch")
    launch += ("--params-file", str(path), "-p", "use_sim_time:=false")
    sim = start("sim", *launch)
    assert sim.line("ready: ").startswith("ready: /by_launch/move_robot, ")
    goal = start("send", "move_robot", "MoveRobot", "distance=0.1", *launch)
    assert goal.wait() == 0, goal
    cleanup = start("cleanup", "move_robot", "--look", "1", *launch)
    assert cleanup.wait() == 0, cleanup
    serve = start("serve", "--trees", "trees", *launch)
    assert serve.line("ready: ").startswith("ready: /by_launch/run_tree, ")


def test_a_run_takes_its_inputs_from_a_file_of_parameters(start: Start, tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(FILE)
    run = start(*DEMO, "--check-part", "3", "--ros-args", "--params-file", str(path))
    assert run.wait() == 0, run


def test_a_run_goes_by_the_name_and_namespace_that_a_launch_file_gives(start: Start) -> None:
    names = ("-r", "__node:=deliver", "-r", "__ns:=/r1", "--ros-args")
    run = start(
        *DEMO, "--check-part", "5", "--ros-args", "--log-level", "warn", "--ros-args", *names
    )
    assert run.wait() == 0, run
    assert any("executing on /r1/move_robot" in line for line in run.lines)
