"""`bt-actions cleanup`: what is said of goals that were left; real ones are in tests/scenarios."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bt_actions.cli import main
from bt_actions.cli.driving import sweep as module
from bt_actions.cli.driving.signals import SAME_WISH, Signals
from bt_actions.cli.driving.sweep import sweep
from bt_actions.goals.policy import End
from bt_actions.recovery.roll_call import LeftBehind, RollCall
from bt_actions.recovery.sweep import Cleanup, Swept
from tests.cli.conftest import Start
from tests.support.processes import Journal, Process
from tests.support.waiting import holds_for, until


class Unwritable:
    """Standard output, where nothing can be written."""

    encoding = "utf-8"

    def __init__(self, error: int) -> None:
        self.error = error

    def write(self, text: str) -> int:
        raise OSError(self.error, "on purpose")

    def flush(self) -> None:
        pass

    def fileno(self) -> int:
        raise OSError


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EPIPE], ids=["full", "closed"])
@pytest.mark.parametrize("end", [End.UNKNOWN, End.CANCELED])
def test_a_goal_that_may_be_running_counts_more_than_an_output_that_is_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: int, end: End
) -> None:
    left = LeftBehind(RollCall("/move"), bytes(16), 1, shown=end)
    monkeypatch.setattr(Cleanup, "run", lambda _: Swept([left], ["/move"], {}, 0, None, [], {}))
    monkeypatch.setattr(sys, "stdout", Unwritable(error))
    lost = {errno.ENOSPC: 2, errno.EPIPE: 141}[error]
    assert main(["cleanup"]) == (3 if end is End.UNKNOWN else lost)
    said = "not all of these goals have ended" in capsys.readouterr().err
    assert said is (end is End.UNKNOWN)


def test_where_no_server_is_in_sight_nobody_says_that_nothing_is_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """They may be stopped, or start later; or this is the wrong domain."""
    in_sight: list[str] = []
    monkeypatch.setattr(Cleanup, "run", lambda _: Swept([], in_sight, {}, 7, None, [], {}))
    assert main(["cleanup"]) == 3
    said = capsys.readouterr()
    assert "no action server is in sight in ROS domain 7" in said.err
    assert not said.out
    assert sweep(0.1, 0.1, wanted=()) == 0, "a tree without actions is in nobody's way"
    assert capsys.readouterr().out
    in_sight.append("/move")
    assert main(["cleanup"]) == 0
    assert capsys.readouterr().out == (
        "nothing is left to cancel on the 1 action in sight in ROS domain 7\n"
    )


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EPIPE], ids=["full", "closed"])
def test_a_silent_server_counts_more_than_an_output_that_is_lost(
    monkeypatch: pytest.MonkeyPatch, error: int
) -> None:
    goal = LeftBehind(RollCall("/a"), bytes(16), 1, shown=End.CANCELED)
    swept = Swept([goal], ["/a"], {"/b": "no server of {} answers"}, 0, None, ["/b"], {})
    monkeypatch.setattr(Cleanup, "run", lambda _: swept)
    monkeypatch.setattr(sys, "stdout", Unwritable(error))
    assert main(["cleanup"]) == 3


def test_what_nobody_wants_is_not_counted_where_it_is_silent(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    silent = {"/b": "no server of {} answers"}
    monkeypatch.setattr(Cleanup, "run", lambda _: Swept([], ["/a"], silent, 7, None, [], {}))
    assert sweep(0.1, 0.1, wanted=["/a"]) == 0
    said = capsys.readouterr()
    assert said.err == "no server of /b answers: nobody can see the goals there\n"
    assert said.out == ("nothing is left to cancel on the 1 action of 2 in sight in ROS domain 7\n")


def test_where_the_records_cannot_be_read_nobody_says_that_nothing_is_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trouble = PermissionError(errno.EPERM, "others may write there", "/records")
    monkeypatch.setattr(Cleanup, "run", lambda _: Swept([], ["/a"], {}, 7, trouble, [], {}))
    assert main(["cleanup"]) == 3
    said = capsys.readouterr()
    assert "nobody can see the goals without an answer" in said.err
    assert "/records" in said.err
    assert said.out == ""


def test_an_action_that_is_named_is_wanted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where its server is out of sight, others that are not say nothing of what was left there."""

    def run(cleanup: Cleanup) -> Swept:
        wanted = list(cleanup.wanted or ())
        silent = dict.fromkeys(wanted, "no server of {} answers")
        return Swept([], ["/a"], silent, 7, None, wanted, {})

    monkeypatch.setattr(Cleanup, "run", run)
    assert main(["cleanup", "/r1/move"]) == 3
    said = capsys.readouterr()
    assert said.err == ("no server of /r1/move answers: nobody can see the goals there; start it\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_it_and_it_says_so(start: Start, node: Any, number: signal.Signals) -> None:
    cleanup = start("cleanup", "--look", "60")
    until(lambda: "bt_actions_cleanup" in node.get_node_names(), within=20.0)
    cleanup.send(number)
    assert cleanup.wait() == 128 + number, cleanup
    assert cleanup.errors == [f"stopped by {number.name} before all servers had answered"]


def test_a_signal_while_a_goal_runs_that_was_found(
    start: Start, serve: Callable[..., Journal], name: str
) -> None:
    journal = serve("1:delay_cancel=60")
    send = start("send", name, "MoveRobot", "distance=90")
    goal = journal.wait_for("accepted", within=20.0).goal
    send.send(signal.SIGKILL)
    cleanup = start("cleanup", "--patience", "60")
    until(lambda: any(goal in line for line in cleanup.errors), within=20.0)
    cleanup.send(signal.SIGTERM)
    assert cleanup.wait() == 3, cleanup
    assert cleanup.lines == [f"{name}  {goal}  UNKNOWN"]


def test_what_was_left_is_looked_for_at_the_server_that_rules_lead_to(
    start: Start, serve: Callable[..., Journal], name: str, tree: Callable[..., Path]
) -> None:
    serve()
    used = f"{name}/nobody_is_here"
    rules = [f"{used}/_action/{part}:={name}/_action/{part}" for part in
             ("send_goal", "cancel_goal", "get_result", "feedback", "status")]  # fmt: skip
    words = ("--ros-args", *(word for rule in rules for word in ("-r", rule)))
    run = start("run", str(tree(server=used, distance=0.1)), "--cleanup-first", *words)
    assert run.wait() == 0, run
    assert any(f"executing on {name}" in line for line in run.lines)
    assert not any(used in line for line in [*run.lines, *run.errors])
    cleanup = start("cleanup", used, "--look", "1", *words)
    assert cleanup.wait() == 0, cleanup


@pytest.mark.parametrize(("leaves_a_goal", "code"), [(False, 130), (True, 3)])
def test_a_second_signal_does_not_wait(
    monkeypatch: pytest.MonkeyPatch, leaves_a_goal: bool, code: int
) -> None:
    ended: list[int] = []
    monkeypatch.setattr(os, "_exit", ended.append)

    def run(cleanup: Cleanup) -> Swept:
        """Hang, whatever comes."""
        if leaves_a_goal:
            cleanup.found(LeftBehind(RollCall("/move"), bytes(16), 1))
        os.kill(os.getpid(), signal.SIGINT)
        until(cleanup.stopped)
        os.kill(os.getpid(), signal.SIGINT)
        assert holds_for(lambda: not ended, 1.2 * SAME_WISH), "a wrapper has passed on the first"
        os.kill(os.getpid(), signal.SIGINT)
        until(lambda: ended)
        return Swept([], ["/move"], {}, 7, None, [], {})

    monkeypatch.setattr(Cleanup, "run", run)
    sweep(0.1, 0.1)
    assert ended == [code]


def test_a_signal_that_comes_too_late_to_be_told_takes_effect_in_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Before a run, say, which is to begin when all is cleaned up."""
    taken, take = threading.Event(), Signals._take

    def noted(signals: Signals) -> list[signal.Signals]:
        if found := take(signals):
            taken.set()
        return found

    def say_late(_: Swept) -> str:
        os.kill(os.getpid(), signal.SIGINT)
        assert taken.wait(20.0)
        return "nothing"

    monkeypatch.setattr(Signals, "_take", noted)

    monkeypatch.setattr(Cleanup, "run", lambda _: Swept([], ["/move"], {}, 7, None, [], {}))
    monkeypatch.setattr(module, "_nothing", say_late)
    with pytest.raises(KeyboardInterrupt):
        sweep(0.1, 0.1, first="do not")


TOO_LATE = """
import os, signal, sys
from bt_actions.cli import main
from bt_actions.cli.driving import sweep as module
from bt_actions.recovery import sweep as cleanup
cleanup.Cleanup.run = lambda _: cleanup.Swept([], [], {}, 7, None, [], {})
main(["cleanup"])
os.kill(os.getpid(), signal.SIGTERM)
signal.pause()
"""


def test_what_was_told_is_the_exit_code_whatever_comes(
    start_program: Callable[..., Process],
) -> None:
    assert start_program("-c", TOO_LATE).wait() == 3
