"""The launch files, and those that docs/launch.md shows, start commands that bt-actions takes."""

from __future__ import annotations

import re
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from bt_actions.cli.program import build_parser
from tests.serving.conftest import MAIN
from tests.support.launch_stand_in import expand
from tests.support.processes import Process

ROOT = Path(__file__).parents[2]
LAUNCH = ROOT / "launch"
FILES = sorted(path.name for path in LAUNCH.glob("*.launch.py"))
SERVE = ["bt_actions", "bt-actions", "serve", "--trees"]
SHOWN = re.findall(
    r"^```python\n(.*?)^```", (ROOT / "docs" / "launch.md").read_text(), re.MULTILINE | re.DOTALL
)


@pytest.mark.parametrize("name", FILES)
def test_each_launch_argument_has_a_default_and_says_what_it_is(name: str) -> None:
    for argument in expand(LAUNCH / name).declared:
        assert argument.default is not None, argument.name
        assert argument.description, argument.name


def test_show_args_lists_the_arguments_of_the_page() -> None:
    page = (ROOT / "docs" / "launch.md").read_text()
    rows = re.findall(r"^\| (`.*?`) \|", page, re.MULTILINE)
    told = {name for row in rows for name in re.findall(r"`(.*?)`", row)}
    listed = {name: {each.name for each in expand(LAUNCH / name).declared} for name in FILES}
    assert listed == {
        "serve.launch.py": told - {"speed"},
        "simulation.launch.py": told,
        "fleet.launch.py": told - {"speed", "namespace"} | {"robots"},
    }


def test_one_robot_is_served_in_its_namespace() -> None:
    (command,) = expand(LAUNCH / "serve.launch.py", namespace="r1").commands
    assert command.words == [
        *SERVE, "package://bt_actions/trees", "--policy", "reject", "--ros-args", "-r", "__ns:=/r1"
    ]  # fmt: skip
    assert (command.sigterm_timeout, command.respawn) == (15.0, False)


def test_what_is_given_reaches_the_command() -> None:
    given = {"trees": "a b", "policy": "queue", "max": "3", "python": "p q", "respawn": "true"}
    (command,) = expand(LAUNCH / "serve.launch.py", **given, sigterm_timeout="30").commands
    assert command.words[3:] == [
        "--trees", "a", "--trees", "b", "--policy", "queue", "--max", "3",
        "--python", "p", "--python", "q", "--ros-args", "-r", "__ns:=/",
    ]  # fmt: skip
    assert (command.sigterm_timeout, command.respawn) == (30.0, True)


def test_a_fleet_is_one_server_a_robot_each_with_what_is_given() -> None:
    commands = expand(LAUNCH / "fleet.launch.py", robots="a b c", trees="there").commands
    words = [command.words for command in commands]
    assert [each[-1] for each in words] == ["__ns:=/a", "__ns:=/b", "__ns:=/c"]
    assert all(each[: len(SERVE) + 1] == [*SERVE, "there"] for each in words)


@pytest.mark.parametrize("shown", SHOWN)
def test_what_the_page_shows_starts_what_bt_actions_takes(
    shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "ament_index_python.packages.get_package_share_directory", lambda _: str(ROOT)
    )
    file = tmp_path / "mine.launch.py"
    file.write_text(shown)
    commands = expand(file).commands
    assert commands
    for command in commands:
        args = build_parser().parse(command.words[2:])
        assert args.ros_args, command


def test_what_they_start_is_ready_and_ends_at_the_ctrl_c_of_launch(
    start_program: Callable[..., Process], name: str
) -> None:
    space, _, _ = name.rpartition("/")
    trees = str(ROOT / "trees")
    simulation = {"namespace": space, "speed": "10.0"}
    commands = [
        *expand(LAUNCH / "fleet.launch.py", robots=f"{space}/r1", trees=trees).commands,
        *expand(LAUNCH / "simulation.launch.py", trees=trees, **simulation).commands,
    ]
    processes = [start_program("-c", MAIN, *command.words[2:]) for command in commands]
    ready = [process.line("ready: ").partition(",")[0] for process in processes]
    assert ready == [
        f"ready: {space}/r1/run_tree", f"ready: {space}/run_tree", f"ready: {space}/move_robot"
    ]  # fmt: skip
    for process in processes:
        process.send(signal.SIGINT)
        process.send(signal.SIGINT)
    ends = [process.wait() for process in processes]
    assert ends == [0, 0, 0], "\n".join(map(str, processes))


def test_the_stand_in_refuses_what_launch_does_not_know(tmp_path: Path) -> None:
    file = tmp_path / "wrong.launch.py"
    file.write_text(
        "from launch_ros.actions import Node\n"
        "def generate_launch_description():\n"
        "    return Node(package='bt_actions', executable='bt-actions', argument=['sim'])\n"
    )
    with pytest.raises(TypeError, match="argument"):
        expand(file)
