"""`bt-actions send`, as a process: one goal, with the life that a goal has in a tree."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable

import pytest

from bt_actions.cli import main
from tests.cli.conftest import Start
from tests.support.processes import Journal, Process
from tests.support.waiting import until

Robot = Callable[..., Journal]


def test_feedback_result_and_outcome_are_shown(start: Start, robot: Robot, namespace: str) -> None:
    journal = robot(speed=10.0)
    send = start("send", f"{namespace}/move_robot", "MoveRobot", "distance=2.0")
    assert send.wait() == 0, send
    assert f"executing on {namespace}/move_robot" in send.lines
    assert any(line.startswith("  current_pose ") for line in send.lines)
    assert "  status: 0  # COMPLETED" in send.lines
    assert send.lines[-1].startswith("SUCCEEDED, after ")
    assert journal.ends() == ["succeeded"]


@pytest.mark.parametrize(("options", "shown"), [(["--quiet"], False), (["--no-feedback"], True)])
def test_less_is_shown_when_less_is_wanted(
    options: list[str], shown: bool, start: Start, robot: Robot, namespace: str
) -> None:
    robot(speed=20.0)
    send = start(
        "send", "move_robot", "MoveRobot", "distance=1", "--namespace", namespace, *options
    )
    assert send.wait() == 0, send
    assert not any("current_pose" in line for line in send.lines)
    assert bool(send.lines) is shown


def test_quiet_still_says_what_went_wrong(start: Start, robot: Robot, namespace: str) -> None:
    robot("1:abort")
    send = start("send", f"{namespace}/move_robot", "MoveRobot", "distance=1", "-q")
    assert send.wait() == 1, send
    assert send.lines[1].strip().startswith("ABORTED: aborted by "), send


@pytest.mark.parametrize(("how", "code"), [("SIGINT", 130), ("timeout", 124)])
def test_what_ends_it_early_cancels_the_goal(
    how: str, code: int, start: Start, robot: Robot, namespace: str
) -> None:
    journal = robot("1:slow=200", speed=1.0)
    timeout = ["--timeout", "6"] if how == "timeout" else []
    send = start("send", f"{namespace}/move_robot", "MoveRobot", "distance=1", *timeout)
    send.line("executing on")
    if how != "timeout":
        send.send(signal.Signals[how])
    assert send.wait() == code, send
    assert journal.ends() == ["canceled"]
    why = "--timeout 6 s expired" if how == "timeout" else f"interrupted by {how}"
    assert send.lines[-1].startswith(f"CANCELED: {why}, after "), send
    assert not any("by the tree" in line or "final_pose" in line for line in send.lines)


def again(send: Process) -> None:
    """Press Ctrl-C once more, unless it is over; so soon that some count as the one before."""
    if send.popen.poll() is None:
        send.send(signal.SIGINT)
    threading.Event().wait(0.1)


def test_a_goal_that_is_left_says_that_its_end_is_not_known(
    start: Start, robot: Robot, namespace: str
) -> None:
    robot("1:drop_cancel", speed=1.0)
    send = start("send", f"{namespace}/move_robot", "MoveRobot", "distance=1")
    send.line("executing on")
    send.send(signal.SIGINT)
    send.line("canceling 1 goal")
    until(lambda: send.popen.poll() is not None, meanwhile=lambda: again(send))
    assert send.wait() == 3, send
    assert any(line.startswith("CANCELED, end not known") for line in send.lines), send
    assert not any("final_pose" in line for line in send.lines)


def test_a_name_that_ros_does_not_take_is_bad_input(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["send", "move robot", "MoveRobot", "distance=1.0"]) == 2
    assert "'move robot' cannot be the name of an action server: a space" in capsys.readouterr().err
