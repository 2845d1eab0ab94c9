"""`bt-actions sim` as a process: ready, served, killed, ended."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from robot_control_interfaces.action import MoveRobot

from bt_actions.simulation import journal as j
from tests.simulation.conftest import Bench
from tests.simulation.test_simulation import Robot
from tests.support.processes import ROOT, Process

pytestmark = pytest.mark.ros
MAIN = "import sys; from bt_actions.cli import main; sys.exit(main())"


@pytest.fixture
def stands_on() -> str:
    """The bench lends only its clients here: one kind of executor is enough for it."""
    return "multi"


@pytest.fixture
def start_sim(bench: Bench, space: str, tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Start the command in the test's namespace, and wait until it is ready."""
    started: list[Process] = []

    def start(*arguments: str) -> Process:
        names = () if "--robots" in arguments else ("--namespace", space)
        journal = ("--journal", str(bench.path))
        command = ["-c", MAIN, "sim", *names, *journal, *arguments]
        started.append(Process(command, short_lease=True))
        started[-1].line("ready: ")
        return started[-1]

    yield start
    for each in started:
        each.close()


@pytest.mark.parametrize(("kind", "number"), [("multi", signal.SIGINT), ("single", signal.SIGTERM)])
def test_a_signal_ends_it_cleanly(
    start_sim: Any, kind: str, number: signal.Signals, space: str
) -> None:
    process = start_sim("--executor", kind, "--speed", "10")
    assert process.lines == [f"ready: {space}/move_robot, {space}/gripper_control, speed 10"]
    process.send(number)
    assert process.wait(5.0) == 0
    assert process.lines[1:] == ["The part lies at 2.00 m, at the pick station."]
    assert process.errors == []


@pytest.mark.parametrize("kind", ["multi", pytest.param("single", marks=pytest.mark.chaos)])
def test_it_serves_another_process_and_says_what_becomes_of_the_part(
    start_sim: Any, bench: Bench, space: str, kind: str
) -> None:
    robot = Robot(bench, space)
    process = start_sim("--executor", kind, "--speed", "20")
    robot.until_ready().carry(to=5.0)
    name = space.strip("/")
    assert process.line("picked") == f"picked: the part at 1.99 m, at the pick station, by {name}"
    assert process.line("placed") == f"placed: the part at 4.99 m, at the shelf, by {name}"
    process.send(signal.SIGINT)
    assert process.wait(5.0) == 0
    assert process.lines[-1] == "The part lies at 4.99 m, at the shelf."
    assert j.max_live(bench.entries()) == 1


def test_ctrl_c_in_mid_motion_ends_it_at_once(start_sim: Any, bench: Bench, space: str) -> None:
    robot = Robot(bench, space)
    process = start_sim()
    robot.until_ready().move.send(distance=9.0).until_moving()
    process.send(signal.SIGINT)
    assert process.wait(5.0) == 0
    assert process.errors == []
    assert list(j.ends(bench.entries()).values()) == [j.Event.DIED]


@pytest.mark.parametrize("fault", ["die", "die=accept", "die=cancel"])
def test_die_is_sigkill(start_sim: Any, bench: Bench, space: str, fault: str) -> None:
    robot = Robot(bench, space)
    process = start_sim("--fault", f"move_robot:1:{fault}", "--speed", "10")
    goal = robot.until_ready().move.send(distance=2.0)
    if fault == "die=cancel":
        goal.until_moving().cancel()
    assert process.wait(10.0) == -signal.SIGKILL
    entries = bench.entries()
    [end] = j.ends(entries).values()
    assert end is (None if fault == "die=accept" else j.Event.DIED)
    closed = [entry.server for entry in entries if entry.event is j.Event.CLOSED]
    assert closed == [f"{space}/move_robot", f"{space}/gripper_control"]
    assert j.max_live(entries) == (0 if fault == "die=accept" else 1)


def test_restart_keeps_the_process(start_sim: Any, bench: Bench, space: str) -> None:
    robot = Robot(bench, space)
    process = start_sim("--fault", "move_robot:1:restart=0.2", "--speed", "10")
    robot.until_ready().move.send(distance=2.0)
    bench.until(bench.happened("died"))
    again = robot.until_ready().move.send(distance=1.0)
    assert again.until_ended().status == GoalStatus.STATUS_SUCCEEDED
    assert process.popen.poll() is None


def test_several_robots(start_sim: Any, bench: Bench) -> None:
    process = start_sim("--robots", "3")
    assert process.lines == ["ready: /r1/move_robot to /r3/gripper_control, 3 robots, speed 1"]
    opened = {entry.server for entry in bench.entries()}
    assert opened == {f"/r{n}/{s}" for n in (1, 2, 3) for s in ("move_robot", "gripper_control")}


def test_the_seed_is_printed_and_can_be_given(start_sim: Any) -> None:
    process = start_sim("--fault", "move_robot:5%:abort", "--seed", "77")
    assert process.lines[0].endswith("seed 77")


def test_it_goes_on_when_nobody_reads_its_output(bench: Bench, space: str) -> None:
    client = bench.client(MoveRobot, f"{space}/move_robot")
    robot = Robot(bench, space)
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, "sim", "--namespace", space, "--speed", "20"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=ROOT,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith(b"ready: ")
        process.stdout.close()
        robot.until_ready().carry(to=5.0)
        assert client.send(distance=0.0).until_ended().status == GoalStatus.STATUS_SUCCEEDED
        process.send_signal(signal.SIGTERM)
        assert process.wait(5.0) == 0
        assert process.stderr is not None
        assert b"Error" not in process.stderr.read()  # rclpy may warn of an answer to nobody
    finally:
        process.kill()
        process.wait()
        assert process.stderr is not None
        process.stderr.close()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--fault", "move_robot:2:abrot"], "did you mean 'abort'"),
        (["--fault", "move_robt:2:abort"], "did you mean 'move_robot'"),
        (["--journal", "/dev/null/j"], "Not a directory"),
        (["--speed", "0"], "'0' is no factor from 1e-05 to 100000"),
        (["--step-period", "-1"], "'-1' is no positive"),
        (["--robots", "0"], "no number of robots"),
        (["--robots", "2", "--namespace", "/r1"], "not allowed with"),
        (["--namespace", "1r"], "no ROS namespace"),
        (["--spead", "2"], "did you mean '--speed'"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    domain: int, capfd: pytest.CaptureFixture[str], arguments: list[str], says: str
) -> None:
    from bt_actions.cli import main

    try:
        code = main(["sim", *arguments])
    except SystemExit as error:
        code = int(str(error.code))
    output = capfd.readouterr()
    assert code == 2
    assert output.out == ""
    assert says in output.err
    assert len(output.err.strip().splitlines()) == 1


def test_help_lists_every_fault(capsys: pytest.CaptureFixture[str]) -> None:
    from bt_actions.cli import main
    from bt_actions.simulation.faults import FaultKind

    with pytest.raises(SystemExit):
        main(["sim", "--help"])
    text = capsys.readouterr().out
    for kind in FaultKind:
        assert f"  {kind}" in text
    assert "examples:" in text
