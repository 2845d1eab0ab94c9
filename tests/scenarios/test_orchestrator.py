"""The orchestrator: signals, exceptions, clocks, SIGKILL, a full disk.

It is a process of its own (`bt-actions run`) where it is hit by signals, and this one elsewhere.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from bt_actions import End, MoveRobot, Outcome, Timeouts, TreeError, TreeRunner
from tests.scenarios.conftest import Launch
from tests.support.processes import PATIENCE, ROOT, HostFactory, Journal, Process
from tests.support.records import on_record
from tests.support.reliability import Record
from tests.support.simulated_time import SimulatedTime
from tests.support.trees import started, state
from tests.support.waiting import holds_for, until

Serve = Callable[..., Journal]
Tree = Callable[..., Path]
InPhase = Callable[..., tuple[Process, Journal | None]]

ACCEPT, CANCEL = 3.0, 3.0
"""Deadlines of the trees here."""


# Signals, in every phase of a goal

PHASES: dict[str, tuple[str | None, str, str]] = {
    "QUEUED": (None, "Move 2: waiting for its turn on", "accepted"),
    "WAITING_FOR_SERVER": (None, "waiting for the server", ""),
    "SENDING": ("1:delay_accept=1.5", "sending a goal to", "received"),
    "EXECUTING": (None, "executing on", "accepted"),
    "CANCELING": ("1:delay_cancel=1.5", "canceling on", "cancel_requested"),
    "BACKOFF": ("1:abort=0.1", "ABORTED", "aborted"),
}
"""The fault that makes it last, the line that tells of it, and what the server has seen by then."""
ENDS = {
    "QUEUED": ["canceled"],
    "WAITING_FOR_SERVER": [],
    "SENDING": ["canceled"],
    "EXECUTING": ["canceled"],
    "CANCELING": ["canceled"],
    "BACKOFF": ["aborted"],
}


@pytest.fixture
def in_phase(launch: Launch, serve: Serve, tree: Tree, name: str) -> InPhase:
    """Start a run and wait until its goal is in a phase; at a server with a fault."""

    def start(phase: str, fault: str | None = None) -> tuple[Process, Journal | None]:
        usual, line, seen = PHASES[phase]
        faults = [each for each in [fault or usual] if each]
        journal = serve(*faults) if phase != "WAITING_FOR_SERVER" else None
        result = "0.5 s" if phase == "CANCELING" else "60 s"
        path = tree(
            name,
            distance=[9.0, 9.0] if phase == "QUEUED" else 9.0,
            timeout=f"{{queue: 60 s, server: 60 s, accept: {ACCEPT:g} s, result: {result}, "
            f"cancel: {CANCEL:g} s}}",
            retry="{attempts: 2, backoff: 60 s}",
        )
        if phase == "QUEUED":
            path.write_text(path.read_text().replace("sequence: Work", "parallel: Work"))
        run = launch("run", str(path), "--verbose")
        run.line(line)
        if journal is not None and seen:
            journal.wait_for(seen)
        return run, journal

    return start


NUMBERS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
REPRESENTATIVE = {
    (signal.SIGTERM, "QUEUED"),
    (signal.SIGINT, "SENDING"),
}


@pytest.mark.parametrize(
    ("number", "phase"),
    [
        pytest.param(
            number,
            phase,
            id=f"{number.name}-{phase}",
            marks=() if (number, phase) in REPRESENTATIVE else pytest.mark.chaos,
        )
        for phase in PHASES
        for number in NUMBERS
    ],
)
def test_a_signal_ends_the_run_and_every_goal_first(
    number: signal.Signals, phase: str, in_phase: InPhase, ledger: Path, record: Record
) -> None:
    """The signal named, in the phase named"""
    run, journal = in_phase(phase)
    sent = run.send(number)
    assert run.wait() == NUMBERS[number], run
    record.took(time.monotonic() - sent, ACCEPT + CANCEL + 1.0)
    assert not any("Traceback" in line for line in run.errors), run
    assert list(ledger.glob("*")) == [], "all that was sent has been answered"
    if journal is not None:
        assert journal.ends() == ENDS[phase]
        assert journal.max_live <= 1
        if phase == "SENDING":
            asked, accepted = (journal.wait_for(e).t for e in ("cancel_requested", "accepted"))
            assert asked - accepted < 1.0, "canceled as soon as it was accepted"
    record.outcome = f"exit code {NUMBERS[number]}, every goal accounted for"


def interrupt_again_and_again(run: Process) -> float:
    """Send SIGINT, as who does not want to wait, until it has ended; return how long that took."""

    def impatient() -> None:
        if run.popen.poll() is None:
            run.send(signal.SIGINT)
        threading.Event().wait(0.1)

    first = time.monotonic()
    until(lambda: run.popen.poll() is not None, meanwhile=impatient)
    return time.monotonic() - first


@pytest.mark.chaos
@pytest.mark.parametrize(
    ("phase", "fault"),
    [
        pytest.param("QUEUED", "1:delay_cancel=15"),
        pytest.param("SENDING", "1:delay_accept=4"),
        ("EXECUTING", "1:delay_cancel=15"),
        pytest.param("CANCELING", "1:delay_cancel=15"),
    ],
)
def test_a_second_sigint_leaves_at_once_and_cleanup_finishes_its_work(
    phase: str, fault: str, in_phase: InPhase, launch: Launch, record: Record
) -> None:
    """SIGINT twice, while the server withholds its answer; then `bt-actions cleanup`"""
    run, journal = in_phase(phase, fault)
    assert journal is not None
    run.send(signal.SIGINT)
    run.line("Ctrl-C again leaves without waiting")
    at_server = ["received"] if phase == "SENDING" else ["received", "accepted", "cancel_requested"]
    journal.wait_for(at_server[-1])
    record.took(interrupt_again_and_again(run), 2.0)
    assert run.wait() == 3, run
    [told] = [line for line in run.lines if line.startswith("not accounted for: ")]
    assert "Move 1 on" in told
    assert journal.events()[: len(at_server)] == at_server
    assert journal.ends() == [None], "it runs on"
    left = journal.wait_for("accepted", within=6.0).goal
    cleanup = launch("cleanup", "--patience", "30")
    assert cleanup.wait(45.0) == 0, cleanup
    assert any(left in line and "CANCELED" in line for line in cleanup.lines), cleanup
    asked = [e.goal for e in journal.entries() if e.event == "cancel_requested"].count(left)
    assert asked > at_server.count("cancel_requested"), "cleanup has asked, too"
    assert journal.ends() == ["canceled"]
    record.outcome = "exit code 3, naming the goal; cleanup: CANCELED, exit code 0"


@pytest.mark.chaos
@pytest.mark.parametrize("phase", ["WAITING_FOR_SERVER", "BACKOFF"])
def test_a_second_sigint_where_nothing_is_at_a_server_changes_nothing(
    phase: str, in_phase: InPhase, ledger: Path, record: Record
) -> None:
    """SIGINT again and again"""
    run, journal = in_phase(phase)
    record.took(interrupt_again_and_again(run), 2.0)
    assert run.wait() == 130, run
    assert "not accounted for" not in str(run)
    assert not any("Traceback" in line for line in run.errors), run
    assert list(ledger.glob("*")) == []
    assert ([] if journal is None else journal.ends()) == ENDS[phase]
    record.outcome = "exit code 130, nothing is left"


STUCK = """\
import threading
from py_trees.behaviour import Behaviour
from py_trees.common import Status

