"""The answers: a flood of feedback, strangers' messages, answers for an older attempt.

What a server can do wrong with a single goal is in tests/ros/test_outcomes.py; this is the rest.
"""

from __future__ import annotations

import gc
import signal
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import py_trees
import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot as MoveRobotAction

from bt_actions import End, MoveRobot, Outcome, Retry, Timeouts, TreeRunner
from bt_actions.simulation.journal import live_intervals
from tests.support.processes import HostFactory, Journal, Process
from tests.support.reliability import Record
from tests.support.trees import Gate, state, together
from tests.support.waiting import until

Serve = Callable[..., Journal]

LATEST = 2.0
"""Seconds between two ticks for 95 of 100, and at most, on two cores that serve the flood too."""
FLAT = 4.0
"""MB by which memory may differ in a flood: of 1,000 messages a second, none are kept."""


class Metronome(py_trees.behaviour.Behaviour):
    """Notes how long after the one before each tick comes."""

    def __init__(self) -> None:
        super().__init__("metronome")
        self.pauses: list[float] = []
        self._before: float | None = None

    def update(self) -> Status:
        now = time.monotonic()
        if self._before is not None:
            self.pauses.append(now - self._before)
        self._before = now
        return Status.RUNNING


def resident() -> float:
    """The memory of this process in MB."""
    gc.collect()
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024.0


@pytest.mark.parametrize(
    ("seconds", "reads"),
    [
        (2.0, True),
        pytest.param(9.9, True, marks=pytest.mark.chaos),
        pytest.param(9.9, False, marks=pytest.mark.chaos),
    ],
)
def test_a_flood_of_feedback(
    serve: Serve, name: str, node: Any, seconds: float, reads: bool, record: Record
) -> None:
    """Feedback at 1 kHz for so many seconds, read by the tree (True) or not; heartbeat 20 ms"""
    serve("1:flood=1000")
    heard: list[float] = []

    def read(feedback: MoveRobotAction.Feedback) -> None:
        heard[:] = [*heard[-1:], feedback.current_pose]

    timeouts = Timeouts(feedback=5.0, result=60.0)
    leaf = MoveRobot(
        "m", seconds, action_name=name, timeout=timeouts, on_feedback=read if reads else None
    )
    metronome = Metronome()
    root = together(leaf, metronome)
    with TreeRunner(root, node=node, heartbeat=0.02) as runner:
        runner.start()
        until(lambda: leaf.progress().feedback is not None, 10.0)
        metronome.pauses.clear()
        warm = resident()
        until(lambda: leaf.outcome, seconds + 20.0, what="the end of the flood")
        grown = resident() - warm
        pauses = sorted(metronome.pauses)
        runner.interrupt()
        runner.wait(5.0)
    assert leaf.outcome is Outcome.SUCCEEDED
    assert pauses[-1] < LATEST * record.leniency
    assert grown < FLAT
    assert not reads or heard
    record.outcome = f"SUCCEEDED; no tick later than {LATEST:g} s, memory within {FLAT:g} MB"


class Stranger:
    """Publishes and answers what nobody asked for, beside the server, at 200 Hz."""

    def __init__(self, context: Any, name: str) -> None:
        from action_msgs.msg import GoalStatus, GoalStatusArray
        from rclpy.node import Node
        from unique_identifier_msgs.msg import UUID

        self.known = b""
        self._node = Node("stranger", context=context)
        self._feedback_type = MoveRobotAction.Impl.FeedbackMessage
        self._uuid, self._status, self._array = UUID, GoalStatus, GoalStatusArray
        self._feedback = self._node.create_publisher(
            self._feedback_type, f"{name}/_action/feedback", 10
        )
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._talk)
        self._thread.start()

    def _talk(self) -> None:
        while not self._over.wait(0.005):
            for goal_id in (uuid.uuid4().bytes, self.known or uuid.uuid4().bytes):
                message = self._feedback_type()
                message.goal_id = self._uuid(uuid=list(goal_id))
                message.feedback.current_pose = -1.0
                self._feedback.publish(message)
                self._feedback.publish(message)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._node.destroy_node()


