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
from bt_actions.ros.arguments import Given
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
SHORT = """\
tree: t
inputs:
  pause: {type: builtin_interfaces/msg/Duration, default: 1.5 s}
  when: {type: builtin_interfaces/msg/Time, default: now}
  turn: {type: geometry_msgs/msg/Quaternion, default: {yaw: 180 deg}}
  header: {type: std_msgs/msg/Header, default: {stamp: 3, frame_id: map}}
  big: {type: uint64, default: 1}
  names: {type: "string[]", default: [a]}
  points: {type: "geometry_msgs/msg/Point[]", default: [{x: 1.0}]}
root:
  check: $pause.sec + $when.sec + $turn.w + $header.stamp.sec + $big > 0
      and len($names) + len($points) > 0
"""
KEYED = """\
tree: keyed
inputs: {speed: {type: float64, default: 1.0}, names: {type: "string[]", default: [a]}}
outputs: {used: float64, many: int32}
root: {set: {used: $speed, many: "= len($names)"}}
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
    words = ["--params-file", str(path), "-p", "pick_at:=4", "-p", "use_sim_time:=false"]
    assert parameters([], "deliver") is None
    given = parameters(words, "deliver")
    assert given is not None
    assert given.values == {"pick_at": 4, "place_at": 3.0}
    assert given.shared == {"place_at"}


@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize(
    ("section", "words"),
    [
        ("bt_actions_keyed", []),
        ("/bt_actions_keyed", []),
        ("/**/bt_actions_keyed", ["--ros-args", "-r", "__ns:=/r1"]),
        ("/r1/bt_actions_keyed", ["--namespace", "/r1"]),
        ("r1/bt_actions_keyed", ["--ros-args", "-r", "__ns:=/r1"]),
        ("/*", []),
        ("/r1/*", ["--namespace", "/r1"]),
        ("/**", ["--namespace", "/r1", "--name", "deliver"]),
        ("deliver", ["--name", "deliver"]),
        ("launched", ["--name", "deliver", "--ros-args", "-r", "deliver:__node:=launched"]),
        ("launched", ["--ros-args", "-r", "__node:=launched"]),
    ],
)
def test_a_section_of_a_file_for_the_node_of_the_run_is_read(
    section: str, words: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert used_by_keyed(section, words, tmp_path) == 0
    said = capfd.readouterr()
    assert (said.out.count("used: 0.2"), said.err) == (1, ""), said


@pytest.mark.usefixtures("domain")
def test_a_file_that_has_nothing_for_the_node_is_told_with_its_nodes(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = ["--namespace", "/r1", "--ros-args", "-p", "bt_actions_keyed:speed:=0.3"]
    assert used_by_keyed("bt_actions_keyed", words, tmp_path) == 0
    said = capfd.readouterr()
    assert "used: 1.0" in said.out
    first, second = said.err.splitlines()
    node = "has nothing for this node, /r1/bt_actions_keyed"
    assert first.endswith(f"{node}; without the name it does: -p speed:=0.3")
    assert second.endswith(f"{node}; it is for /bt_actions_keyed")


def used_by_keyed(section: str, words: list[str], folder: Path) -> int:
    """Run a tree with a file of parameters that has one section."""
    tree, file = folder / "keyed.yaml", folder / "parameters.yaml"
    tree.write_text(KEYED)
    file.write_text(f"{section}:\n  ros__parameters: {{speed: 0.2}}\n")
    more = [] if "--ros-args" in words else ["--ros-args"]
    return main(["run", str(tree), *words, *more, "--params-file", str(file)])


@pytest.mark.usefixtures("domain")
def test_what_a_file_gives_to_other_nodes_too_may_be_no_input_and_is_told(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    tree, file = tmp_path / "keyed.yaml", tmp_path / "parameters.yaml"
    tree.write_text(KEYED)
    shared = "/**:\n  ros__parameters: {speed: 0.2, waypoints: [], names: [], seed: 3, "
    shared += "names.of: {others: 1}}\n"
    run = ["run", str(tree), "--ros-args", "--params-file", str(file)]
    file.write_text(shared)
    assert main(run) == 0
    said = capfd.readouterr()
    assert "used: 0.2\nmany: 0" in said.out
    (line,) = said.err.splitlines()
    assert "no input of the tree 'keyed', and not used: waypoints, seed (did you mean" in line
    assert "names.of.others" in line
    file.write_text(f"{shared}bt_actions_keyed:\n  ros__parameters: {{seed: 4}}\n")
    is_refused(run, "the parameter 'seed' is no input of the tree 'keyed'", capfd)


@pytest.mark.ros
def test_a_field_of_an_input_is_set_whatever_way_the_default_is_written(tmp_path: Path) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(SHORT)
    given = {
        "pause.sec": 5, "when.nanosec": 7, "turn.w": 0.5, "header.stamp.nanosec": 9,
        "big": str(2**64 - 1), "names": [], "points": "[]",
    }  # fmt: skip
    inputs = as_inputs(Given(values=given), tree_inputs(path), "t")
    assert (inputs["pause"].sec, inputs["pause"].nanosec) == (5, 500_000_000)
    assert inputs["when"].sec > 0
    assert inputs["when"].nanosec == 7
    assert (inputs["turn"].z, inputs["turn"].w) == (1.0, 0.5)
    header = inputs["header"]
    assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (3, 9, "map")
    assert inputs["big"] == 2**64 - 1
    assert (list(inputs["names"]), list(inputs["points"])) == ([], [])
    inputs = as_inputs(Given(values={"pause": "2 s", "turn.yaw": 0.0}), tree_inputs(path), "t")
    assert (inputs["pause"].sec, inputs["turn"].w) == (2, 1.0)


@pytest.mark.ros
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("pause.nosuch", 5, "'pause.nosuch' is 5, and the input 'pause' is "),
        ("pause.nosuch", 5, ": Duration has no field 'nosuch'; did you mean 'nanosec'?"),
        ("when.secs", 5, "Time has no field 'secs'; did you mean 'sec'?"),
        ("turn.v", 0.5, "Quaternion has no field 'v'; it has x, y, z, w"),
        ("header.stmp.sec", 5, "'header.stmp.sec' is 5, and the input 'header' is std_msgs/"),
        ("header.stmp.sec", 5, ": Header has no field 'stmp'; did you mean 'stamp'?"),
        ("pause.sec.x", 5, ": a whole number (int32) is needed, not a mapping"),
        ("big.x", 5, "the parameter 'big.x' is no input of the tree 't'"),
        ("names", [1, True], "quotes make it one: -p \"names:=['1', 'true']\""),
        ("header.frame_id", True, "quotes make it one: -p \"header.frame_id:='on'\""),
        ("header.frame_id", ["a"], "quotes make it one: -p \"header.frame_id:='on'\""),
    ],
)
def test_a_field_that_is_not_there_or_does_not_fit_is_told_by_its_name(
    name: str, value: object, message: str, tmp_path: Path
) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(SHORT)
    with pytest.raises(BadInput) as raised:
        as_inputs(Given(values={name: value}, written={name: "on"}), tree_inputs(path), "t")
    assert message in str(raised.value)


@pytest.mark.ros
def test_a_text_that_a_file_gives_is_put_in_quotes_there(tmp_path: Path) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(SHORT)
    with pytest.raises(BadInput, match=r"a text is needed, not true; put it in quotes in the file"):
        as_inputs(Given(values={"header.frame_id": True}), tree_inputs(path), "t")


def test_parameters_become_what_the_inputs_are(tree: Path) -> None:
    given = {"far": 2, "many": 3, "names": ["a"], "on": True, "at": "{x: 1.5}"}
    inputs: dict[str, Any] = as_inputs(Given(values=given), tree_inputs(tree), "t")
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
    inputs: dict[str, Any] = as_inputs(Given(values=given), tree_inputs(path), "t")
    assert (inputs["at"].position.x, inputs["at"].position.y) == (1.0, 2.0)
    assert inputs["at"].orientation.w == 0.5
    assert [point.x for point in inputs["area"].points] == [1.5]
    with pytest.raises(BadInput, match=r"the parameter 'on\.y' is no input of the tree 't'"):
        as_inputs(Given(values={"on.y": 2}), tree_inputs(path), "t")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("far", "2.0", "the parameter 'far' is '2.0', and the input is float64: a number"),
        ("many", 1.5, "the parameter 'many' is 1.5, and the input is int32: "),
        ("on", 1, "the parameter 'on' is 1, and the input is bool: "),
        ("at", "{z: far}", "the parameter 'at' is '{z: far}', and the input is geometry_msgs/"),
        ("fra", 1.0, "the parameter 'fra' is no input of the tree 't'; did you mean 'far'?"),
    ],
)
def test_a_parameter_that_does_not_fit_is_told_by_its_name(
    tree: Path, name: str, value: object, message: str
) -> None:
    with pytest.raises(BadInput, match=r"^--ros-args: ") as raised:
        as_inputs(Given(values={name: value}), tree_inputs(tree), "t")
    assert message in str(raised.value)


@pytest.mark.ros
def test_an_option_of_ours_that_stands_behind_is_told_where_it_belongs() -> None:
    with pytest.raises(BadInput) as raised:
        parameters(["-p", "a:=1", "--check-part", "5.0"], "deliver")
    assert str(raised.value) == (
        "--ros-args: ROS does not know --check-part 5.0; "
        "options of bt-actions stand before --ros-args"
    )


def test_a_command_says_how_a_missing_input_is_given_on_its_line(tree: Path) -> None:
    with pytest.raises(BadInput) as raised:
        load(str(tree), [])
    assert str(raised.value).endswith("(float64): give it a value, such as --set far=...")


def test_what_is_set_wins_over_parameters_and_they_over_defaults() -> None:
    given = {"pick_at": 4.0, "place_at": 6.0}
    root: Any = load("pick_and_place", ["place_at=7.0"], parameters=lambda _: Given(values=given))
    read = root._bt_actions_loaded.scope.read
    assert (read("pick_at"), read("place_at")) == (4.0, 7.0)
    root = load("pick_and_place", [], parameters=lambda _: Given(values={"place_at": 6.0}))
    assert root._bt_actions_loaded.scope.read("pick_at") == 2.0


@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-p", "pick_at:=far"], "the parameter 'pick_at' is 'far', and the input is float64"),
        (["-p", "speed:=1.0"], "there is pick_at, place_at"),
        (
            ["-p", "pick_at"],
            "'-p pick_at' is not understood: a parameter is written -p NAME:=VALUE",
        ),
        (["-p", "pick_at:="], "an empty text is written -p \"pick_at:=''\""),
        (["-p", "pick_at:=[1, a]"], "its value is read as YAML, and Sequence should be of same"),
        (
            ["-r", "__ns:=x"],
            "a namespace has letters, digits and _, each part after a slash, as in",
        ),
        (["-r", "__ns:=/x/"], "each part after a slash, as in __ns:=/r1"),
        (["pick_at:=2.0"], "ROS does not know pick_at:=2.0; a parameter is written -p NAME:=VALUE"),
        (["-r", "__node:=a/b"], "a node's name has letters, digits and _ alone"),
        (["-r", "move_robot"], "a rule is written -r FROM:=TO"),
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
    message = "'-r a:b' is not understood: a rule is written -r FROM:=TO"
    is_refused([*command.split(), "--ros-args", "-r", "a:b"], message, capfd)


@pytest.mark.usefixtures("domain")
def test_a_command_without_parameters_refuses_one_that_is_meant_for_it(
    capfd: pytest.CaptureFixture[str],
) -> None:
    for command in ("sim", "send move_robot MoveRobot distance=1", "cleanup", "list"):
        name = command.partition(" ")[0]
        message = f"the parameter 'speed' is no parameter of bt-actions {name}"
        is_refused([*command.split(), "--ros-args", "-p", "speed:=3"], message, capfd)


def is_refused(arguments: list[str], message: str, capfd: pytest.CaptureFixture[str]) -> None:
    try:
        code = main(arguments)
    except SystemExit as error:
        code = int(error.code or 0)
    said = capfd.readouterr()
    assert (code, said.out) == (2, "")
    (line,) = said.err.splitlines()
    assert message in line
    assert "lexeme" not in line


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
