"""`bt-actions interfaces show` and `list`, on what is installed."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest

from bt_actions import cli

pytest.importorskip("geometry_msgs")

STAMPED = """\
std_msgs/Header header
	builtin_interfaces/Time stamp
		int32 sec
		uint32 nanosec
	string frame_id
Pose pose
	Point position
		float64 x
		float64 y
		float64 z
	Quaternion orientation
		float64 x 0
		float64 y 0
		float64 z 0
		float64 w 1
"""


def shown(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert cli.main(["interfaces", *arguments]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    return said.out


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with contextlib.suppress(SystemExit):  # of the parser, whose code is tested elsewhere
        assert cli.main(["interfaces", *arguments]) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert said.out == ""
    return line


@pytest.mark.parametrize(
    "name", ["PoseStamped", "geometry_msgs/PoseStamped", "geometry_msgs/msg/PoseStamped"]
)
def test_a_type_is_shown_with_the_messages_in_it(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = shown(capsys, "show", name).splitlines(keepends=True)
    assert "".join(line for line in lines if line.strip() and line[0] != "#") == STAMPED
    assert lines[0].startswith("# ")


def test_comments_constants_and_defaults_are_shown_as_they_are_written(
    capsys: pytest.CaptureFixture[str],
) -> None:
    source = Path(__file__).parents[2] / "interfaces/bt_actions_interfaces/msg/ActionReport.msg"
    lines = shown(capsys, "show", "ActionReport").splitlines()
    assert [line for line in lines if line[:1] != "\t"] == source.read_text().splitlines()


def test_comments_of_messages_in_it_are_shown_when_they_are_asked_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    plain, full = shown(capsys, "show", "Pose"), shown(capsys, "show", "Pose", "--all-comments")
    assert "\t#" not in plain
    assert "\t#" in full
    assert {line for line in plain.splitlines() if "\t" in line} <= set(full.splitlines())


def test_what_there_is_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    everything = shown(capsys, "list").splitlines()
    assert {"geometry_msgs/msg/Pose", "std_srvs/srv/SetBool"} <= set(everything)
    assert shown(capsys, "list", "robot_control_interfaces").splitlines() == [
        "robot_control_interfaces/action/Gripper",
        "robot_control_interfaces/action/MoveRobot",
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "MoveRobt"], "no installed package has the type 'MoveRobt'; did you mean 'Move"),
        (["show", "Empty"], "'Empty' is more than one type, name it in full: std_msgs/msg/Empty"),
        (["show", "geometry_msgs/action/Pose"], "no installed package has the type 'geometry_msgs"),
        (["list", "geometry_msg"], "no package 'geometry_msg' with interfaces is installed"),
        (["show", "Pose", "--all-coments"], "no option --all-coments; did you mean '--all-comm"),
        (["shw"], "invalid choice: 'shw'"),
        ([], "COMMAND"),
        (["build", ".", "-o", "README.md"], "File exists: 'README.md'"),
        (
            ["build", "/no/such/folder"],
            "bt-actions: interfaces build: /no/such/folder is no folder",
        ),
    ],
)
def test_what_is_not_there_is_said_on_one_line(
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    assert message in refused(capsys, *arguments)


@pytest.mark.parametrize("command", ["build", "show", "list"])
def test_each_command_below_has_a_help_text_with_an_example(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as exit_:
        cli.main(["interfaces", command, "--help"])
    assert exit_.value.code == 0
    assert f"\n  bt-actions interfaces {command} " in capsys.readouterr().out
