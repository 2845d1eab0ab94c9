"""Our leaves in a user's node, executor and loop, which end in every way there is.

The programs are those of tests/support/foreign.py, each a process of its own.
Whatever they do, the server's journal shows that the goal was canceled, and only once executed.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import py_trees
import pytest
from py_trees.common import Status

from bt_actions import End, MoveRobot, Outcome, Timeouts, TreeRunner
from bt_actions.ros.host import host as process
from bt_actions.servers.presence import Server
from bt_actions.traffic.admission import IN_FLIGHT
from bt_actions.traffic.watcher import look
from tests.support.foreign import PROGRAMS
from tests.support.processes import PATIENCE, Host, Journal, Process
from tests.support.reliability import Record, first_paragraph
from tests.support.trees import started, state, together
from tests.support.waiting import holds_for, until

END_BY_THEMSELVES = [
    "shut_down_and_destroy_on_the_next_line",
    "destroy_while_another_thread_spins",
    "shut_down_in_a_timer",
    "shut_down_in_a_timer_of_a_multithreaded_executor",
    "tick_tock",
    "shut_down_by_the_context",
    "never_shut_down",
    "just_end",
    "end_with_a_spinning_daemon_thread",
    "crash",
    "crash_in_a_timer",
    "exit_in_a_timer",
    "crash_beside_a_runner",
    "end_beside_a_runner",
]
TELL = END_BY_THEMSELVES[:6]
CODES = {
    "crash": {1},
    "crash_in_a_timer": {1},
    "exit_in_a_timer": {7},
    "crash_beside_a_runner": {1},
}
# rclpy 7.1 aborts the process that ends beside a daemon thread in spin(), with or without us.
CODES["end_with_a_spinning_daemon_thread"] = {0, -signal.SIGABRT}
# Its MultiThreadedExecutor.spin() may raise RCLError where another thread shuts the context down.
CODES["shut_down_in_a_timer_of_a_multithreaded_executor"] = {0, 1}
END_BY_A_SIGNAL = [
    "loop_until_a_signal",
    "spin_until_a_signal",
    "spin_until_a_signal_and_clean_up",
    "tick_tock_until_a_signal",
]
RUNNERS = {"wait_for_a_runner": "TERM", "run_and_clean_up": "INT"}
"""And the signal for each; they have a context of their own, without rclpy's signal handlers."""
ALWAYS = {
    "never_shut_down",
    "just_end",
    "crash_in_a_timer",
    "crash_beside_a_runner",
    ("loop_until_a_signal", "INT"),
    ("spin_until_a_signal_and_clean_up", "TERM"),
    ("run_and_clean_up", "INT"),
}
"""One of a kind that runs in every `make test`."""
CRASHED = {-signal.SIGSEGV, -signal.SIGABRT, -signal.SIGBUS}


@dataclass
class Program:
    process: Process
    journal: Journal


@pytest.fixture
def program(session_host: Host, record: Record) -> Iterator[Callable[..., Program]]:
    """Start one of the programs, of which the report then tells."""
    with contextlib.ExitStack() as stack:

        def start(name: str, number: str = "") -> Program:
            action = f"/f{os.getpid()}_{name}_{number}/move"
            faults = ["1:reject_cancel"] if name == "just_end_soon" else []
            journal = session_host.open(action, *faults, step_period=0.25)
            process = Process(["-m", "tests.support.foreign", name, action])
            stack.callback(process.close)
            stack.callback(session_host.close_server, action)
            record.did = first_paragraph(PROGRAMS[name].__doc__)
            record.did += f"; SIG{number}" if number else ""
            record.journals.append(journal)
            return Program(process, journal)

        yield start


def case(*values: str) -> Any:
    """The values of a test's parameters, of which most are for `make chaos` only."""
    often = (values if len(values) > 1 else values[0]) in ALWAYS
    return pytest.param(*values, marks=() if often else pytest.mark.chaos)


def ended(code: int) -> str:
    """How a process ended, in words."""
    return f"exit code {code}" if code >= 0 else f"ended by {signal.Signals(-code).name}"


