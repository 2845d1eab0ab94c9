"""Goals that follow a variable which changes: at any rate, and whatever the server makes of it.

At most one goal is live beside the one that takes its place, and the newest one counts.
"""

from __future__ import annotations

import itertools
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status
from robot_control_interfaces.action import MoveRobot
from std_msgs.msg import Float64

from bt_actions import ActionBehaviour, Outcome, Timeouts, TreeRunner
from tests.support.processes import HostFactory, Journal, Process
from tests.support.reliability import Record
from tests.support.trees import Gate, Guard, in_sequence, in_turn, started, state
from tests.support.waiting import until

Launch = Callable[..., Process]
Serve = Callable[..., Journal]

CHAOS = pytest.mark.chaos
FOLLOWS = pytest.mark.parametrize("on_change", ["replace", "cancel"])
SERVERS = pytest.mark.parametrize("preempts", [True, False], ids=["preempts", "runs both"])
PERIOD = 0.01
"""Seconds between two changes at 100 Hz."""
CHANGES = 200
LONG = 50.0


class Follower:
    """A leaf whose goal is what `wanted` holds."""

    def __init__(self, name: str, on_change: str) -> None:
        self.wanted = LONG
        timeout = Timeouts(accept=10.0, result=60.0, cancel=3.0)
        self.leaf = ActionBehaviour(
            "m", MoveRobot, name, lambda: {"distance": self.wanted},
            timeout=timeout, on_change=on_change,
        )  # fmt: skip

    @contextmanager
    def executing(self, node: Any, root: Any = None) -> Iterator[TreeRunner]:
        """The tree runs, and the first goal is on its way."""
        with started(root or self.leaf, node=node) as runner:
            until(lambda: state(self.leaf) == "EXECUTING")
            yield runner

    def end(self, runner: TreeRunner, within: float = 15.0) -> Status:
        status = runner.wait(within)
        assert status is not None, "the run has ended"
        assert runner.unaccounted == []
        return status


def received(journal: Journal) -> list[float]:
    """The distances that the server was asked for, in order."""
    entries = journal.entries()
    return [entry.more["distance"] for entry in entries if entry.event == "received"]


def at_100_hz(want: Callable[[float], object], last: float) -> None:
    """Change what is wanted, `CHANGES` times; then to `last`."""
    due = time.monotonic()
    for step in range(CHANGES):
        want(LONG + step / 10.0)
        due += PERIOD
        threading.Event().wait(max(0.0, due - time.monotonic()))
    want(last)


@FOLLOWS
@SERVERS
def test_of_changes_at_a_hundred_hertz_the_newest_wins(
    serve: Serve, name: str, node: Any, on_change: str, preempts: bool, record: Record
) -> None:
    """What a goal is made from changes at 100 Hz for 2 s; a server that preempts, or does not"""
    journal = serve("*:delay_cancel=0.1", preempts=preempts)
    follower = Follower(name, on_change)
    with follower.executing(node) as runner:
        at_100_hz(lambda wanted: setattr(follower, "wanted", wanted), last=0.3)
        assert follower.end(runner) is Status.SUCCESS
    sent = received(journal)
    assert follower.leaf.result.final_pose == pytest.approx(sent[-1]) == pytest.approx(0.3)
    assert 2 < len(sent) < CHANGES, "a change waits for the goal that is being sent"
    assert journal.max_live <= (1 if on_change == "cancel" else 2)
    assert None not in journal.ends()
    assert [each.attempt for each in follower.leaf.history] == [1]
    record.shows = f"{'never two' if on_change == 'cancel' else 'at most two'} live at once"
    record.outcome = "SUCCEEDED with the newest; each older one has ended; one attempt"


@FOLLOWS
@SERVERS
def test_the_newer_goal_is_refused(
    serve: Serve, name: str, node: Any, on_change: str, preempts: bool
) -> None:
    """The server refuses the newer goal; the tree goes on without the leaf"""
    journal = serve("2:reject", preempts=preempts)
    follower, gate = Follower(name, on_change), Gate()
    with follower.executing(node, in_turn(follower.leaf, gate)) as runner:
        follower.wanted = 1.0
        until(lambda: journal.ends() == ["canceled", "rejected"])
        gate.passed = True
        assert follower.end(runner) is Status.SUCCESS
    assert follower.leaf.outcome is Outcome.REJECTED


@FOLLOWS
def test_the_server_takes_the_newer_goal_late_and_the_newest_wins(
    serve: Serve, name: str, node: Any, on_change: str
) -> None:
    """The server accepts the second goal after 1 s; meanwhile the goal changes twice more"""
    journal = serve("2:delay_accept=1", preempts=True)
    follower = Follower(name, on_change)
    with follower.executing(node) as runner:
        follower.wanted = 40.0
        journal.wait_for("received", 2)
        follower.wanted = 30.0
        until(lambda: state(follower.leaf) == "SENDING")
        follower.wanted = 0.2
        assert follower.end(runner) is Status.SUCCESS
    assert received(journal) == pytest.approx([LONG, 40.0, 0.2])
    assert journal.ends()[-1] == "succeeded"
    assert None not in journal.ends()
    assert journal.max_live <= 2


