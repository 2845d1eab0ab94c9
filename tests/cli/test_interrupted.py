"""However a run is ended from outside: the server sees the cancel, and the code says why.

The server's journal is the judge of what happened to a goal. No process is left behind.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Start, marked
from tests.support.processes import PATIENCE, ROOT, HostFactory, Journal, Process
from tests.support.reliability import ON_A_BUSY_MACHINE
from tests.support.waiting import until

Tree = Callable[..., Path]
Robot = Callable[..., Journal]

CANCEL = 2.0
"""The cancel deadline of the trees here, in seconds."""
EXECUTING = "To the part: executing on"


@pytest.fixture
def moving(
    start: Start, robot: Robot, namespace: str, tree: Tree, mark: str
) -> Callable[..., tuple[Process, Journal]]:
    """Start a run whose robot moves for a minute, and wait until it does."""

    def begin(
        *arguments: str, fault: str = "1:slow=200", cancel: float = CANCEL
    ) -> tuple[Process, Journal]:
        journal = robot(fault, speed=1.0)
        path = tree(timeout=f"{{result: 30 s, feedback: 5 s, cancel: {cancel:g} s}}")
        run = start("run", str(path), "--namespace", namespace, *arguments)
        run.line(EXECUTING if "--json" not in arguments else '"state": "EXECUTING"')
        journal.wait_for("accepted")
        return run, journal

    return begin


@pytest.mark.parametrize(("number", "how"), [(signal.SIGHUP, ""), (signal.SIGINT, "--json")])
def test_what_was_told_holds_though_a_signal_comes_late(
    number: signal.Signals, how: str, moving: Callable[..., tuple[Process, Journal]]
) -> None:
    """The goal runs on, and the process takes itself down."""
    run, _ = moving(*([how] if how else []), fault="1:reject_cancel", cancel=0.3)
    run.send(signal.SIGINT)
    run.line('"finished"' if how else "STOPPED")
    while run.popen.poll() is None:
        run.send(number)
        threading.Event().wait(0.01)
    assert run.wait() == 3, run


@pytest.mark.parametrize(
    ("number", "code", "how"),
    [
        (signal.SIGINT, 130, "--json"),
        (signal.SIGINT, 130, "--executor=single"),
        (signal.SIGTERM, 143, ""),
        (signal.SIGHUP, 129, ""),
        (signal.SIGQUIT, 131, ""),
    ],
)
def test_a_signal_in_mid_motion_cancels_the_goal_within_the_deadline_and_leaves_no_process(
    number: signal.Signals,
    code: int,
    how: str,
    moving: Callable[..., tuple[Process, Journal]],
    mark: str,
) -> None:
    run, journal = moving(*([how] if how else []))
    sent = run.send(number)
    assert run.wait() == code, run
    assert time.monotonic() - sent < ON_A_BUSY_MACHINE * (CANCEL + 1.0)
    assert journal.ends() == ["canceled"]
    assert not any("Traceback" in line for line in run.errors), run
    assert marked(mark) == []
    if how != "--json":
        (ended,) = [line for line in run.lines if line.startswith("STOPPED after")]
        assert ended.endswith(f"interrupted by {number.name}")
        assert "stopped while it ran:" in run.lines[run.lines.index(ended) :]


def test_a_signal_before_anything_was_sent_ends_the_run_too(
    start: Start, tree: Tree, namespace: str
) -> None:
    run = start("run", str(tree(timeout="{server: 60 s, result: 60 s}")), "--namespace", namespace)
    run.line("waiting for the server")
    run.send(signal.SIGINT)
    assert run.wait() == 130, run


def test_a_second_ctrl_c_leaves_at_once_and_says_which_goal_is_not_accounted_for(
    moving: Callable[..., tuple[Process, Journal]], mark: str
) -> None:
    run, _ = moving(fault="1:drop_cancel", cancel=PATIENCE)
    run.send(signal.SIGINT)
    run.line("Ctrl-C again leaves without waiting")
    began = time.monotonic()

    def impatient() -> None:
        if run.popen.poll() is None:
            run.send(signal.SIGINT)
        threading.Event().wait(0.1)

    until(lambda: run.popen.poll() is not None, meanwhile=impatient)
    assert run.wait() == 3, run
    assert time.monotonic() - began < PATIENCE, "it did not wait for the deadline"
    assert "not accounted for: To the part on" in run.lines[-1]
    assert marked(mark) == []


def test_a_goal_whose_end_stays_unknown_makes_the_code_3(
    start: Start, new_host: HostFactory, namespace: str, tree: Tree
) -> None:
    host = new_host(short_lease=False)  # so that a silent server does not count as gone
    journal = host.robot(namespace, "1:slow=200", speed=1.0)
    run = start("run", str(tree()), "--namespace", namespace)
    run.line(EXECUTING)
    journal.wait_for("accepted")
    host.send(signal.SIGSTOP)
    run.send(signal.SIGTERM)
    assert run.wait() == 3, run
    [told] = [line for line in (*run.lines, *run.errors) if "not accounted for" in line]
    assert told.startswith(f"not accounted for: To the part on {namespace}/move_robot, goal ")
    assert "{distance: " in told
    assert f"`bt-actions cleanup {namespace}/move_robot` cancels it" in str(run)


def test_a_closed_standard_output_ends_the_run_as_sigterm_does_though_nothing_more_is_written(
    robot: Robot, namespace: str, tree: Tree, mark: str, no_leaks: None
) -> None:
    journal = robot("1:slow=200", speed=1.0)
    arguments = ["run", str(tree()), "--namespace", namespace]
    with subprocess.Popen(
        [sys.executable, "-m", "bt_actions.cli", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=ROOT,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        for line in process.stdout:
            if b"executing on" in line:
                break
        process.stdout.close()
        journal.wait_for("canceled", within=2.0)
        assert process.wait(PATIENCE) == 141
        assert process.stderr.read() == b""
    assert journal.ends() == ["canceled"]
    assert marked(mark) == []


def test_under_nohup_a_hangup_changes_nothing(
    start_program: Callable[..., Process], robot: Robot, namespace: str, tree: Tree
) -> None:
    journal = robot("1:slow=4")
    code = "import signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN);"
    code += "from bt_actions.cli import main; sys.exit(main())"
    run = start_program("-c", code, "run", str(tree()), "--namespace", namespace)
    run.line(EXECUTING)
    run.send(signal.SIGHUP)
    assert run.wait() == 0, run
    assert journal.ends() == ["succeeded"]


def test_a_full_disk_under_the_output_does_not_stop_the_robot(
    robot: Robot, namespace: str, tree: Tree, no_leaks: None
) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("needs /dev/full")
    journal = robot()
    with full.open("wb") as out:
        done = subprocess.run(
            [sys.executable, "-m", "bt_actions.cli", "run", str(tree()), "--namespace", namespace],
            stdout=out,
            stderr=subprocess.PIPE,
            cwd=ROOT,
            env=os.environ,
            timeout=PATIENCE,
            check=False,
        )
    assert done.returncode == 1, "a success that nobody could be told is none"
    assert done.stderr.count(b"the output cannot be written") == 1
    assert b"Traceback" not in done.stderr
    assert journal.ends() == ["succeeded"]