@pytest.mark.parametrize("name", [case(name) for name in END_BY_THEMSELVES])
def test_a_program_that_ends_leaves_no_goal(
    program: Callable[..., Program], name: str, record: Record
) -> None:
    taken = program(name)
    process, journal = taken.process, taken.journal
    process.line("executing", within=60.0)
    if name in TELL:
        assert process.line("end") == "end CANCELED CANCELED", process
    code = process.wait()
    assert journal.ends() == ["canceled"], process
    assert journal.events().count("cancel_requested") >= 1
    assert code in CODES.get(name, {0}), process
    assert "Traceback" not in str(process) or name.startswith("crash")
    record.outcome = f"canceled; {ended(code)}"


@pytest.mark.parametrize(
    ("name", "number"), [case(name, to) for name in END_BY_A_SIGNAL for to in ("INT", "TERM")]
)
def test_a_program_that_rclpys_signal_handlers_end_leaves_no_goal(
    program: Callable[..., Program], name: str, number: str, record: Record
) -> None:
    taken = program(name, number)
    process, journal = taken.process, taken.journal
    process.line("executing", within=60.0)
    sent = process.send(signal.Signals[f"SIG{number}"])
    journal.wait_for("canceled", within=10.0)
    record.took(time.monotonic() - sent)
    code = process.wait()
    assert time.monotonic() - sent < PATIENCE
    assert code not in CRASHED, process
    assert journal.ends() == ["canceled"], process
    record.outcome = f"canceled; {ended(code)}"


@pytest.mark.parametrize(("name", "number"), [case(*each) for each in RUNNERS.items()])
def test_a_runner_in_a_program_that_is_interrupted_leaves_no_goal(
    program: Callable[..., Program], name: str, number: str, record: Record
) -> None:
    taken = program(name, number)
    process, journal = taken.process, taken.journal
    process.line("executing", within=60.0)
    sent = process.send(signal.Signals[f"SIG{number}"])
    code = process.wait()
    record.took(time.monotonic() - sent)
    assert code in (128 + signal.Signals[f"SIG{number}"], -signal.Signals[f"SIG{number}"]), process
    assert journal.ends() == ["canceled"], process
    record.outcome = f"canceled; {ended(code)}"


def test_a_program_may_just_succeed(program: Callable[..., Program], record: Record) -> None:
    taken = program("tick_in_a_timer_until_done")
    assert taken.process.line("end") == "end SUCCEEDED SUCCEEDED"
    assert taken.process.wait() == 0, taken.process
    assert taken.journal.events() == ["received", "accepted", "succeeded"]
    assert taken.process.errors == []
    record.outcome = "SUCCEEDED; exit code 0"


def test_a_goal_that_cannot_be_canceled_at_exit_is_reported(
    program: Callable[..., Program], record: Record
) -> None:
    taken = program("just_end_soon")
    taken.process.line("executing", within=60.0)
    assert taken.process.wait() == 0
    assert str(taken.process).count("not accounted for: ") == 1
    assert taken.journal.ends() == [None]
    record.outcome = "named on standard error; exit code 0"


# In this process


@pytest.fixture
def journal(host: Host, name: str) -> Iterator[Journal]:
    """A server without faults, and what it writes."""
    yield host.open(name)
    host.close_server(name)


def test_setup_twice_for_the_same_node_is_fine(
    journal: Journal, name: str, node: Any, spin: Any
) -> None:
    """setup() twice before the goal and once after it; shutdown() twice"""
    leaf = MoveRobot("m", 0.1, action_name=name)
    tree = py_trees.trees.BehaviourTree(leaf)
    tree.setup(node=node)
    tree.setup(node=node)
    until(lambda: leaf.status is Status.SUCCESS, meanwhile=lambda: (spin(), tree.tick()))
    tree.setup(node=node)
    tree.shutdown()
    tree.shutdown()
    assert journal.ends() == ["succeeded"]


