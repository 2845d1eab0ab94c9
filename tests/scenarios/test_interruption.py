"""The tree changes its mind, in every phase of a goal. The server's journal is the judge."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import py_trees
import pytest
from py_trees.common import Status

from bt_actions import End, MoveRobot, Outcome, Timeouts, TreeError, TreeRunner
from bt_actions.ros.host import host as process
from bt_actions.servers.presence import Server
from bt_actions.traffic import route, watcher
from tests.support.processes import Host, Journal
from tests.support.reliability import Record, rounded
from tests.support.trees import Gate, Guard, Raises, in_sequence, in_turn, started, state, together
from tests.support.waiting import until

Serve = Callable[..., Journal]


def test_interrupted_before_acceptance_is_canceled_and_not_completed(
    serve: Serve, name: str, node: Any, executor: str, record: Record
) -> None:
    """interrupt() of a runner when the server has received its goal, which it accepts 1 s late"""
    journal = serve("1:delay_accept=1")
    leaf = MoveRobot("m", 1.0, action_name=name)
    with started(leaf, node=node, executor=executor) as runner:
        journal.wait_for("received")
        assert state(leaf) == "SENDING"
        interrupted = time.monotonic()
        runner.interrupt()
        assert runner.wait(5.0) is Status.INVALID
        record.took(time.monotonic() - interrupted)
        assert runner.unaccounted == []
    assert journal.ends() == ["canceled"]
    assert (leaf.outcome, leaf.end) == (Outcome.CANCELED, End.CANCELED)


def test_a_retry_after_a_timeout_waits_for_a_server_that_is_slow_to_cancel(
    serve: Serve, name: str, node: Any, executor: str
) -> None:
    """A server that takes 1 s to cancel; result deadline 0.3 s, three tries"""
    journal = serve("*:delay_cancel=1")
    leaf = MoveRobot("m", 5.0, action_name=name, timeout=0.3, retry=3)
    with TreeRunner(leaf, node=node, executor=executor) as runner:
        assert runner.run(timeout=12.0) is Status.FAILURE
    assert journal.max_live == 1
    assert journal.ends() == ["canceled"] * 3
    assert [record.outcome for record in leaf.history] == [Outcome.RESULT_TIMEOUT] * 3


PHASES = ["QUEUED", "WAITING_FOR_SERVER", "SENDING", "EXECUTING", "CANCELING", "BACKOFF"]


@pytest.mark.parametrize("phase", PHASES)
def test_preempted_by_a_reactive_sibling_and_entered_again_at_once(
    host: Host, serve: Serve, name: str, node: Any, phase: str
) -> None:
    """A guard preempts the first leaf in the phase named; the second one has the same server"""
    from bt_actions import Retry

    journal = None
    timeouts = Timeouts(result=0.3) if phase == "CANCELING" else Timeouts()
    retry = Retry(2, backoff=30.0) if phase == "BACKOFF" else Retry(1)
    faults = {
        "SENDING": "1:delay_accept=0.6",
        "EXECUTING": "1:delay_cancel=0.5",
        "CANCELING": "1:delay_cancel=1",
        "BACKOFF": "1:abort",
    }
    if phase != "WAITING_FOR_SERVER":
        journal = serve(*([faults[phase]] if phase in faults else []))
    guard = Guard()
    second = MoveRobot("second", 0.1, action_name=name)
    leaf = MoveRobot(
        "first",
        0.5 if phase == "CANCELING" else 1.5,
        action_name=name,
        timeout=timeouts,
        retry=retry,
    )
    reactive = in_turn(in_sequence(guard, second), leaf, memory=False)
    root, holder = reactive, None
    if phase == "QUEUED":
        holder = MoveRobot("holder", 1.0, action_name=name)
        root = together(holder, reactive)
    with started(root, node=node) as runner:
        until(lambda: state(leaf) == phase, what=phase)
        guard.holds = True
        until(lambda: leaf.status is Status.INVALID)
        if journal is None:
            journal = serve()
        assert runner.wait(8.0) is Status.SUCCESS
    assert second.outcome is Outcome.SUCCEEDED
    if phase == "BACKOFF":
        assert leaf.outcome is Outcome.ABORTED
    else:
        assert leaf.outcome is Outcome.CANCELED
    assert journal.max_live == 1
    assert (
        journal.ends()
        == {
            "QUEUED": ["succeeded", "succeeded"],
            "WAITING_FOR_SERVER": ["succeeded"],
            "SENDING": ["canceled", "succeeded"],
            "EXECUTING": ["canceled", "succeeded"],
            "CANCELING": ["canceled", "succeeded"],
            "BACKOFF": ["aborted", "succeeded"],
        }[phase]
    )


def test_ticks_go_on_while_the_second_visit_waits_for_the_first_to_end(
    serve: Serve, name: str, node: Any, spin: Any, record: Record
) -> None:
    """A leaf is stopped in mid-goal and ticked on; the server takes 3 s to cancel"""
    journal = serve("1:delay_cancel=3")
    leaf = MoveRobot("m", 0.4, action_name=name)
    tree = py_trees.trees.BehaviourTree(leaf)
    longest = 0.0

    def tick() -> None:
        nonlocal longest
        started = time.monotonic()
        tree.tick()
        longest = max(longest, time.monotonic() - started)

    spin_and_tick = lambda: (spin(), tick())  # noqa: E731
    tree.setup(node=node)
    until(lambda: state(leaf) == "EXECUTING", meanwhile=spin_and_tick)
    leaf.stop(Status.INVALID)
    until(lambda: leaf.status is Status.SUCCESS, meanwhile=spin_and_tick)
    assert longest < 1.5, "a tick that waited would have taken 3 s"
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
    tree.shutdown()
    record.outcome = "CANCELED; then SUCCEEDED; the longest tick took " + rounded(longest)


def test_preempted_and_entered_again_ten_times(serve: Serve, name: str, node: Any) -> None:
    """A guard holds and does no more, ten times; every second time in mid-goal"""
    journal = serve()
    guard = Guard()
    leaf = MoveRobot("m", 5.0, action_name=name)
    other = Gate("other")
    tree = in_turn(in_sequence(guard, other, memory=False), leaf, memory=False)
    with started(tree, node=node, heartbeat=0.01) as runner:
        for number in range(10):
            until(lambda: leaf.status is Status.RUNNING)
            if number % 2:
                until(lambda: state(leaf) == "EXECUTING")
            guard.holds = True
            until(lambda: leaf.status is Status.INVALID)
            guard.holds = False
        until(lambda: leaf.status is Status.RUNNING)
        runner.interrupt()
        runner.wait(5.0)
        assert runner.unaccounted == []
    assert journal.max_live <= 1
    assert len(journal.ends()) >= 5
    assert set(journal.ends()) == {"canceled"}


def test_a_parallel_with_a_failing_branch_cancels_the_others(
    serve: Serve, name: str, node: Any
) -> None:
    """Four servers; one of them aborts when it has executed its goal for 0.5 s"""
    failing = serve("1:abort=0.5", name=f"{name}_failing")
    others = [serve(name=f"{name}_{number}") for number in range(3)]
    leaves = [MoveRobot(f"m{i}", 5.0, action_name=f"{name}_{i}") for i in range(3)]
    tree = together(MoveRobot("fails", 5.0, action_name=f"{name}_failing"), *leaves)
    with TreeRunner(tree, node=node) as runner:
        assert runner.run(timeout=9.0) is Status.FAILURE
    assert failing.ends() == ["aborted"]
    assert [journal.ends() for journal in others] == [["canceled"]] * 3
    assert [leaf.end for leaf in leaves] == [End.CANCELED] * 3


class TestPyTreesDecorators:
    """They cannot wait for a cancel; the leaf does it for them."""

    def test_timeout_cancels_the_goal(self, serve: Serve, name: str, node: Any) -> None:
        """py_trees' Timeout of 0.4 s around the leaf"""
        journal = serve()
        leaf = MoveRobot("m", 5.0, action_name=name)
        tree = py_trees.decorators.Timeout("limit", child=leaf, duration=0.4)
        with TreeRunner(tree, node=node) as runner:
            assert runner.run(timeout=5.0) is Status.FAILURE
            assert runner.unaccounted == []
        assert leaf.outcome is Outcome.CANCELED
        assert journal.ends() == ["canceled"]

    def test_retry_of_timeout_never_has_two_goals_live(
        self, serve: Serve, name: str, node: Any, executor: str
    ) -> None:
        """py_trees' Retry, three times, of its Timeout of 1 s; the server takes 0.7 s to cancel"""
        journal = serve("*:delay_cancel=0.7")
        leaf = MoveRobot("m", 5.0, action_name=name)
        limited = py_trees.decorators.Timeout("limit", child=leaf, duration=1.0)
        tree = py_trees.decorators.Retry("again", child=limited, num_failures=3)
        with TreeRunner(tree, node=node, executor=executor) as runner:
            assert runner.run(timeout=12.0) is Status.FAILURE
            assert runner.unaccounted == []
        assert journal.max_live == 1
        assert set(journal.ends()) == {"canceled"}

    def test_retry_begins_a_new_visit_each_time(self, serve: Serve, name: str, node: Any) -> None:
        """py_trees' Retry around the leaf; the server aborts the first goal, rejects the second"""
        journal = serve("1:abort", "2:reject")
        leaf = MoveRobot("m", 0.1, action_name=name)
        tree = py_trees.decorators.Retry("again", child=leaf, num_failures=3)
        with TreeRunner(tree, node=node) as runner:
            assert runner.run(timeout=5.0) is Status.SUCCESS
        assert journal.ends() == ["aborted", "rejected", "succeeded"]
        assert len(leaf.history) == 1