def test_feedback_of_unknown_and_finished_goals_means_nothing(
    serve: Serve, name: str, node: Any, context: Any, record: Record
) -> None:
    """Feedback for random ids and for the goal before, each twice, at 200 Hz beside the server's"""
    journal = serve()
    stranger = Stranger(context, name)
    heard: list[float] = []
    first = MoveRobot("first", 0.2, action_name=name)
    second = MoveRobot(
        "second", 1.0, action_name=name, on_feedback=lambda each: heard.append(each.current_pose)
    )
    try:
        with TreeRunner(first, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
        stranger.known = bytes.fromhex(first.history[0].goal_id)
        with TreeRunner(second, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
    finally:
        stranger.close()
    assert journal.ends() == ["succeeded"] * 2
    assert heard
    assert min(heard) >= 0.0, "a stranger's feedback reached the tree"
    assert first.end is End.SUCCEEDED
    record.outcome = "both SUCCEEDED; none of it reached the tree"


@pytest.mark.parametrize("late", [0.6, pytest.param(1.5, marks=pytest.mark.chaos)])
def test_late_answers_of_an_older_attempt_do_not_touch_the_newer(
    serve: Serve, name: str, node: Any, late: float, record: Record
) -> None:
    """The first try is accepted so many seconds late; accept deadline 0.4 s, which is retried"""
    journal = serve(f"1:delay_accept={late}")
    leaf = MoveRobot(
        "m",
        1.0,
        action_name=name,
        timeout=Timeouts(accept=0.4, cancel=5.0),
        retry=Retry(2, outcomes=frozenset({Outcome.ACCEPT_TIMEOUT})),
    )
    with TreeRunner(leaf, node=node) as runner:
        assert runner.run(timeout=15.0) is Status.SUCCESS
        assert runner.unaccounted == []
        until(lambda: None not in journal.ends(), what="every goal has ended on the server")
    assert journal.ends() == ["canceled", "succeeded"]
    first = live_intervals(journal.entries())[0 if late < 1.0 else 1]
    assert first.end is not None
    assert first.end - first.start < 0.5, "canceled at once"
    if late < 2 * 0.4:  # later than that, the server had denied the goal, and the retry went on
        assert journal.max_live == 1
    told = ", then ".join(f"{each.outcome}, end {each.end}" for each in leaf.history)
    record.outcome = f"{told}; the late one was canceled at once"


@pytest.mark.chaos
def test_a_result_that_is_late_comes_after_a_newer_goal_of_the_same_leaf(
    serve: Serve, name: str, node: Any, record: Record
) -> None:
    """The result of a goal comes 2 s after its end; meanwhile the tree wants another one"""
    journal = serve("1:delay_result=2")
    gate = Gate()
    leaf = MoveRobot("m", 0.3, action_name=name)
    again = MoveRobot("again", 0.3, action_name=name, timeout=Timeouts(queue=10.0))
    with TreeRunner(together(leaf, gate), node=node) as runner:
        runner.start()
        journal.wait_for("succeeded")
        runner.interrupt()
        runner.wait(9.0)
        assert runner.unaccounted == []
    with TreeRunner(again, node=node) as runner:
        assert runner.run(timeout=15.0) is Status.SUCCESS
    assert journal.ends() == ["succeeded"] * 2
    assert (leaf.outcome, leaf.end) == (Outcome.CANCELED, End.SUCCEEDED)
    assert journal.max_live == 1
    record.outcome = "CANCELED, end SUCCEEDED; then SUCCEEDED"


@pytest.mark.chaos
@pytest.mark.parametrize(
    "fault",
    [
        "*:reject_cancel",
        "*:drop_cancel",
        "*:ignore_cancel",
        "*:succeed_on_cancel",
        "*:abort_on_cancel",
        "*:drop_accept",
        "*:drop_result=1",
        "*:delay_result=0.5",
    ],
)
def test_twenty_goals_over_their_deadline_at_a_server_that_answers_wrong(
    serve: Serve, name: str, node: Any, fault: str, record: Record
) -> None:
    """Ten goals, each tried twice, with a deadline that every second one breaks"""
    journal = serve(fault)
    count = iter(range(1000))
    leaf = MoveRobot(
        "m",
        0.0,
        action_name=name,
        timeout=Timeouts(queue=20.0, result=0.15, cancel=1.5, accept=1.0),
        retry=2,
    )
    leaf.goal = lambda: {"distance": (0.05, 0.4)[next(count) % 2]}
    done = py_trees.decorators.FailureIsSuccess("whatever", child=leaf)
    with TreeRunner(py_trees.decorators.Repeat("ten", child=done, num_success=10), node=node) as r:
        assert r.run(timeout=60.0) is Status.SUCCESS
        until(lambda: r.unaccounted == [], 10.0, what="all accounted for")
    assert None not in journal.ends()
    assert journal.max_live == 1
    assert journal.executed_twice == []
    record.outcome = "every goal accounted for, never two at once"


def test_sixty_goals_that_are_interrupted_at_once_are_all_canceled(
    serve: Serve, name: str, node: Any, record: Record
) -> None:
    """Six times as many cancel requests as the queue of the server's service holds"""
    journal = serve()
    limits = Timeouts(server=20.0, accept=20.0, cancel=1.0)
    leaves = [
        MoveRobot(f"m{i}", 90.0, action_name=name, busy="share", timeout=limits) for i in range(60)
    ]
    with TreeRunner(together(*leaves), node=node) as runner:
        runner.start()
        journal.wait_for("accepted", 60, 20.0)
        until(lambda: all(state(leaf) == "EXECUTING" for leaf in leaves))
        interrupted = time.monotonic()
        runner.interrupt()
        runner.wait(20.0)
        record.took(time.monotonic() - interrupted, 2.0)
        assert runner.unaccounted == []
    assert {(leaf.outcome, leaf.end) for leaf in leaves} == {(Outcome.CANCELED, End.CANCELED)}
    assert journal.ends() == ["canceled"] * 60
    assert journal.count("cancel_requested") == 60
    record.outcome = "all CANCELED, each asked for once"


GIVES_UP = """
import os, sys, time
from bt_actions import MoveRobot, Timeouts, TreeRunner
from tests.support.trees import state, together

limits = Timeouts(server=20.0, accept=20.0, cancel=0.3)
leaves = [
    MoveRobot(f"m{i}", 90.0, action_name=sys.argv[1], busy="share", timeout=limits)
    for i in range(10)
]
with TreeRunner(together(*leaves)) as runner:
    runner.start()
    while any(state(leaf) != "EXECUTING" for leaf in leaves):
        time.sleep(0.01)
    print("all run", flush=True)
    sys.stdin.readline()
    runner.interrupt()
    runner.wait()
    print("left:", len(runner.unaccounted), flush=True)
    os._exit(0)
"""


def test_who_gives_up_waiting_has_asked_for_each_goal(
    new_host: HostFactory, start_program: Callable[..., Process], name: str, record: Record
) -> None:
    """Ten goals, a server that answers nothing for now; a program that waits for 0.3 s, and ends"""
    host = new_host()
    journal = host.open(name)
    program = start_program("-c", GIVES_UP, name)
    program.line("all run")
    host.freeze()
    program.tell("")
    assert program.line("left: ") == "left: 10"
    program.wait()
    host.thaw()
    journal.wait_for("canceled", 10)
    record.outcome = "end UNKNOWN and said so; all canceled when the server goes on"


INSISTS = """
import sys, threading, time
from bt_actions import MoveRobot, Timeouts, TreeRunner
from tests.support.trees import state, together

limits = Timeouts(server=20.0, accept=20.0, cancel=5.0)
leaves = [
    MoveRobot(f"m{i}", 90.0, action_name=sys.argv[1], busy="share", timeout=limits)
    for i in range(60)
]

def watch():
    while any(state(leaf) != "EXECUTING" for leaf in leaves):
        time.sleep(0.01)
    print("all run", flush=True)

threading.Thread(target=watch, daemon=True).start()
with TreeRunner(together(*leaves)) as runner:
    runner.run()
"""


def test_who_will_not_wait_has_asked_for_more_goals_than_a_queue_holds(
    new_host: HostFactory, start_program: Callable[..., Process], name: str, record: Record
) -> None:
    """Sixty goals; SIGINT, and 20 ms later another, which ends the wait for the answers"""
    journal = new_host().open(name)
    program = start_program("-c", INSISTS, name)
    program.line("all run", 60.0)
    program.send(signal.SIGINT)
    time.sleep(0.02)  # less than the sixty answers take
    program.send(signal.SIGINT)
    assert program.wait() != 0
    journal.wait_for("canceled", 60)
    assert journal.count("cancel_requested") == 60
    record.outcome = "all canceled, each asked for once"