def test_setup_again_after_shutdown_is_fine(
    journal: Journal, name: str, node: Any, spin: Any
) -> None:
    """shutdown() in mid-goal; setup() and ticks again"""
    leaf = MoveRobot("m", 0.5, action_name=name)
    tree = py_trees.trees.BehaviourTree(leaf)
    tree.setup(node=node)
    until(lambda: state(leaf) == "EXECUTING", meanwhile=lambda: (spin(), tree.tick()))
    tree.shutdown()
    assert journal.ends() == ["canceled"]
    tree.setup(node=node)
    until(lambda: leaf.status is Status.SUCCESS, meanwhile=lambda: (spin(), tree.tick()))
    tree.shutdown()
    assert journal.ends() == ["canceled", "succeeded"]
    assert leaf.outcome is Outcome.SUCCEEDED
    assert [record.attempt for record in leaf.history] == [1]


@pytest.mark.parametrize(
    "accept",
    [
        pytest.param(5.0, id="in time", marks=pytest.mark.chaos),
        pytest.param(0.5, id="unconfirmed"),
    ],
)
def test_a_goal_left_behind_by_a_visit_before_is_drained_too(
    host: Host, name: str, node: Any, spin: Any, accept: float
) -> None:
    """Interrupted before it is accepted, 2 s late; visited again; shutdown(); accept deadline 5 s
    ("unconfirmed": 0.5 s)"""
    journal = host.open(name, "1:delay_accept=2")
    leaf = MoveRobot("m", 9.0, action_name=name, timeout=Timeouts(accept=accept))
    tree = py_trees.trees.BehaviourTree(leaf)
    tree.setup(node=node)
    until(lambda: state(leaf) == "SENDING", meanwhile=lambda: (spin(), tree.tick()))
    journal.wait_for("received")
    leaf.stop(Status.INVALID)
    tree.tick()
    leaf.stop(Status.INVALID)
    assert not leaf.drained
    tree.shutdown()
    assert leaf.drained
    assert journal.ends() == ["canceled"]
    host.close_server(name)


@pytest.mark.parametrize(
    "queued",
    [
        pytest.param(False, id="afterwards", marks=pytest.mark.chaos),
        pytest.param(True, id="in the queue"),
    ],
)
def test_what_a_runner_leaves_is_waited_for_by_another(
    host: Host, name: str, domain: int, queued: bool, record: Record
) -> None:
    """A goal that refuses to be canceled; its runner is shut down; another runner of the process"""
    journal = host.open(name, "1:reject_cancel")
    first = MoveRobot("first", 4.0, action_name=name, timeout=Timeouts(result=0.5, cancel=0.5))
    second = MoveRobot("second", 0.3, action_name=name, timeout=Timeouts(queue=30.0, server=30.0))
    runner, other = TreeRunner(first), TreeRunner(second)
    runner.start()
    until(lambda: state(first) == "EXECUTING")
    if queued:
        other.start()
    assert runner.wait(9.0) is Status.FAILURE
    assert (first.outcome, first.end) == (Outcome.RESULT_TIMEOUT, End.UNKNOWN)
    assert queued == (state(second) == "QUEUED")
    runner.shutdown()
    assert journal.ends() == [None]
    if not queued:
        other.start()
    assert other.wait(30.0) is Status.SUCCESS
    other.shutdown()
    assert journal.ends() == ["succeeded", "succeeded"]
    assert journal.max_live == 1
    assert first.end is End.SUCCEEDED
    host.close_server(name)
    record.outcome = "UNKNOWN; the other runner sent only when it had ended"