NAMED = "TreeError, which names the behaviour"
NAMED_AND_CANCELED = f"{NAMED}; the leaf CANCELED"


class TestABehaviourThatRaises:
    @pytest.mark.parametrize("method", ["setup", "initialise", "update"])
    def test_fails_the_tree_names_itself_and_the_goals_are_drained(
        self, serve: Serve, name: str, node: Any, method: str, executor: str, record: Record
    ) -> None:
        """A Behaviour raises in the method named beside a goal that runs"""
        journal = serve()
        leaf = MoveRobot("m", 5.0, action_name=name)
        culprit = Raises("culprit", method, when=lambda: True)
        gate = Gate()
        root = together(leaf, in_sequence(gate, culprit, name="branch"), name="root")
        with started(root, node=node, executor=executor) as runner:
            if method != "setup":
                until(lambda: state(leaf) == "EXECUTING")
            gate.passed = True
            with pytest.raises(TreeError, match=r"root / branch / culprit: .*on purpose"):
                runner.wait(5.0)
            assert runner.unaccounted == []
        assert journal.ends() == ([] if method == "setup" else ["canceled"])
        record.outcome = NAMED if method == "setup" else NAMED_AND_CANCELED

    @pytest.mark.parametrize("method", ["initialise", "update"])
    def test_in_the_tick_that_sends_a_goal(
        self, serve: Serve, name: str, node: Any, method: str, record: Record
    ) -> None:
        """A Behaviour raises in the method named, in the tick that sends the goal beside it"""
        journal = serve("1:delay_accept=0.3")
        warm = MoveRobot("warm", 0.0, action_name=name)
        warm.setup(node=node)  # so that the server is known, and the first tick sends
        now, at = process.steady, warm._own

        def may_be_sent_to() -> bool:
            is_ready = watcher.recent_state(at, now()) is Server.READY
            return is_ready and not route.holds_back(at, now())

        at.long_stalls = process.stalls.long_times  # no doubt since a stall in the tests before
        until(may_be_sent_to)
        leaf = MoveRobot("m", 5.0, action_name=name)
        root = together(leaf, Raises("culprit", method), name="root")
        with TreeRunner(root, node=node) as runner:
            with pytest.raises(TreeError, match="root / culprit"):
                runner.run(timeout=5.0)
            assert journal.ends() == ["canceled"]
            assert leaf.status is Status.INVALID
            assert (leaf.outcome, leaf.end) == (Outcome.CANCELED, End.CANCELED)
        warm.shutdown()
        record.outcome = NAMED_AND_CANCELED + " before run() raises"

    def test_in_terminate(self, serve: Serve, name: str, node: Any, record: Record) -> None:
        """A Behaviour raises in terminate() when a guard stops it beside a goal that runs"""
        journal = serve()
        leaf = MoveRobot("m", 5.0, action_name=name)
        guard = Guard()
        culprit = Raises("culprit", "terminate")
        root = together(leaf, in_turn(guard, culprit, memory=False, name="branch"), name="root")
        with started(root, node=node) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            guard.holds = True
            with pytest.raises(TreeError, match=r"root / branch / culprit: .*on purpose"):
                runner.wait(5.0)
        assert journal.ends() == ["canceled"]
        record.outcome = NAMED_AND_CANCELED

    def test_in_terminate_while_the_tree_is_being_interrupted(
        self, serve: Serve, name: str, node: Any, record: Record
    ) -> None:
        """A Behaviour raises in terminate() when the tree is interrupted beside a goal that runs"""
        journal = serve()
        leaf = MoveRobot("m", 5.0, action_name=name)
        root = together(Raises("culprit", "terminate"), leaf, name="root")
        with started(root, node=node) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            interrupted = time.monotonic()
            runner.interrupt()
            runner.wait(5.0)
            record.took(time.monotonic() - interrupted)
        assert journal.ends() == ["canceled"]

    def test_in_shutdown(self, serve: Serve, name: str, node: Any) -> None:
        """A Behaviour raises in shutdown() beside a goal that runs"""
        journal = serve()
        leaf = MoveRobot("m", 5.0, action_name=name)
        root = together(Raises("culprit", "shutdown"), leaf, name="root")
        with started(root, node=node):
            until(lambda: state(leaf) == "EXECUTING")
        assert journal.ends() == ["canceled"]

    def test_in_on_feedback(self, serve: Serve, name: str, node: Any, record: Record) -> None:
        """The leaf's own on_feedback raises"""
        journal = serve()
        leaf = MoveRobot("m", 5.0, action_name=name, on_feedback=lambda feedback: 1 / 0)
        with (
            TreeRunner(leaf, node=node) as runner,
            pytest.raises(TreeError, match=r"m: .*ZeroDivisionError"),
        ):
            runner.run(timeout=5.0)
        assert journal.ends() == ["canceled"]
        record.outcome = NAMED_AND_CANCELED

    def test_in_expect(self, serve: Serve, name: str, node: Any, record: Record) -> None:
        """The leaf's own `expect` raises on the result"""
        serve()
        leaf = MoveRobot("m", 0.1, action_name=name, expect=lambda result: 1 / 0)
        with (
            TreeRunner(leaf, node=node) as runner,
            pytest.raises(TreeError, match=r"m: .*ZeroDivisionError"),
        ):
            runner.run(timeout=5.0)
        assert leaf.end is End.SUCCEEDED
        record.outcome = f"{NAMED}; end SUCCEEDED"