class Stuck(Behaviour):
    ticks = 0

    def update(self):
        move = self.parent.children[0]
        self.ticks += move.progress().state == "EXECUTING"
        if self.ticks == 3:
            print("blocked", flush=True)
            threading.Event().wait()
        return Status.RUNNING
"""


def test_a_signal_while_a_behaviour_does_not_return_from_its_tick(
    launch: Launch, serve: Serve, tree: Tree, name: str, tmp_path: Path, record: Record
) -> None:
    """A behaviour blocks its tick for ever beside a move; SIGTERM, and then again"""
    journal = serve()
    path = tree(name, distance=30.0)
    (tmp_path / "stuck_here.py").write_text(STUCK)
    text = path.read_text().replace("sequence: Work", "parallel: Work")
    path.write_text(f"{text}    - python: stuck_here.Stuck\n")
    run = launch("run", str(path), environment={"PYTHONPATH": f"{ROOT}:{tmp_path}"})
    run.line("blocked")
    sent = run.send(signal.SIGTERM)
    journal.wait_for("canceled", within=9.0)
    record.took(time.monotonic() - sent, 3.0)
    assert run.popen.poll() is None
    run.send(signal.SIGTERM)
    assert run.wait() == 3, run
    assert any("Work/Stuck does not return from its tick" in line for line in run.errors), run
    assert any("CANCELED" in line for line in run.lines), run
    assert "not accounted for" not in str(run)
    record.outcome = "CANCELED within its tick; exit code 3 at the second signal"


# What goes wrong within


@pytest.mark.parametrize("executor", ["multi", pytest.param("single", marks=pytest.mark.chaos)])
def test_an_exception_in_the_spin_thread_fails_the_tree_and_drains_it(
    serve: Serve, name: str, domain: int, executor: str, record: Record
) -> None:
    """A callback of another node in the same executor raises, in mid-motion"""
    from rclpy.node import Node

    journal = serve()
    leaf = MoveRobot("m", 9.0, action_name=name)
    with TreeRunner(leaf, executor=executor) as runner:
        guest = Node("guest", context=runner.node.context)
        runner.on_close(guest.destroy_node)
        runner.executor.add_node(guest)
        runner.start()
        until(lambda: state(leaf) == "EXECUTING")
        raised = time.monotonic()
        guest.create_timer(0.01, lambda: 1 / 0)
        runner.executor.wake()
        with pytest.raises(TreeError, match="spin thread died: ZeroDivisionError"):
            runner.wait(5.0)
        record.took(time.monotonic() - raised, 3.0)
        assert runner.unaccounted == []
    assert journal.ends() == ["canceled"]
    record.outcome = "TreeError; the goal was drained before, with nobody spinning"


@pytest.mark.chaos
@pytest.mark.parametrize("executor", ["single", "multi"])
def test_a_slow_executor_delays_no_deadline(
    serve: Serve, name: str, domain: int, executor: str, record: Record
) -> None:
    """Callbacks of another node keep every thread of the executor for 0.7 s at a time"""
    from rclpy.callback_groups import ReentrantCallbackGroup
    from rclpy.node import Node

    journal = serve()
    leaf = MoveRobot("m", 9.0, action_name=name, timeout=1.0)
    with TreeRunner(leaf, executor=executor) as runner:
        guest = Node("guest", context=runner.node.context)
        runner.on_close(guest.destroy_node)
        group = ReentrantCallbackGroup()
        for _ in range(3):
            guest.create_timer(0.75, lambda: threading.Event().wait(0.7), callback_group=group)
        runner.executor.add_node(guest)
        assert runner.run(timeout=15.0) is Status.FAILURE
        assert runner.unaccounted == []
    assert (leaf.outcome, leaf.end) == (Outcome.RESULT_TIMEOUT, End.CANCELED)
    asked = journal.wait_for("cancel_requested").t
    record.took(asked - journal.wait_for("accepted").t, 4.0)
    assert journal.ends() == ["canceled"]
    record.outcome = "RESULT_TIMEOUT, end CANCELED; time until the server was asked to cancel"


@pytest.mark.chaos
def test_an_answer_in_time_counts_however_late_it_is_taken(
    serve: Serve, name: str, node: Any, record: Record
) -> None:
    """Nobody spins the node; deadlines of 2 s for acceptance and result, the goal takes 0.1 s"""
    journal = serve()
    leaf = MoveRobot("m", 0.1, action_name=name, timeout=Timeouts(accept=2.0, result=2.0))
    leaf.setup(node=node)
    until(lambda: leaf.outcome, 9.0, meanwhile=leaf.tick_once)
    leaf.shutdown()
    assert (leaf.outcome, leaf.end) == (Outcome.SUCCEEDED, End.SUCCEEDED)
    assert journal.events() == ["received", "accepted", "succeeded"]
    record.outcome = "SUCCEEDED: what has arrived is taken in before a deadline is judged"


# Clocks


@pytest.fixture
def simulated(context: Any, no_leaks: None) -> Iterator[tuple[SimulatedTime, Any]]:
    """A node on simulated time that has begun, and the clock."""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    clock = SimulatedTime(context)
    node = Node(
        "on_simulated_time",
        context=context,
        parameter_overrides=[Parameter("use_sim_time", value=True)],
    )
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    until(
        lambda: node.get_clock().now().nanoseconds > 0,
        meanwhile=lambda: executor.spin_once(timeout_sec=0.05),
    )
    node.executor = None
    executor.shutdown()
    clock.seen_by = node
    yield clock, node
    node.destroy_node()
    clock.close()


@pytest.mark.chaos
def test_simulated_time_that_is_slow_leaves_a_goal_its_time(
    serve: Serve, name: str, simulated: tuple[SimulatedTime, Any], record: Record
) -> None:
    """use_sim_time at a tenth of real time; result deadline 1 s, the goal takes 2 s of real time"""
    clock, node = simulated
    clock.rate = 0.1
    journal = serve()
    leaf = MoveRobot("m", 2.0, action_name=name, timeout=Timeouts(result=1.0, feedback=1.0))
    with TreeRunner(leaf, node=node) as runner:
        assert runner.run(timeout=9.0) is Status.SUCCESS
    assert journal.ends() == ["succeeded"]
    record.outcome = "SUCCEEDED"


def test_simulated_time_that_is_paused_stops_the_deadlines(
    serve: Serve, name: str, simulated: tuple[SimulatedTime, Any], record: Record
) -> None:
    """use_sim_time, paused for 1.5 s in mid-motion; result deadline 1 s"""
    clock, node = simulated
    journal = serve()
    leaf = MoveRobot("m", 90.0, action_name=name, timeout=Timeouts(result=1.0))
    with started(leaf, node=node) as runner:
        until(lambda: state(leaf) == "EXECUTING")
        clock.rate = 0.0
        assert holds_for(lambda: leaf.outcome is None, 1.5)
        clock.rate = 1.0
        went_on = time.monotonic()
        assert runner.wait(30.0) is Status.FAILURE
        record.took(time.monotonic() - went_on, 2.0)
    assert (leaf.outcome, leaf.end) == (Outcome.RESULT_TIMEOUT, End.CANCELED)
    assert journal.ends() == ["canceled"]
    record.outcome = "held while paused, then RESULT_TIMEOUT"


@pytest.mark.parametrize("by", [-1000.0, pytest.param(-4999.0, marks=pytest.mark.chaos)])
def test_simulated_time_that_jumps_back_leaves_what_remained(
    serve: Serve, name: str, simulated: tuple[SimulatedTime, Any], by: float, record: Record
) -> None:
    """use_sim_time jumps back in mid-motion; of the result deadline, 2 s, about half remained"""
    clock, node = simulated
    journal = serve()
    leaf = MoveRobot("m", 90.0, action_name=name, timeout=Timeouts(result=2.0))
    with started(leaf, node=node) as runner:
        until(lambda: state(leaf) == "EXECUTING")
        accepted = time.monotonic()
        assert holds_for(lambda: leaf.outcome is None, 1.0)
        clock.jump(by)
        assert runner.wait(30.0) is Status.FAILURE
        took = time.monotonic() - accepted
    assert took > 1.5
    assert leaf.outcome is Outcome.RESULT_TIMEOUT
    assert journal.ends() == ["canceled"]
    record.took(took, 4.0)
    record.outcome = "RESULT_TIMEOUT when the rest had passed"


@pytest.mark.chaos
def test_simulated_time_that_jumps_ahead_by_an_hour(
    serve: Serve, name: str, simulated: tuple[SimulatedTime, Any], record: Record
) -> None:
    """use_sim_time jumps ahead by an hour; result deadline 60 s of simulated time"""
    clock, node = simulated
    journal = serve()
    leaf = MoveRobot("m", 90.0, action_name=name, timeout=60.0)
    with started(leaf, node=node) as runner:
        until(lambda: state(leaf) == "EXECUTING")
        clock.jump(3600.0)
        jumped = time.monotonic()
        assert runner.wait(30.0) is Status.FAILURE
        record.took(time.monotonic() - jumped, 2.0)
    assert (leaf.outcome, leaf.end) == (Outcome.RESULT_TIMEOUT, End.CANCELED)
    assert journal.ends() == ["canceled"]
    record.outcome = "RESULT_TIMEOUT, end CANCELED"


JUMP = """\
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static long jump(void) {
    const char *file = getenv("WALL_JUMP_FILE");
    return file && access(file, F_OK) == 0 ? atol(getenv("WALL_JUMP_SECONDS")) : 0;
}
int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int code = real(clock, now);
    if (clock == CLOCK_REALTIME) now->tv_sec += jump();
    return code;
}
int gettimeofday(struct timeval *now, void *zone) {
    struct timespec exact;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &exact);
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *out) {
    struct timespec exact;
    clock_gettime(CLOCK_REALTIME, &exact);
    if (out) *out = exact.tv_sec;
    return exact.tv_sec;
}
"""


@pytest.mark.chaos
@pytest.mark.parametrize("by", ["3600", "-3600"])
def test_a_wall_clock_that_jumps_by_an_hour_moves_no_deadline(
    by: str, launch: Launch, serve: Serve, tree: Tree, name: str, tmp_path: Path, record: Record
) -> None:
    """Its wall clock jumps so far while one goal moves, and back while one moves for too long"""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler")
    source, library, jumped = (tmp_path / each for each in ("jump.c", "jump.so", "jumped"))
    source.write_text(JUMP)
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"], check=True
    )
    journal = serve()
    path = tree(
        name,
        distance=[2.0, 60.0],
        timeout="{server: 5 s, accept: 3 s, result: 4 s, feedback: 2 s, cancel: 3 s}",
    )
    preloaded = {
        "LD_PRELOAD": str(library),
        "WALL_JUMP_FILE": str(jumped),
        "WALL_JUMP_SECONDS": by,
    }
    run = launch("run", str(path), environment=preloaded)
    run.line("executing on")
    journal.wait_for("accepted")
    jumped.touch()
    said = subprocess.run(
        [sys.executable, "-c", "import time; print(time.time())"],
        env=os.environ | preloaded,
        capture_output=True,
        check=True,
    )
    assert abs(float(said.stdout) - time.time() - float(by)) < 60.0, "the clock has jumped"
    accepted = journal.wait_for("accepted", times=2, within=PATIENCE).t
    run.line("executing on")
    jumped.unlink()
    late = journal.wait_for("cancel_requested", within=PATIENCE).t - accepted
    assert late > 3.5
    record.took(late, 5.0)
    assert run.wait() == 1, run
    assert journal.ends() == ["succeeded", "canceled"]
    assert "RESULT_TIMEOUT" in str(run)
    record.outcome = "SUCCEEDED; then RESULT_TIMEOUT, 4 s after it was accepted"


# SIGKILL, and what is left to do then


def test_cleanup_cancels_what_a_killed_orchestrator_left_and_nothing_else(
    launch: Launch,
    serve: Serve,
    tree: Tree,
    name: str,
    node: Any,
    ledger: Path,
    record: Record,
) -> None:
    """SIGKILL to the orchestrator; goals of two other clients run on the same server; cleanup"""
    from rclpy.action import ActionClient
    from robot_control_interfaces.action import MoveRobot as MoveRobotAction

    journal = serve("*:slow=10")
    run = launch("run", str(tree(name, distance=9.0)))
    run.line("executing on")
    left = journal.wait_for("accepted").goal
    somebody = ActionClient(node, MoveRobotAction, name)
    ours = MoveRobot("ours", 9.0, action_name=name)
    with started(ours, node=node):
        until(lambda: state(ours) == "EXECUTING")
        assert somebody.wait_for_server(5.0)
        somebody.send_goal_async(MoveRobotAction.Goal(distance=9.0))
        journal.wait_for("accepted", times=3)
        run.send(signal.SIGKILL)
        run.wait()
        [of_run] = [path for path in ledger.iterdir() if f"{run.pid:08x}" in path.name]
        assert on_record(of_run) == [], "it has been answered, and its server shows it"
        assert holds_for(lambda: journal.ends() == [None] * 3, 0.5)
        assert journal.count("cancel_requested") == 0, "a killed client can cancel nothing"
        received = {e.goal for e in journal.entries() if e.event == "received"}
        began = time.monotonic()
        cleanup = launch("cleanup")
        assert cleanup.wait() == 0, cleanup
        record.took(time.monotonic() - began, 15.0)
        asked = {e.goal for e in journal.entries() if e.event == "cancel_requested"}
        assert asked & received == {left}
        assert any(left in line and "CANCELED" in line for line in cleanup.lines), cleanup
        assert ours.outcome is None
        again = launch("cleanup")
        assert again.wait() == 0
        assert again.lines[-1].startswith("nothing is left to cancel on the ")
    somebody.destroy()
    assert journal.events().count("canceled") == 2, "the dead one's, and ours when we stopped"
    record.shows = "three goals live; only the dead orchestrator's was asked to cancel, and was"
    record.outcome = "cleanup: exit code 0; a second one finds nothing"


def test_a_run_says_what_a_killed_one_left_running(
    launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """SIGKILL to the orchestrator; the same tree is run again, and nobody cleans up before"""
    journal = serve("1:slow=10")
    run = launch("run", str(tree(name, distance=9.0)))
    run.line("executing on")
    left = journal.wait_for("accepted").goal
    run.send(signal.SIGKILL)
    run.wait()
    again = launch("run", str(tree(name, distance=0.5)))
    assert again.wait() == 0, again
    told = [line for line in again.errors if left in line]
    assert len(told) == 1, again
    assert f"process {run.pid}" in told[0]
    assert "`bt-actions cleanup` cancels it" in told[0]
    assert journal.ends() == [None, "succeeded"], "it is not asked to cancel, unless somebody wants"
    assert launch("cleanup").wait() == 0
    assert journal.ends() == ["canceled", "succeeded"]
    record.outcome = "the new run names the goal, and cleanup; then SUCCEEDED; then CANCELED"


@pytest.mark.chaos
def test_what_a_killed_container_left_is_found_by_its_name(
    launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """SIGKILL to an orchestrator of another machine's name; cleanup without it, and with it"""
    journal = serve("*:slow=10")
    there = {"BT_ACTIONS_MACHINE": "another container"}
    run = launch("run", str(tree(name, distance=9.0)), environment=there)
    run.line("executing on")
    journal.wait_for("accepted")
    run.send(signal.SIGKILL)
    run.wait()
    here = launch("cleanup")
    assert here.wait() == 0, here
    assert any(line.startswith("not touched: ") for line in here.errors), here
    assert here.lines[-1].startswith("nothing of this machine is left to cancel on the ")
    assert journal.ends() == [None]
    again = launch("cleanup", environment=there)
    assert again.wait() == 0, again
    assert journal.ends() == ["canceled"]
    record.shows = "asked to cancel by the second cleanup only"
    record.outcome = "named, and not touched; then canceled"