def test_the_child_of_a_fork_sees_to_none_of_its_parents_goals(
    host: Host, name: str, node: Any, record: Record
) -> None:
    """os.fork() beside a running goal, while another thread has the one lock"""
    journal = host.open(name)
    leaf = MoveRobot("m", 9.0, action_name=name)
    held, over = threading.Event(), threading.Event()

    def hold() -> None:
        with process.lock:
            held.set()
            over.wait(9.0)

    with started(leaf, node=node):
        until(lambda: state(leaf) == "EXECUTING")
        holder = threading.Thread(target=hold)
        holder.start()
        held.wait(9.0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of a fork beside threads
            pid = os.fork()
        if pid == 0:
            sees_to_nothing = (
                process.lock.acquire(timeout=5.0)
                and not process.scheduler.scheduled
                and not process.domains
            )
            os._exit(0 if sees_to_nothing else 1)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
        over.set()
        holder.join()
        assert process.scheduler.scheduled
    assert journal.ends() == ["canceled"]
    host.close_server(name)
    record.outcome = "CANCELED by the parent; its child knows no goal and gets the lock"


@pytest.mark.chaos
def test_an_interrupt_of_the_last_drain_still_says_which_goal_is_left(
    host: Host, name: str, node: Any, spin: Any, monkeypatch: pytest.MonkeyPatch, record: Record
) -> None:
    """The exit hook's wait for a goal that cannot be canceled is replaced by a KeyboardInterrupt"""
    from bt_actions.ros import exit as exit_hook

    said: list[str] = []

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    host.open(name, "1:reject_cancel")
    leaf = MoveRobot("m", 9.0, action_name=name)
    leaf.setup(node=node)
    until(lambda: state(leaf) == "EXECUTING", meanwhile=lambda: (spin(), leaf.tick_once()))
    with monkeypatch.context() as patch:
        patch.setattr(exit_hook.host, "closing", False)
        patch.setattr(exit_hook, "drain", interrupted)
        patch.setattr(exit_hook.log, "error", said.append)
        exit_hook.close_process()
    [line] = said
    assert line.startswith("not accounted for: m on ")
    host.cancel_all(name)
    leaf.shutdown()
    host.close_server(name)
    record.outcome = "named in the log as not accounted for"


def test_a_tick_after_shutdown_says_what_is_wrong(
    journal: Journal, name: str, node: Any, spin: Any, record: Record
) -> None:
    """shutdown() in mid-goal and one more tick, as a timer of the user's goes on"""
    leaf = MoveRobot("m", 5.0, action_name=name)
    tree = py_trees.trees.BehaviourTree(leaf)
    tree.setup(node=node)
    until(lambda: state(leaf) == "EXECUTING", meanwhile=lambda: (spin(), tree.tick()))
    tree.shutdown()
    with pytest.raises(RuntimeError, match="setup"):
        tree.tick()
    assert journal.ends() == ["canceled"]
    record.outcome = "CANCELED; RuntimeError, which names setup()"


def test_the_deadline_of_shutdown_is_one_for_all_goals(
    host: Host, name: str, node: Any, spin: Any, record: Record
) -> None:
    """shutdown() in mid-goal of five servers that refuse to cancel; cancel deadlines of 2 s"""
    names = [f"{name}_{number}" for number in range(5)]
    for each in names:
        host.open(each, "1:reject_cancel")
    leaves = [
        MoveRobot(each.rpartition("/")[2], 9.0, action_name=each, timeout=Timeouts(cancel=2.0))
        for each in names
    ]
    tree = py_trees.trees.BehaviourTree(together(*leaves))
    tree.setup(node=node)
    until(
        lambda: all(state(leaf) == "EXECUTING" for leaf in leaves),
        meanwhile=lambda: (spin(), tree.tick()),
    )
    started = time.monotonic()
    tree.shutdown()
    took = time.monotonic() - started
    assert took < 7.0
    record.took(took)
    assert {(leaf.outcome, leaf.end) for leaf in leaves} == {(Outcome.CANCELED, End.UNKNOWN)}
    record.outcome = "all CANCELED, end UNKNOWN"
    for each in names:
        host.close_server(each)


def test_shutdown_while_the_acceptance_is_open(
    host: Host, name: str, node: Any, spin: Any, record: Record
) -> None:
    """shutdown() when the server has received the goal, which it accepts 0.7 s late"""
    journal = host.open(name, "1:delay_accept=0.7")
    leaf = MoveRobot("m", 5.0, action_name=name)
    tree = py_trees.trees.BehaviourTree(leaf)
    tree.setup(node=node)
    until(lambda: journal.count("received"), meanwhile=lambda: (spin(), tree.tick()))
    began = time.monotonic()
    tree.shutdown()
    record.took(time.monotonic() - began)
    assert journal.ends() == ["canceled"]
    assert (leaf.outcome, leaf.end) == (Outcome.CANCELED, End.CANCELED)
    host.close_server(name)


def test_two_trees_with_the_same_names_never_have_two_goals_live(
    journal: Journal, name: str, context: Any, node: Any, spin: Any
) -> None:
    """Four trees that are ticked in turn, two on each of two nodes, with one action"""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    other = Node("tests", context=context, namespace="/other")
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(other)
    leaves = [MoveRobot("m", 0.2, action_name=name) for _ in range(4)]
    trees = [py_trees.trees.BehaviourTree(together(leaf, name="root")) for leaf in leaves]
    for number, tree in enumerate(trees):
        tree.setup(node=other if number % 2 else node)

    def step() -> None:
        spin()
        executor.spin_once(timeout_sec=0.005)
        for tree in trees:
            if tree.root.status is not Status.SUCCESS:
                tree.tick()

    until(lambda: all(tree.root.status is Status.SUCCESS for tree in trees), meanwhile=step)
    assert journal.max_live == 1
    assert journal.ends() == ["succeeded"] * 4
    for tree in trees:
        tree.shutdown()
    executor.shutdown()
    other.destroy_node()


@pytest.mark.parametrize("busy", ["wait", "share"])
def test_an_action_shared_by_twenty_leaves(
    journal: Journal, name: str, node: Any, spin: Any, busy: str
) -> None:
    """Twenty leaves of a parallel: twice what the queue of the server's service holds"""
    leaves = [MoveRobot(f"m{i}", 0.05, action_name=name, busy=busy) for i in range(20)]
    tree = py_trees.trees.BehaviourTree(together(*leaves))
    tree.setup(node=node)
    until(
        lambda: tree.root.status is not Status.RUNNING,
        9.0,
        meanwhile=lambda: (tree.tick(), spin()),
    )
    assert [leaf.outcome for leaf in leaves] == [Outcome.SUCCEEDED] * 20
    assert journal.ends() == ["succeeded"] * 20
    assert journal.executed_twice == []
    assert (journal.max_live == 1) == (busy == "wait")
    tree.shutdown()


def test_a_server_that_is_stopped_is_sent_no_more_than_its_queue_holds_by_all_nodes(
    host: Host, name: str, node: Any
) -> None:
    """Sixteen goals of two runners; SIGSTOP before they are sent, SIGCONT afterwards"""
    journal = host.open(name)
    patient = Timeouts(server=20.0, accept=20.0, queue=20.0)
    leaves = [
        MoveRobot(f"m{i}", 0.05, action_name=name, busy="share", timeout=patient) for i in range(16)
    ]
    trees = [together(*leaves[:8]), together(*leaves[8:])]

    def sees(leaf: MoveRobot) -> bool:
        with process.lock:
            assert leaf._own is not None
            return look(leaf._own, time.monotonic()) is Server.READY

    def count(what: str) -> int:
        return [state(leaf) for leaf in leaves].count(what)

    with TreeRunner(trees[0], node=node) as one, TreeRunner(trees[1]) as other:
        for leaf in leaves:
            leaf.setup(node=(one if leaf in leaves[:8] else other).node)
        until(lambda: sees(leaves[0]) and sees(leaves[-1]))
        host.send(signal.SIGSTOP)
        try:
            one.start()
            other.start()
            full = lambda: (count("SENDING"), count("WAITING_FOR_SERVER")) == (IN_FLIGHT, 8)  # noqa: E731
            until(full)
            assert holds_for(full, 0.3)
        finally:
            host.send(signal.SIGCONT)
        assert one.wait(20.0) is other.wait(20.0) is Status.SUCCESS
    assert journal.ends() == ["succeeded"] * 16
    assert journal.executed_twice == []


def test_nobody_ticks_any_more_and_the_goal_is_drained_by_its_deadline(
    journal: Journal, name: str, node: Any, spin: Any
) -> None:
    """The ticks end in mid-goal, while the node is spun; result deadline 0.4 s"""
    leaf = MoveRobot("m", 9.0, action_name=name, timeout=0.4)
    leaf.setup(node=node)
    until(lambda: state(leaf) == "EXECUTING", meanwhile=lambda: (spin(), leaf.tick_once()))
    until(lambda: journal.ends() == ["canceled"], meanwhile=spin)
    until(lambda: leaf.end is End.CANCELED, meanwhile=spin)
    leaf.tick_once()
    assert (leaf.status, leaf.outcome) == (Status.FAILURE, Outcome.RESULT_TIMEOUT)
    leaf.shutdown()