def test_the_older_goal_succeeds_before_the_newer_is_accepted(
    serve: Serve, name: str, node: Any
) -> None:
    """The first goal arrives while the server thinks for 1 s about the one that replaces it"""
    journal = serve("2:delay_accept=1", preempts=False)
    follower = Follower(name, "replace")
    follower.wanted = 0.6
    with follower.executing(node) as runner:
        follower.wanted = 0.2
        assert follower.end(runner) is Status.SUCCESS
    assert journal.ends() == ["succeeded", "succeeded"]
    assert follower.leaf.result.final_pose == pytest.approx(0.2), "the newer one counts"
    assert len(follower.leaf.history) == 1


@pytest.mark.parametrize("fault", ["2:die=accept", pytest.param("2:die", marks=CHAOS)])
@pytest.mark.parametrize("on_change", ["replace", pytest.param("cancel", marks=CHAOS)])
def test_the_server_dies_over_the_newer_goal(
    new_host: HostFactory, name: str, node: Any, on_change: str, fault: str
) -> None:
    """SIGKILL to a server with the short lease: before it answers the newer goal, or in mid-goal"""
    journal = new_host().open(name, fault, preempts=False)
    follower = Follower(name, on_change)
    with follower.executing(node) as runner:
        follower.wanted = 40.0
        journal.wait_for("received", 2)
        assert runner.wait(90.0) is Status.FAILURE
    assert follower.leaf.outcome in (Outcome.SERVER_LOST, Outcome.ACCEPT_TIMEOUT)
    assert len(journal.ends()) == 2


PHASES = {
    "the newer is sent": ("replace", "2:delay_accept=0.5", "received", 2),
    "both run": ("replace", "1:delay_cancel=0.5", "accepted", 2),
    "the older is canceled": ("cancel", "1:delay_cancel=0.5", "cancel_requested", 1),
    "the next is sent": ("cancel", "2:delay_accept=0.5", "received", 2),
}


@pytest.mark.parametrize("phase", PHASES)
def test_the_tree_changes_its_mind_while_a_goal_takes_the_place_of_another(
    serve: Serve, name: str, node: Any, phase: str
) -> None:
    """A guard preempts the leaf in the phase named, and the tree goes on without it"""
    on_change, fault, event, times = PHASES[phase]
    journal = serve(fault, preempts=False)
    follower, guard, gate = Follower(name, on_change), Guard(), Gate()
    root = in_turn(in_sequence(guard, gate), follower.leaf, memory=False)
    with follower.executing(node, root) as runner:
        follower.wanted = 40.0
        journal.wait_for(event, times)
        guard.holds = True
        until(lambda: set(journal.ends()) == {"canceled"}, 2.0)
        gate.passed = True
        assert follower.end(runner) is Status.SUCCESS
    assert journal.max_live <= (1 if on_change == "cancel" else 2)


TREE = """\
tree: following
topics:
  wanted: {{topic: {name}/wanted, type: std_msgs/msg/Float64}}
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: {name}
    timeout: {{server: 20 s, result: 60 s, cancel: 3 s}}
root:
  move: Where it is wanted
  goal: {{distance: $wanted.data}}
  on_change: {on_change}
"""


@contextmanager
def publishing(node: Any, topic: str) -> Iterator[Callable[[float], None]]:
    """Publish at 100 Hz: another number each time, or the one that is told."""
    publisher, over = node.create_publisher(Float64, topic, 10), threading.Event()
    told: list[float] = []

    def publish() -> None:
        for step in itertools.count():
            if over.wait(PERIOD):
                return
            publisher.publish(Float64(data=told[-1] if told else LONG + step % 100 / 10.0))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield told.append
    finally:
        over.set()
        thread.join()
        node.destroy_publisher(publisher)


@pytest.mark.parametrize("preempts", [True, pytest.param(False, marks=CHAOS)])
@pytest.mark.parametrize("ends", ["arrives", "SIGINT", pytest.param("SIGTERM", marks=CHAOS)])
@FOLLOWS
def test_a_topic_changes_the_goal_at_a_hundred_hertz(
    serve: Serve,
    name: str,
    node: Any,
    launch: Launch,
    tmp_path: Path,
    on_change: str,
    ends: str,
    preempts: bool,
    record: Record,
) -> None:
    """`bt-actions run`, whose goal follows a topic; the topic stays at last, or the signal comes"""
    journal = serve("*:delay_cancel=0.1", preempts=preempts)
    tree = tmp_path / "following.yaml"
    tree.write_text(TREE.format(name=name, on_change=on_change))
    with publishing(node, f"{name}/wanted") as want:
        process = launch("run", str(tree))
        for _ in range(4):
            process.line("executing on")
        if ends == "arrives":
            want(0.3)
            assert process.wait() == 0, process
            assert received(journal)[-1] == pytest.approx(0.3)
        else:
            process.send(signal.Signals[ends])
            assert process.wait() == 128 + signal.Signals[ends], process
    assert None not in journal.ends()
    assert journal.max_live <= (1 if on_change == "cancel" else 2)
    record.shows = f"{'never two' if on_change == 'cancel' else 'at most two'} live at once"
    record.outcome = "the newest succeeds" if ends == "arrives" else "each goal has ended"