def test_a_pruned_subtree_lets_go_of_its_goal(
    serve: Serve, name: str, node: Any, spin: Any, record: Record
) -> None:
    """prune_subtree() of a branch in mid-goal; a loop of the user's goes on"""
    journal = serve()
    leaf = MoveRobot("m", 5.0, action_name=name)
    branch = in_sequence(leaf, name="branch")
    tree = py_trees.trees.BehaviourTree(together(branch, Gate(), name="root"))
    tree.setup(node=node)
    spin_and_tick = lambda: (spin(), tree.tick())  # noqa: E731
    until(lambda: state(leaf) == "EXECUTING", meanwhile=spin_and_tick)
    pruned = time.monotonic()
    tree.prune_subtree(branch.id)
    until(lambda: journal.ends() == ["canceled"], meanwhile=spin_and_tick)
    record.took(time.monotonic() - pruned)
    tree.shutdown()
    leaf.shutdown()


@pytest.mark.parametrize("loop", ["our runner", "a foreign loop"])
def test_a_leaf_that_is_replaced_makes_way_for_the_new_one(
    serve: Serve, name: str, node: Any, loop: str, request: pytest.FixtureRequest
) -> None:
    """replace_subtree() in mid-goal, by a leaf for the same server, which takes 0.5 s to cancel"""
    journal = serve("1:delay_cancel=0.5")
    old, new = (MoveRobot(each, 0.5, action_name=name) for each in ("old", "new"))
    tree = py_trees.trees.BehaviourTree(in_sequence(old))
    new.setup(node=node)

    def replace(tree: py_trees.trees.BehaviourTree) -> None:
        if old.parent is not None and state(old) == "EXECUTING":
            tree.replace_subtree(old.id, new)

    tree.add_post_tick_handler(replace)
    if loop == "our runner":
        with TreeRunner(tree, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
            assert runner.unaccounted == []
    else:
        spin = request.getfixturevalue("spin")
        tree.setup(node=node)
        until(lambda: new.outcome is not None, meanwhile=lambda: (spin(), tree.tick()))
        tree.shutdown()
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
    assert (old.outcome, old.end) == (Outcome.CANCELED, End.CANCELED)
    assert (new.outcome, new.end) == (Outcome.SUCCEEDED, End.SUCCEEDED)


def test_a_tree_replaced_while_running_leaves_no_goal(serve: Serve, name: str, node: Any) -> None:
    """shutdown() of a runner in mid-goal, without a word to its tree; another tree is run"""
    journal = serve()
    old, new = (MoveRobot(each, 0.5, action_name=name) for each in ("old", "new"))
    with started(old, node=node) as runner:
        until(lambda: state(old) == "EXECUTING")
    with TreeRunner(new, node=node) as runner:
        assert runner.run(timeout=5.0) is Status.SUCCESS
    assert journal.ends() == ["canceled", "succeeded"]
    assert journal.max_live == 1
