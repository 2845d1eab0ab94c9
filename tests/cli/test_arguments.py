"""What the command line takes, and how it says no. No process, no ROS."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from bt_actions import cli
from bt_actions.cli.arguments.values import goal_fields, nested, value
from bt_actions.cli.exits import BadInput
from bt_actions.cli.program import COMMANDS
from bt_actions.utilities.shorten import MESSAGE

CHECKOUT = Path(__file__).parents[2]


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Call `bt-actions`; return the one line of its refusal."""
    try:
        code = cli.main(arguments)
    except SystemExit as error:
        code = int(error.code or 0)
    said = capsys.readouterr()
    assert code == 2
    assert said.out == ""
    assert said.err.count("\n") == 1, said.err
    return said.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rum"], "no command 'rum'; did you mean 'run'?"),
        (["xyzzy"], "no command 'xyzzy'; there are run, send"),
        (["run", "t", "--tiemout", "3"], "no option --tiemout; did you mean '--timeout'?"),
        (["run", "t", "--time=3"], "no option --time; did you mean '--timeout'?"),
        (["run", "t", "u"], "unexpected argument 'u'\n"),
        (["run", "t", "x=2"], "unexpected argument 'x=2'; write --set x=2"),
        (["run", "t", "--set", "x", "2"], "unexpected argument '2'; write --set x=2"),
        (["run", "t", "--set", "x", "-2.5"], "unexpected argument '-2.5'; write --set x=-2.5"),
        (["call", "t", "--set", "x", "=", "2"], "unexpected argument '='; write --set x=2"),
        (["call", "t", "--set", "x", "="], "unexpected argument '='; write --set x=VALUE"),
        (["run", "t", "x:=2"], "unexpected argument 'x:=2'; write --set x=2\n"),
        (["run", "t", "x", "2"], "unexpected argument 'x'; write --set x=2\n"),
        (["run", "t", "x", ":=", "-2"], "unexpected argument 'x'; write --set x=-2\n"),
        (["run", "t", "--set", "x:", "2"], "unexpected argument '2'; write --set x=2\n"),
        (["run", "t", "--set", "x: 2"], "--set 'x: 2': write --set x=2\n"),
        (["run", "t", "u.yaml", "v.yaml"], "unexpected argument 'u.yaml'\n"),
        (["run", "t", "--set", "x:=2"], "--set 'x:=2': write --set x=2\n"),
        (["run", "t", "-p", "x:=2"], "write --ros-args -p x:=2, or --set x=2\n"),
        (["run", "t", "-r", "__ns:=/r1"], "write --ros-args -r __ns:=/r1\n"),
        (["run", "t", "--params-file", "f"], "write --ros-args --params-file f\n"),
        (["serve", "-p", "max:=2"], "write --ros-args -p max:=2\n"),
        (["send", "a", "MoveRobot", "distance:=2"], "'distance:=2': write distance=2\n"),
        (["sim", "x=2"], "unexpected argument 'x=2'\n"),
        (["run"], "the following arguments are required: TREE"),
        (["run", "t", "--timeout", "0"], "'0' is no positive number of seconds"),
        (["run", "t", "--timeout", "inf"], "'inf' is no positive number of seconds"),
        (["run", "t", "--executor", "both"], "invalid choice: 'both'"),
        (["run", "t", "--namespace", "r-1"], "'r-1' is no ROS namespace"),
        (["run", "t", "--namespace", "a" * 101], "a namespace has at most 100 characters"),
        (["run", "t", "--set", "x"], "--set 'x': expected name=value"),
        (["run", "pick_and_place", "--set", "pick_at=[1"], "--set pick_at=[1"),
        (["run", "pick_and_place", "--set", "pick_at=far"], "--set pick_at=far"),
        (["run", "pick_and_place", "--set", "pick=1"], "has no input 'pick'"),
        (
            ["run", "pick_and_place", "--set", f"pick_at=[{'$,' * 1200}]"],
            "this dollar sign refers to nothing",
        ),
        (["run", "no_such_tree"], "there is no tree 'no_such_tree'"),
        (["run", "t", "--speed", "2"], "--speed is about the simulation; it needs --sim"),
        (["run", "t", "--sim", "--speed", "1e308"], "'1e308' is no factor from 1e-05 to 100000"),
        (["sim", "--speed", "1e-300"], "'1e-300' is no factor from 1e-05 to 100000"),
        (["run", "t", "--fault", "a:1:abort"], "--fault is about the simulation"),
        (["run", "t", "--check-part", "5"], "--check-part is about the simulation"),
        (["run", "t", "--sim-like", "r", "--check-part", "5"], "--check-part is about the simul"),
        (["run", "t", "--sim-like", "r", "--sim"], "not allowed with argument --sim-like"),
        (["run", "t", "--sim", "--fault", "nonsense"], "--fault"),
        (["render", "t", "-o", "t.pdf"], "t.pdf: cannot tell the format"),
        (["send", "a" * 121, "MoveRobot"], "it has more than 120 characters"),
        (["send", "a", "NoSuchAction"], "no installed package has the action 'NoSuchAction'"),
        (["send", "a", "MoveRobot", "distnce=1"], "no field 'distnce'; did you mean 'distance'?"),
        (["send", "a", "MoveRobot", "distance=far"], "distance"),
        (["send", "a", "MoveRobot", "distance=1e400"], "1e400 does not fit a float64"),
        (["send", "a", "MoveRobot", "distance=[-1e400]"], "-1e400 does not fit a float64"),
        (["call", "a", "--set", "distance"], "--set 'distance': expected name=value"),
        (["send", "a", "MoveRobot", "distance"], "field 'distance': expected name=value"),
        (["check", "--format", "xml", "a"], "invalid choice: 'xml'"),
        (
            ["send", "move robot", "MoveRobot"],
            "SERVER: 'move robot' cannot be the name of an action",
        ),
        (["cleanup", "/a", "g h"], "ACTION: 'g h' cannot be the name of an action server: a space"),
        (["control", "/run tree", "pause"], "SERVER: '/run tree' cannot be the name of an action"),
        (["call", "t", "--server", "1st"], "--server: '1st' cannot be the name of an action"),
        (["--nonsense"], "--nonsense"),
    ],
)
def test_a_wrong_argument_is_refused_on_one_line_that_says_what_is_meant(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in refused(capsys, *arguments)


LONG = "x" * 3000


@pytest.mark.parametrize(
    "arguments",
    [
        [LONG],
        *([command, f"--{LONG}"] for command in COMMANDS),
        *(
            ["run", "pick_and_place", *words]
            for words in (
                ["--set", f"{LONG}=1"],
                ["--set", f"pick_at={LONG}"],
                ["--timeout", LONG],
                ["--executor", LONG],
                ["--sim", "--fault", LONG],
                ["--sim", "--fault", f"move_robot:{LONG}:abort"],
                ["--sim", "--fault", f"move_robot:1:{LONG}"],
                ["--sim", "--fault", f"move_robot:1:abort={LONG}"],
                ["--ros-args", "-p", f"{LONG}:=1"],
                ["--ros-args", LONG],
            )
        ),
        ["send", LONG, "MoveRobot"],
        ["send", "a", LONG],
        ["send", "a", "MoveRobot", f"{LONG}=1"],
        ["send", "a", "MoveRobot", f"distance={LONG}"],
        ["call", "a", "--set", LONG],
        ["control", LONG, "pause"],
        ["control", "a", "pause", LONG],
        ["cleanup", LONG],
        ["serve", "--policy", LONG],
        ["serve", "--trees", LONG],
        ["sim", "--journal", f"/{LONG}"],
        ["explain", LONG],
        ["interfaces", "build", LONG],
        ["render", "pick_and_place", "-o", f"/{LONG}.svg"],
        ["completion", LONG],
    ],
    ids=lambda arguments: " ".join(word[:20] for word in arguments),
)
def test_a_wrong_argument_of_any_length_is_refused_in_three_lines_at_most(
    arguments: list[str], domain: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(refused(capsys, *arguments)) <= MESSAGE + 1


def test_without_arguments_the_help_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    assert "commands:" in capsys.readouterr().out


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_each_command_has_a_help_text_with_an_example(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as exit_:
        cli.main([command, "--help"])
    assert exit_.value.code == 0
    assert f"  bt-actions {command}" in capsys.readouterr().out


def test_the_version_is_the_package_s(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        cli.main(["--version"])
    assert exit_.value.code == 0
    assert capsys.readouterr().out.startswith("bt-actions 0.")


@pytest.mark.parametrize(
    "arguments", [["--help"], ["run", "--help"], ["check", "--help"], ["runs", "--tree", "x"]]
)
def test_help_and_a_list_of_runs_load_nothing_slow(arguments: list[str]) -> None:
    code = (
        "import sys\n"
        "from bt_actions.cli import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        "slow = {'rclpy', 'rich', 'pygraphviz', 'py_trees'} & set(sys.modules)\n"
        "sys.exit(f'loaded {slow}' if slow else 0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=CHECKOUT
    )
    assert (done.returncode, "loaded" in done.stderr) == (0, False), done.stderr


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1", 1),
        ("2.5", 2.5),
        ("-1e3", -1000.0),
        ("true", True),
        ("yes", "yes"),
        ("on", "on"),
        ("null", None),
        ("", ""),
        ("to the shelf", "to the shelf"),
        ("hello: world # 1", "hello: world # 1"),
        ("[1, 2.5, x]", [1, 2.5, "x"]),
        ("{x: 1, y: [true]}", {"x": 1, "y": [True]}),
        ("'1'", "1"),
        ('"a b"', "a b"),
        ("a=b", "a=b"),
        ("&x", "&x"),
    ],
)
def test_a_value_is_read_as_a_tree_file_has_it(text: str, expected: object) -> None:
    read = value(text, "field")
    assert read == expected
    assert type(read) is type(expected)


def test_of_two_values_for_one_field_the_last_counts() -> None:
    assert goal_fields(["a=1", "a=2", "b=x=y"]) == {"a": 2, "b": "x=y"}


def test_dotted_fields_become_nested_ones() -> None:
    given = {"pose.position.x": 1.0, "pose.position.y": 2.0, "name": "a"}
    assert nested(given) == {"pose": {"position": {"x": 1.0, "y": 2.0}}, "name": "a"}


@pytest.mark.parametrize("given", [{"a": 1, "a.b": 2}, {"a.b": 2, "a": 1}])
def test_a_field_cannot_have_a_value_and_parts(given: dict[str, object]) -> None:
    with pytest.raises(BadInput, match="field"):
        nested(given)