@pytest.mark.chaos
def test_cleanup_first_cancels_before_the_tree_starts(
    launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """SIGKILL to the orchestrator; then `run --cleanup-first` of the same tree"""
    journal = serve("1:slow=10")
    path = tree(name, distance=9.0)
    run = launch("run", str(path))
    run.line("executing on")
    journal.wait_for("accepted")
    run.send(signal.SIGKILL)
    run.wait()
    path = tree(name, distance=0.5)
    again = launch("run", str(path), "--cleanup-first")
    assert again.wait() == 0, again
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
    record.outcome = "the old goal CANCELED, then the new one SUCCEEDED; exit code 0"


@pytest.mark.chaos
def test_cleanup_first_waits_for_a_server_that_is_stopped(
    launch: Launch, new_host: HostFactory, tree: Tree, name: str, node: Any, record: Record
) -> None:
    """SIGKILL to the orchestrator, SIGSTOP to the server until nobody sees it; SIGCONT later"""
    host = new_host()
    journal = host.open(name, "1:slow=10")
    run = launch("run", str(tree(name, distance=9.0)))
    run.line("executing on")
    journal.wait_for("accepted")
    run.send(signal.SIGKILL)
    run.wait()
    host.send(signal.SIGSTOP)
    topic = f"{name}/_action/status"
    until(lambda: not node.get_publishers_info_by_topic(topic), 20.0, what="it is out of sight")
    again = launch("run", str(tree(name, distance=0.5)), "--cleanup-first")
    until(lambda: "waiting for" in "\n".join(again.errors), 20.0, what="it says what it waits for")
    host.send(signal.SIGCONT)
    assert again.wait(60.0) == 0, again
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
    record.outcome = "waits; the old goal CANCELED, then the new one SUCCEEDED; exit code 0"


@pytest.mark.chaos
def test_cleanup_first_runs_nothing_where_a_server_cannot_be_seen(
    launch: Launch, tree: Tree, name: str, node: Any, record: Record
) -> None:
    """`run --cleanup-first` of a tree whose server is not there, but another client of it"""
    MoveRobot("somebody", 1.0, action_name=name).setup(node=node)
    run = launch("run", str(tree(name, distance=0.5)), "--cleanup-first")
    assert run.wait(60.0) == 3, run
    assert f"no server of {name} answers" in "\n".join(run.errors)
    record.outcome = "nothing is run; exit code 3"


@pytest.mark.chaos
def test_cleanup_that_was_stopped_looks_again(
    launch: Launch, new_host: HostFactory, tree: Tree, name: str, node: Any, record: Record
) -> None:
    """SIGKILL to the orchestrator; SIGSTOP to cleanup for all of its look; SIGCONT"""
    journal = new_host(short_lease=False).open(name)
    run = launch("run", str(tree(name, distance=90.0)))
    run.line("executing on")
    run.send(signal.SIGKILL)
    run.wait()
    cleanup = launch("cleanup")
    until(lambda: "bt_actions_cleanup" in node.get_node_names(), within=20.0)
    cleanup.send(signal.SIGSTOP)
    holds_for(lambda: True, 6.0)
    cleanup.send(signal.SIGCONT)
    assert cleanup.wait(60.0) == 0, cleanup
    assert journal.ends() == ["canceled"], cleanup
    record.outcome = "cleanup: CANCELED, exit code 0"


@pytest.mark.chaos
def test_cleanup_waits_for_a_server_that_is_stopped_when_it_comes_in_sight(
    launch: Launch,
    new_host: HostFactory,
    tree: Tree,
    name: str,
    domain: int,
    record: Record,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """SIGKILL to the orchestrator; SIGSTOP to the server when cleanup sees it; SIGCONT after 8 s"""
    from bt_actions.recovery.sweep import Cleanup
    from bt_actions.ros import onlooker

    host = new_host(short_lease=False)
    journal = host.open(name)
    run = launch("run", str(tree(name, distance=90.0)))
    run.line("executing on")
    run.send(signal.SIGKILL)
    run.wait()
    goes_on = threading.Timer(8.0, lambda: host.send(signal.SIGCONT))
    real = onlooker.servers

    def seen(node: Any, action: str) -> frozenset[bytes]:
        shown = real(node, action)
        if action == name and shown and goes_on.ident is None:
            host.send(signal.SIGSTOP)
            goes_on.start()
        return shown

    monkeypatch.setattr(onlooker, "servers", seen)
    left = Cleanup(look=3.0).run().left
    goes_on.join()
    assert [(goal.call.action, goal.end) for goal in left] == [(name, End.CANCELED)]
    assert journal.ends() == ["canceled"]
    record.outcome = "CANCELED"


@pytest.mark.chaos
def test_cleanup_finds_what_an_orchestrator_leaves_that_dies_meanwhile(
    launch: Launch, serve: Serve, tree: Tree, name: str, domain: int, node: Any, record: Record
) -> None:
    """SIGKILL to the orchestrator while cleanup looks, and has seen its goal"""
    from bt_actions.recovery.roll_call import LeftBehind
    from bt_actions.recovery.sweep import Cleanup

    journal = serve("1:slow=10")
    run = launch("run", str(tree(name, distance=9.0)))
    run.line("executing on")
    goal = journal.wait_for("accepted").goal
    left = list[LeftBehind]()
    sweeps = threading.Thread(target=lambda: left.extend(Cleanup(look=8.0).run().left))
    sweeps.start()
    until(lambda: "bt_actions_cleanup" in node.get_node_names(), within=6.0)
    asked = ("cancel_requested", goal)  # nobody's goals, which show that a server lives, are too
    assert holds_for(
        lambda: asked not in [(str(e.event), e.goal) for e in journal.entries()], 3.0
    ), "its author is alive"
    run.send(signal.SIGKILL)
    run.wait()
    sweeps.join()
    assert [(goal.call.action, goal.end) for goal in left] == [(name, End.CANCELED)]
    record.outcome = "CANCELED"


@pytest.mark.chaos
def test_a_stopped_orchestrator_takes_up_its_work_again(
    launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """SIGSTOP to the orchestrator until its goal is done and its deadline over, then SIGCONT"""
    journal = serve()
    path = tree(
        name,
        distance=[1.5, 0.5],
        timeout="{server: 5 s, accept: 3 s, result: 2 s, feedback: 1 s, cancel: 3 s}",
    )
    run = launch("run", str(path))
    run.line("executing on")
    run.send(signal.SIGSTOP)
    journal.wait_for("succeeded")
    done = time.monotonic()
    assert holds_for(lambda: True, 1.0)
    run.send(signal.SIGCONT)
    assert run.wait() == 0, run
    record.took(time.monotonic() - done, 6.0)
    assert journal.ends() == ["succeeded"] * 2
    record.outcome = "both SUCCEEDED, exit code 0"


STOPPED: dict[str, tuple[float, str | None, float, str]] = {
    "feedback": (5.0, None, 2.0, "result: 60 s, feedback: 1 s"),
    "accept": (2.0, "1:delay_accept=0.6", 2.0, "result: 60 s, accept: 1 s"),
    "result": (2.0, None, 3.0, "result: 3 s"),
    "lease": (8.0, None, 4.5, "result: 60 s"),
}
"""By what passes meanwhile: metres, a fault, seconds of SIGSTOP, deadlines."""


@pytest.mark.parametrize(
    "passed",
    ["feedback", *(pytest.param(each, marks=pytest.mark.chaos) for each in [*STOPPED][1:])],
)
def test_an_orchestrator_that_was_stopped_leaves_a_goal_alone_that_is_well(
    launch: Launch, serve: Serve, tree: Tree, name: str, passed: str, record: Record
) -> None:
    """SIGSTOP to the orchestrator until this deadline, or the server's lease, is over; SIGCONT"""
    distance, fault, stopped, timeout = STOPPED[passed]
    journal = serve(*[fault] if fault else [])
    run = launch("run", str(tree(name, distance=distance, timeout=f"{{{timeout}}}")), "--verbose")
    if passed == "accept":
        run.line("sending a goal to")
        journal.wait_for("received")
    else:
        run.line("executing on")
        holds_for(lambda: True, 1.0)  # feedback comes, and leases are known
    run.send(signal.SIGSTOP)
    holds_for(lambda: True, stopped)
    run.send(signal.SIGCONT)
    assert run.wait() == 0, run
    assert "late" not in str(run)
    assert journal.events() == ["received", "accepted", "succeeded"]
    record.outcome = "SUCCEEDED, not late; exit code 0"


@pytest.mark.chaos
def test_a_server_that_opens_while_the_orchestrator_is_stopped_is_seen(
    launch: Launch, serve: Serve, tree: Tree, name: str, record: Record
) -> None:
    """SIGSTOP to the orchestrator while the server opens and timeout.server passes; SIGCONT"""
    path = tree(name, distance=1.0, timeout="{server: 1 s, result: 60 s}")
    run = launch("run", str(path), "--verbose")
    run.line("waiting for the server")
    run.send(signal.SIGSTOP)
    began = time.monotonic()
    journal = serve()
    holds_for(lambda: True, began + 1.9 - time.monotonic())
    run.send(signal.SIGCONT)
    assert run.wait() == 0, run
    assert journal.events() == ["received", "accepted", "succeeded"]
    record.outcome = "SUCCEEDED, exit code 0"


@pytest.mark.chaos
@pytest.mark.parametrize("result", ["comes", "is lost"])
def test_a_drain_that_was_stopped_takes_in_what_came_meanwhile(
    launch: Launch, serve: Serve, tree: Tree, name: str, result: str, record: Record
) -> None:
    """SIGTERM, and SIGSTOP until the goal is canceled and the drain's deadline over; SIGCONT"""
    journal = serve("1:delay_cancel=1", *["1:drop_result=1000"] * (result == "is lost"))
    run = launch("run", str(tree(name)))
    run.line("executing on")
    run.send(signal.SIGTERM)
    journal.wait_for("cancel_requested")
    run.send(signal.SIGSTOP)
    journal.wait_for("canceled")
    holds_for(lambda: True, CANCEL + 2.0)
    run.send(signal.SIGCONT)
    assert run.wait() == 128 + signal.SIGTERM, run  # and not 3
    record.outcome = "the goal's end is known; exit code 143"


# The rest of the machine


def test_a_full_disk_under_the_log_does_not_stop_the_robot(
    launch: Launch, serve: Serve, tree: Tree, name: str, tmp_path: Path, record: Record
) -> None:
    """ROS_LOG_DIR is on a file system without room; the goal is rejected once and tried again"""
    full = tmp_path / "full"
    full.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=4k,mode=777", "tmpfs", str(full)]
    fill = (
        "import os, subprocess, sys\n"
        f"subprocess.run({mount!r}, check=True)\n"
        f"open({str(full / 'filler')!r}, 'wb').write(bytes(4096))\n"
        "os.execv(sys.argv[1], sys.argv[1:])\n"
    )
    in_it = ["unshare", "--mount", sys.executable, "-c", fill]
    if (
        shutil.which("unshare") is None
        or subprocess.run([*in_it, "/bin/true"], capture_output=True, check=False).returncode
    ):
        pytest.skip("needs the right to mount")
    journal = serve("1:reject")
    path = tree(name, distance=0.5, retry="2")
    run = launch("run", str(path), prefix=in_it, environment={"ROS_LOG_DIR": str(full)})
    assert run.wait() == 0, run
    assert journal.ends() == ["rejected", "succeeded"]
    record.outcome = "REJECTED, then SUCCEEDED; exit code 0"


@pytest.mark.chaos
def test_output_into_who_has_read_enough_ends_the_run_and_its_goal(
    serve: Serve, tree: Tree, name: str, no_leaks: None, record: Record
) -> None:
    """`bt-actions run TREE | sed '/executing on/q'`, which leaves in mid-motion"""
    journal = serve("*:slow=10")
    command = [sys.executable, "-m", "bt_actions.cli", "run", str(tree(name, distance=9.0))]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT)
    assert run.stdout is not None
    assert run.stderr is not None
    sed = subprocess.run(
        ["sed", "/executing on/q"],
        stdin=run.stdout,
        capture_output=True,
        timeout=PATIENCE,
        check=True,
    )
    run.stdout.close()
    closed = time.monotonic()
    assert run.wait(PATIENCE) == 141
    record.took(time.monotonic() - closed, 5.0)
    assert b"executing on" in sed.stdout.splitlines()[-1]
    assert run.stderr.read() == b""
    run.stderr.close()
    assert journal.ends() == ["canceled"]
    record.outcome = "CANCELED, exit code 141"
