"""The server: killed, stopped, closed, restarted, late, or there twice.

The servers are processes of their own, the tree runs in this one. How soon a dead server is noticed
is decided by the lease that the *server's* process announces.
"""

from __future__ import annotations

import gc
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import py_trees
import pytest
from py_trees.common import Status
from py_trees.composites import Selector

from bt_actions import End, MoveRobot, Outcome, Retry, Timeouts, TreeRunner
from bt_actions.events import Event, GoalChanged
from bt_actions.goals.attempts import AttemptRecord
from bt_actions.goals.terms import State
from bt_actions.ros.action_transport import RosTransport
from bt_actions.ros.host import host as process
from bt_actions.ros.node_participant import traffic_of
from bt_actions.servers.presence import (
    NOT_READY_FOR,
    PROBE_EVERY,
    SLOWEST_START,
    Server,
    ServerWatch,
)
from bt_actions.traffic import route, watcher
from bt_actions.traffic.state import Endpoint
from tests.support.middleware import AS_IT_COMES, NOTHING_SET
from tests.support.processes import Host, HostFactory, Journal, Process
from tests.support.reliability import Record
from tests.support.trees import Gate, in_sequence, in_turn, started, state
from tests.support.waiting import holds_for, until

AT_ONCE = 1.0
"""Seconds within which a server that closes is noticed."""
SHORT = 5.0
"""Seconds within which a dead server with the short lease is noticed."""
STOCK = 25.0
"""The same with Fast DDS as it comes, where no deadline is set."""
RESTARTED = 5.0
"""The same from the appearance of its successor."""

CANCELED = ["received", "accepted", "cancel_requested", "cancel_accepted", "canceled"]
"""What the journal says of a goal that was canceled."""


def stood(leaf: MoveRobot) -> tuple[Outcome | None, End | None]:
    return leaf.outcome, leaf.end


def until_shown(node: Any, name: str, servers: int) -> None:
    """Wait until discovery shows the node of the tests so many servers."""
    topic = f"{name}/_action/status"
    until(lambda: len(node.get_publishers_info_by_topic(topic)) == servers, 6.0, what=topic)


def until_both_hear(leaf: MoveRobot, node: Any) -> None:
    """Set the leaf up, and wait until two servers answer its client, and so will hear it later."""
    leaf.setup(node=node)
    endpoint = leaf._own
    assert endpoint is not None

    def state_now() -> Server:
        with process.lock:
            return watcher.look(endpoint, time.monotonic())

    until(
        lambda: state_now() is Server.AMBIGUOUS,
        9.0,
        meanwhile=lambda: route.deliver_arrived(endpoint),
    )
    as_if_nothing_was_asked(endpoint)


def until_heard(leaf: MoveRobot, node: Any) -> None:
    """Set the leaf up, and wait until its server answers its client: so neither is in any doubt."""
    leaf.setup(node=node)
    endpoint = leaf._own
    assert endpoint is not None
    asked_at = float("-inf")

    def is_heard() -> bool:
        nonlocal asked_at
        with process.lock:
            now = time.monotonic()
            if watcher.look(endpoint, now) is Server.READY and now - asked_at > PROBE_EVERY:
                asked_at = now
                route.probe(endpoint)
            return endpoint.transport.reachability.heard

    until(is_heard, 9.0, meanwhile=lambda: route.deliver_arrived(endpoint))
    as_if_nothing_was_asked(endpoint)


def as_if_nothing_was_asked(endpoint: Endpoint) -> None:
    """Have the endpoint begin anew with the servers that it sees."""
    with process.lock:
        route.deliver_arrived(endpoint)
        endpoint.watch = ServerWatch()
        for probe in range(1, 100):
            endpoint.transport.forget(probe)


class TestKilled:
    @pytest.mark.parametrize(
        "phase",
        [
            pytest.param("SENDING", marks=pytest.mark.chaos),
            "EXECUTING",
            pytest.param("CANCELING", marks=pytest.mark.chaos),
        ],
    )
    @pytest.mark.parametrize("executor", ["multi", pytest.param("single", marks=pytest.mark.chaos)])
    def test_killed_with_the_short_lease(
        self,
        new_host: HostFactory,
        name: str,
        node: Any,
        executor: str,
        phase: str,
        record: Record,
    ) -> None:
        """SIGKILL to a server that has the short lease, in the phase named"""
        victim = new_host()
        fault = {"SENDING": "1:delay_accept=60", "CANCELING": "1:delay_cancel=60"}
        journal = victim.open(name, *([fault[phase]] if phase in fault else []))
        timeouts = Timeouts(accept=30.0, cancel=30.0, result=0.3 if phase == "CANCELING" else None)
        leaf = MoveRobot("m", 9.0, action_name=name, timeout=timeouts)
        with started(leaf, node=node, executor=executor) as runner:
            until(lambda: state(leaf) == phase)
            journal.wait_for("received" if phase == "SENDING" else "accepted")
            if phase == "CANCELING":
                journal.wait_for("cancel_requested")
            killed = victim.kill()
            until(lambda: leaf.outcome is not None, 9.0)
            record.took(time.monotonic() - killed, SHORT)
            assert runner.wait(9.0) is Status.FAILURE
            assert runner.unaccounted == []
        wanted = Outcome.RESULT_TIMEOUT if phase == "CANCELING" else Outcome.SERVER_LOST
        assert stood(leaf) == (wanted, End.SERVER_GONE)
        record.outcome = f"{leaf.outcome}, end {leaf.end}"

    @pytest.mark.chaos
    def test_killed_with_the_lease_that_our_programs_give_themselves(
        self,
        start_program: Callable[..., Process],
        tmp_path: Path,
        name: str,
        node: Any,
        record: Record,
    ) -> None:
        """SIGKILL to `bt-actions sim`, for which nobody has set a profile"""
        robot, path = name.rpartition("/")[0], tmp_path / "journal"
        arguments = ("sim", "--namespace", robot, "--journal", str(path))
        victim = start_program("-m", "bt_actions.cli", *arguments, environment=NOTHING_SET)
        victim.line("ready: ")
        journal = Journal(path, f"{robot}/move_robot")
        record.journals.append(journal)
        leaf = MoveRobot("m", 9.0, action_name=journal.server)
        with started(leaf, node=node) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            journal.wait_for("accepted")
            killed = victim.send(signal.SIGKILL)
            until(lambda: leaf.outcome is not None, STOCK)
            record.took(time.monotonic() - killed, SHORT)
            assert runner.wait(9.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert journal.ends() == [None]
        record.outcome = f"{leaf.outcome}, end {leaf.end}"

    @pytest.mark.chaos
    def test_killed_on_stock_settings_with_no_deadline(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGKILL to a server with Fast DDS as it comes; the tree has no deadline at all"""
        victim = new_host(short_lease=False, environment=AS_IT_COMES)
        victim.open(name)
        leaf = MoveRobot("m", 9.0, action_name=name)
        with started(leaf, node=node) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            killed = victim.kill()
            until(lambda: leaf.outcome is not None, 40.0)
            record.took(time.monotonic() - killed, STOCK)
            assert runner.wait(9.0) is Status.FAILURE
        assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        record.outcome = f"{leaf.outcome}, end {leaf.end}"

    @pytest.mark.chaos
    def test_killed_on_stock_settings_with_a_feedback_deadline(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGKILL to a server with Fast DDS as it comes; feedback deadline 1 s, cancel 1 s"""
        victim = new_host(short_lease=False, environment=AS_IT_COMES)
        victim.open(name)
        leaf = MoveRobot(
            "m", 9.0, action_name=name, timeout=Timeouts(feedback=1.0, cancel=1.0), retry=3
        )
        with started(leaf, node=node) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            killed = victim.kill()
            assert runner.wait(9.0) is Status.FAILURE
            record.took(time.monotonic() - killed, 4.0)
            assert stood(leaf) == (Outcome.STALLED, End.UNKNOWN)
            assert [each.goal_id for each in runner.unaccounted] == [leaf.history[-1].goal_id]
            record.outcome = "STALLED, end UNKNOWN and said so; not tried again beside it"
            until(lambda: leaf.end is End.SERVER_GONE, STOCK, what="SERVER_GONE")
        assert len(leaf.history) == 1


def leave(leaf: MoveRobot) -> None:
    """Shut its runner down in mid-motion, where its server does not end it in time."""
    with started(leaf):
        until(lambda: state(leaf) == "EXECUTING", 20.0)
    assert leaf.end is End.UNKNOWN


def lose(host: Host, leaf: MoveRobot, runner: TreeRunner) -> None:
    """Stop a server under a goal until its lease is over, and the run with it."""
    runner.start()
    until(lambda: leaf.progress().feedback is not None)
    host.send(signal.SIGSTOP)
    assert runner.wait(20.0) is Status.FAILURE
    assert stood(leaf) == (Outcome.SERVER_LOST, End.SERVER_GONE)


class TestStopped:
    @pytest.mark.chaos
    def test_stopped_for_less_than_the_feedback_deadline(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGSTOP for 1 s, feedback deadline 2.5 s"""
        host = new_host(short_lease=False)
        journal = host.open(name)
        leaf = MoveRobot("m", 1.0, action_name=name, timeout=Timeouts(feedback=2.5))
        with started(leaf, node=node) as runner:
            until(lambda: leaf.progress().feedback is not None)
            host.send(signal.SIGSTOP)
            assert holds_for(lambda: leaf.outcome is None, 1.0)
            host.send(signal.SIGCONT)
            assert runner.wait(9.0) is Status.SUCCESS
        assert journal.events() == ["received", "accepted", "succeeded"]
        record.outcome = "SUCCEEDED, as if nothing had been"

    def test_stopped_for_longer_than_the_feedback_deadline(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGSTOP until after feedback (0.6 s) and cancel deadline (0.6 s), then SIGCONT"""
        host = new_host(short_lease=False)
        journal = host.open(name)
        leaf = MoveRobot(
            "m", 9.0, action_name=name, timeout=Timeouts(feedback=0.6, cancel=0.6), retry=3
        )
        with started(leaf, node=node) as runner:
            until(lambda: leaf.progress().feedback is not None)
            stopped = host.send(signal.SIGSTOP)
            assert runner.wait(5.0) is Status.FAILURE
            record.took(time.monotonic() - stopped, 3.0)
            assert stood(leaf) == (Outcome.STALLED, End.UNKNOWN)
            assert len(runner.unaccounted) == 1
            host.send(signal.SIGCONT)
            journal.wait_for("canceled")
            until(lambda: leaf.end is End.CANCELED, what="accounted for at last")
            assert runner.unaccounted == []
        assert journal.ends() == ["canceled"]
        record.outcome = "STALLED, end UNKNOWN; canceled as soon as the server woke"

    @pytest.mark.chaos
    def test_stopped_and_awake_before_the_cancel_deadline(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGSTOP until the feedback deadline (0.6 s) has passed, then SIGCONT; two attempts"""
        host = new_host(short_lease=False)
        journal = host.open(name)
        leaf = MoveRobot(
            "m", 1.0, action_name=name, timeout=Timeouts(feedback=0.6, cancel=9.0), retry=2
        )
        with started(leaf, node=node) as runner:
            until(lambda: leaf.progress().feedback is not None)
            host.send(signal.SIGSTOP)
            until(lambda: state(leaf) == "CANCELING")
            host.send(signal.SIGCONT)
            assert runner.wait(9.0) is Status.SUCCESS
        assert journal.max_live == 1
        assert journal.ends()[-1] == "succeeded"
        record.outcome = "STALLED, its end confirmed; then SUCCEEDED, never two at once"

    @pytest.mark.chaos
    def test_stopped_for_longer_than_its_lease_and_back(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGSTOP beyond the lease, then SIGCONT: the same server with our goal still running"""
        host = new_host()
        journal = host.open(name)
        first = MoveRobot("first", 20.0 / 3, action_name=name)
        second = MoveRobot("second", 0.3, action_name=name, timeout=Timeouts(server=20.0))
        with started(in_turn(first, second), node=node) as runner:
            until(lambda: first.progress().feedback is not None)
            stopped = host.send(signal.SIGSTOP)
            until(lambda: first.outcome, 9.0)
            record.took(time.monotonic() - stopped, SHORT)
            assert stood(first) == (Outcome.SERVER_LOST, End.SERVER_GONE)
            host.send(signal.SIGCONT)
            assert runner.wait(20.0) is Status.SUCCESS
        assert first.end in (End.CANCELED, End.SUCCEEDED)
        assert journal.ends() == ["canceled", "succeeded"]
        assert journal.max_live == 1
        record.outcome = "SERVER_LOST; back: canceled first, then the next goal SUCCEEDED"

    @pytest.mark.chaos
    @pytest.mark.parametrize("ends", ["by-itself", "interrupted", "interrupted-late"])
    def test_stopped_for_a_little_longer_than_its_lease_when_nobody_wants_more(
        self, new_host: HostFactory, name: str, node: Any, ends: str, record: Record
    ) -> None:
        """SIGSTOP until its lease is over, and the tree with it; SIGCONT 1 s later"""
        host = new_host()
        late = ends == "interrupted-late"  # so its first deadline ends with the look-out
        journal = host.open(name, *(["1:delay_cancel=1"] if late else []))
        leaf = MoveRobot("m", 30.0, action_name=name, timeout=Timeouts(cancel=3.0 if late else 5.0))
        with started(leaf, node=node) as runner:
            until(lambda: leaf.progress().feedback is not None)
            host.send(signal.SIGSTOP)
            if late:
                assert holds_for(lambda: leaf.outcome is None, 1.0)
            if ends != "by-itself":
                runner.interrupt()
            until(lambda: leaf.end is End.SERVER_GONE, 9.0)
            assert holds_for(lambda: leaf.end is End.SERVER_GONE, 1.0)
            host.send(signal.SIGCONT)
            runner.wait(9.0)
            assert journal.ends() == ["canceled"]
            assert leaf.end is End.CANCELED
            assert runner.unaccounted == []
        record.outcome = "SERVER_GONE; back: canceled before the run is over, end CANCELED"

    @pytest.mark.chaos
    def test_stopped_while_it_decides_on_a_goal_that_it_denied(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """It withholds its acceptance for 3 s (deadline 0.5 s); then SIGSTOP beyond the lease"""
        host = new_host()
        journal = host.open(name, "1:delay_accept=3")
        leaf = MoveRobot("m", 9.0, action_name=name, timeout=Timeouts(accept=0.5, cancel=3.0))
        gate = Gate()
        root = Selector("root", memory=True, children=[leaf, gate])
        with started(root, node=node) as runner:
            until(lambda: stood(leaf) == (Outcome.ACCEPT_TIMEOUT, End.NEVER_STARTED))
            stopped = host.send(signal.SIGSTOP)
            until(lambda: leaf.end is End.SERVER_GONE, 9.0, what="no longer said to be denied")
            record.took(time.monotonic() - stopped, SHORT)
            host.send(signal.SIGCONT)
            journal.wait_for("canceled")
            until(lambda: leaf.end is End.CANCELED, what="accounted for at last")
            gate.passed = True
            assert runner.wait(9.0) is Status.SUCCESS
        record.outcome = "ACCEPT_TIMEOUT, NEVER_STARTED; then SERVER_GONE; canceled when it woke"

    @pytest.mark.chaos
    def test_stopped_and_back_for_the_next_runner(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGSTOP beyond the lease; the run ends; SIGCONT; a new run of the same process"""
        host = new_host()
        journal = host.open(name)
        first = MoveRobot("first", 40.0, action_name=name)
        second = MoveRobot("second", 0.3, action_name=name, timeout=Timeouts(server=20.0))
        with TreeRunner(first, node=node) as runner:
            lose(host, first, runner)
        host.send(signal.SIGCONT)
        with TreeRunner(second, node=node) as runner:
            assert runner.run(30.0) is Status.SUCCESS
        assert journal.max_live == 1
        assert first.end is End.CANCELED
        assert journal.ends() == ["canceled", "succeeded"]
        record.outcome = "SERVER_LOST; back: canceled first, though its run had ended"

    @pytest.mark.chaos
    def test_stopped_and_back_for_a_runner_that_was_there_before(
        self, new_host: HostFactory, name: str, domain: int, record: Record
    ) -> None:
        """SIGSTOP beyond the lease; its run ends; SIGCONT; another runner has used it already"""
        host = new_host()
        journal = host.open(name)
        timeouts = Timeouts(server=20.0)
        first = MoveRobot("first", 9.0, action_name=name, timeout=timeouts)
        second = MoveRobot("second", 0.3, action_name=name, timeout=timeouts)
        other = TreeRunner(second)
        assert other.run(20.0) is Status.SUCCESS
        with TreeRunner(first) as runner:
            lose(host, first, runner)
        host.send(signal.SIGCONT)
        assert other.run(30.0) is Status.SUCCESS
        other.shutdown()
        assert journal.max_live == 1
        assert journal.ends() == ["succeeded", "canceled", "succeeded"]
        record.outcome = "SERVER_LOST; back: canceled first, by the other runner"

    @pytest.mark.chaos
    def test_stopped_and_back_while_another_runner_uses_its_resource(
        self, new_host: HostFactory, name: str, domain: int, record: Record
    ) -> None:
        """SIGSTOP beyond the lease; its run ends; SIGCONT; a new run, another server of one arm"""
        hosts = [new_host(), new_host()]
        journals = [hosts[which].open(f"{name}_{which}") for which in range(2)]
        timeouts = Timeouts(server=20.0)
        first, second = (
            MoveRobot("m", 9.0 if which == 0 else 0.3, action_name=f"{name}_{which}",
                      resources={"arm"}, timeout=timeouts)
            for which in range(2)
        )  # fmt: skip
        with TreeRunner(first) as runner:
            lose(hosts[0], first, runner)
        hosts[0].send(signal.SIGCONT)
        with TreeRunner(second) as runner:
            assert runner.run(30.0) is Status.SUCCESS
            journals[0].wait_for("canceled")
        assert [journal.ends() for journal in journals] == [["canceled"], ["succeeded"]]
        record.outcome = "SERVER_LOST; back: canceled, though nobody speaks to its server any more"

    def test_left_behind_and_remembered_by_a_node_whose_client_lies_idle(
        self, host: Host, name: str, record: Record
    ) -> None:
        """A goal takes 3 s to be canceled, its runner waits 0.5 s; another server of its arm"""
        journals = [host.open(f"{name}_0", "1:delay_cancel=3"), host.open(f"{name}_1")]
        arm, timeouts = {"arm"}, Timeouts(server=20.0, cancel=0.5)
        first, idle, second = (
            MoveRobot(letter, 40.0 if letter == "first" else 0.3, action_name=f"{name}_{which}",
                      resources=arm, timeout=timeouts)
            for letter, which in (("first", 0), ("idle", 0), ("second", 1))
        )  # fmt: skip
        with TreeRunner(in_turn(second, idle), name="other") as other:
            for leaf in (idle, second):
                leaf.setup(node=other.node)
            until_shown(other.node, f"{name}_0", 1)
            leave(first)
            assert other.run(30.0) is Status.SUCCESS
        canceled, received = journals[0].wait_for("canceled"), journals[1].wait_for("received")
        assert canceled.t <= received.t
        record.outcome = "UNKNOWN; canceled before the goal on the other server is sent"

    @pytest.mark.chaos
    def test_left_behind_where_the_next_node_has_not_discovered_its_server_yet(
        self, host: Host, name: str, record: Record, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The same with a node of its own, which is shown the one server 1.5 s after the other"""
        journals = [host.open(f"{name}_0", "1:delay_cancel=3"), host.open(f"{name}_1")]
        timeouts = Timeouts(server=20.0, cancel=0.5)
        first = MoveRobot("first", 40.0, action_name=f"{name}_0", resources={"arm"})
        second = MoveRobot("second", 0.3, action_name=f"{name}_1", resources={"arm"})
        first.timeouts = second.timeouts = timeouts
        leave(first)
        really, began = RosTransport.servers, time.monotonic()

        def late(at: RosTransport) -> frozenset[bytes]:
            early = at._name == f"{name}_0" and time.monotonic() - began < 1.5
            return frozenset() if early else really(at)

        monkeypatch.setattr(RosTransport, "servers", late)
        with TreeRunner(second) as other:
            assert other.run(30.0) is Status.SUCCESS
        canceled, received = journals[0].wait_for("canceled"), journals[1].wait_for("received")
        assert canceled.t <= received.t
        record.outcome = "UNKNOWN; canceled before the goal on the other server is sent"

    @pytest.mark.chaos
    def test_left_behind_on_a_server_that_is_stopped_for_less_than_its_lease(
        self, new_host: HostFactory, host: Host, name: str, record: Record
    ) -> None:
        """A cancel takes 3 s; SIGSTOP; a new run, another server of its arm; SIGCONT after 5 s"""
        stopped = new_host(short_lease=False)
        journals = [stopped.open(f"{name}_0", "1:delay_cancel=3"), host.open(f"{name}_1")]
        first = MoveRobot("first", 40.0, action_name=f"{name}_0", resources={"arm"})
        second = MoveRobot("second", 0.3, action_name=f"{name}_1", resources={"arm"})
        first.timeouts, second.timeouts = Timeouts(cancel=0.5), Timeouts(server=60.0)
        leave(first)
        stopped.send(signal.SIGSTOP)
        with started(second) as runner:
            until_shown(runner.node, f"{name}_1", 1)
            assert holds_for(lambda: state(second) == "WAITING_FOR_SERVER", 5.0)
            assert first.end is End.UNKNOWN
            stopped.send(signal.SIGCONT)
            assert runner.wait(30.0) is Status.SUCCESS
        ended, received = journals[0].wait_for("canceled"), journals[1].wait_for("received")
        assert ended.t <= received.t
        record.outcome = "UNKNOWN; the other server is sent to when the goal has ended"

    @pytest.mark.chaos
    def test_left_behind_on_a_server_that_is_killed_is_waited_for_once(
        self,
        new_host: HostFactory,
        host: Host,
        name: str,
        record: Record,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """A refused cancel; SIGKILL; one runner for each job, with another server of its arm"""
        monkeypatch.setattr("bt_actions.traffic.handover.LEASE", 10.0)
        monkeypatch.setattr("bt_actions.traffic.handover.TOO_NEW", 0.5)
        victim = new_host()
        victim.open(f"{name}_0", "1:reject_cancel")
        journal = host.open(f"{name}_1")
        left = MoveRobot("left", 40.0, action_name=f"{name}_0", resources={"arm"})
        left.timeouts = Timeouts(server=20.0, cancel=0.5)
        leave(left)
        victim.kill()
        outcomes = []
        for seconds in (3.0, 20.0):
            job = MoveRobot("job", 0.3, action_name=f"{name}_1", resources={"arm"})
            job.timeouts = Timeouts(server=seconds)
            with TreeRunner(job) as runner:
                runner.run(30.0)
            outcomes.append(job.outcome)
        assert outcomes == [Outcome.SERVER_UNAVAILABLE, Outcome.SUCCEEDED]
        assert left.end is End.SERVER_GONE
        assert journal.ends() == ["succeeded"]
        record.outcome = "SERVER_UNAVAILABLE, and then the arm is used again"

    @pytest.mark.chaos
    def test_lost_where_the_next_node_discovers_its_server_after_the_other_one(
        self,
        new_host: HostFactory,
        host: Host,
        name: str,
        record: Record,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """SIGSTOP beyond the lease, SIGCONT; a new run is shown the other server 0.5 s before it"""
        stopped = new_host()
        journals = [stopped.open(f"{name}_0"), host.open(f"{name}_1")]
        first = MoveRobot("first", 40.0, action_name=f"{name}_0", resources={"arm"})
        second = MoveRobot("second", 0.3, action_name=f"{name}_1", resources={"arm"})
        second.timeouts = Timeouts(server=20.0)
        with TreeRunner(first) as runner:
            lose(stopped, first, runner)
        stopped.send(signal.SIGCONT)
        really, seen = RosTransport.servers, dict[str, float]()

        def late(at: RosTransport) -> frozenset[bytes]:
            shown = really(at)
            if at._name == f"{name}_1":
                if shown:
                    seen.setdefault("other", time.monotonic())
            elif time.monotonic() - seen.get("other", time.monotonic()) < 0.5:
                return frozenset()
            return shown

        with TreeRunner(second) as other:
            until_shown(other.node, f"{name}_0", 1)
            monkeypatch.setattr(RosTransport, "servers", late)
            assert other.run(30.0) is Status.SUCCESS
        ended, received = journals[0].wait_for("canceled"), journals[1].wait_for("received")
        assert ended.t <= received.t
        record.outcome = "SERVER_LOST; canceled before the goal on the other server is sent"

    @pytest.mark.chaos
    def test_a_node_that_is_destroyed_gives_up_the_resource_of_a_server_that_dies(
        self,
        new_host: HostFactory,
        name: str,
        node: Any,
        domain: int,
        record: Record,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """A cancel is refused, the node is destroyed, then SIGKILL; another server of the arm"""
        from rclpy.context import Context
        from rclpy.node import Node

        monkeypatch.setattr("bt_actions.traffic.watcher.SILENT_FOR", 3.0)
        victim, host = new_host(), new_host()
        victim.open(f"{name}_0", "1:reject_cancel")
        traffic_of(node)
        until_shown(node, f"{name}_0", 1)
        monkeypatch.setattr("bt_actions.traffic.handover.TOO_NEW", 0.0)  # it has seen the victim
        journal = host.open(f"{name}_1")
        first = MoveRobot("first", 40.0, action_name=f"{name}_0", resources={"arm"})
        first.timeouts = Timeouts(server=20.0, cancel=0.5)
        context = Context()
        context.init(domain_id=domain)
        gone = Node("gone", context=context)
        first.setup(node=gone)
        endpoint = first._own
        assert endpoint is not None
        ticking = lambda: (route.deliver_arrived(endpoint), first.tick_once())  # noqa: E731
        until(lambda: state(first) == "EXECUTING", 20.0, meanwhile=ticking)
        first.shutdown()
        assert first.end is End.UNKNOWN
        gone.destroy_node()
        context.shutdown()
        killed = victim.kill()
        second = MoveRobot("second", 0.3, action_name=f"{name}_1", resources={"arm"})
        second.timeouts = Timeouts(server=20.0, queue=None)
        with TreeRunner(second, node=node) as runner:
            assert runner.run(30.0) is Status.SUCCESS
        record.took(time.monotonic() - killed, 20.0)
        assert first.end is End.SERVER_GONE
        assert journal.ends() == ["succeeded"]
        record.outcome = "the other server of the arm is used as soon as nobody has it"

    @pytest.mark.chaos
    def test_a_node_that_is_destroyed_does_not_wait_for_what_the_successor_denies(
        self,
        new_host: HostFactory,
        name: str,
        node: Any,
        domain: int,
        record: Record,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        """SIGKILL, a successor at once, and the node is destroyed while both are shown"""
        from rclpy.context import Context
        from rclpy.node import Node

        victim, successor = new_host(), new_host()
        victim.open(name)
        traffic_of(node)
        until_shown(node, name, 1)
        monkeypatch.setattr("bt_actions.traffic.handover.TOO_NEW", 0.0)  # it has seen the victim
        first = MoveRobot("first", 40.0, action_name=name, timeout=Timeouts(cancel=0.5))
        context = Context()
        context.init(domain_id=domain)
        gone = Node("gone", context=context)
        first.setup(node=gone)
        endpoint = first._own
        assert endpoint is not None
        ticking = lambda: (route.deliver_arrived(endpoint), first.tick_once())  # noqa: E731
        until(lambda: state(first) == "EXECUTING", 20.0, meanwhile=ticking)
        killed = victim.kill()
        journal = successor.open(name)
        until(lambda: endpoint.watch.is_crowded)
        first.shutdown()
        assert first.end is End.UNKNOWN
        gone.destroy_node()
        second = MoveRobot("second", 0.3, action_name=name)
        second.timeouts = Timeouts(server=20.0, queue=None)
        with TreeRunner(second, node=node) as runner:
            assert runner.run(50.0) is Status.SUCCESS
        context.shutdown()
        record.took(time.monotonic() - killed, 15.0)
        assert first.end is End.SERVER_GONE
        assert of_process(journal, successor.pid) == ["received", "accepted", "succeeded"]
        record.outcome = "SERVER_GONE; the successor is used"

    @pytest.mark.chaos
    def test_stopped_and_back_while_another_server_has_its_resource(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """Two servers of one arm, SIGSTOP beyond the lease, SIGCONT; the other one is wanted"""
        host = new_host()
        journals = [host.open(f"{name}_{which}") for which in ("move", "home")]
        move = MoveRobot("move", 40.0, action_name=f"{name}_move", resources={"arm"})
        home = MoveRobot("home", 0.3, action_name=f"{name}_home", resources={"arm"})
        home.timeouts = Timeouts(server=20.0)
        root = py_trees.composites.Selector("arm", memory=True, children=[move, home])
        with started(root, node=node) as runner:
            until(lambda: move.progress().feedback is not None)
            host.send(signal.SIGSTOP)
            until(lambda: state(home) == "WAITING_FOR_SERVER", 20.0)
            host.send(signal.SIGCONT)
            assert runner.wait(30.0) is Status.SUCCESS
        assert stood(move) == (Outcome.SERVER_LOST, End.CANCELED)
        ended = next(entry.t for entry in journals[0].entries() if entry.event == "canceled")
        received = next(entry.t for entry in journals[1].entries() if entry.event == "received")
        assert ended <= received
        record.outcome = "SERVER_LOST; back: canceled before the goal on the other server"

    @pytest.mark.chaos
    def test_stopped_and_back_while_another_node_wants_it(
        self, new_host: HostFactory, name: str, domain: int, record: Record
    ) -> None:
        """SIGSTOP beyond the lease, then SIGCONT; the next goal is one of another node"""
        host = new_host()
        journal = host.open(name)
        first = MoveRobot("first", 40.0, action_name=name)
        second = MoveRobot("second", 0.3, action_name=name, timeout=Timeouts(server=30.0))
        with TreeRunner(first) as one, TreeRunner(second, name="other") as other:
            one.start()
            until(lambda: first.progress().feedback is not None)
            host.send(signal.SIGSTOP)
            assert one.wait(20.0) is Status.FAILURE
            assert stood(first) == (Outcome.SERVER_LOST, End.SERVER_GONE)
            other.start()
            until(lambda: state(second) == "WAITING_FOR_SERVER")
            host.send(signal.SIGCONT)
            assert other.wait(40.0) is Status.SUCCESS
            assert journal.max_live == 1
            assert first.end is End.CANCELED
            assert journal.ends() == ["canceled", "succeeded"]
            record.outcome = "SERVER_LOST; back: canceled before the other node's goal"


class TestClosed:
    @pytest.mark.chaos
    @pytest.mark.parametrize("phase", ["SENDING", "EXECUTING", "CANCELING"])
    def test_a_server_that_exits_in_good_order(
        self, new_host: HostFactory, name: str, node: Any, phase: str, record: Record
    ) -> None:
        """SIGINT to the server's process, which closes its server and goes; stock lease"""
        host = new_host(short_lease=False)
        fault = {"SENDING": "1:delay_accept=60", "CANCELING": "1:delay_cancel=60"}
        journal = host.open(name, *([fault[phase]] if phase in fault else []))
        timeouts = Timeouts(accept=30.0, cancel=30.0, result=0.3 if phase == "CANCELING" else None)
        leaf = MoveRobot("m", 9.0, action_name=name, timeout=timeouts)
        with started(leaf, node=node) as runner:
            journal.wait_for("received" if phase == "SENDING" else "accepted")
            until(lambda: state(leaf) == phase)
            if phase == "CANCELING":
                journal.wait_for("cancel_requested")
            closed = host.send(signal.SIGINT)
            until(lambda: leaf.outcome is not None)
            record.took(time.monotonic() - closed, AT_ONCE)
            assert runner.wait(9.0) is Status.FAILURE
            assert runner.unaccounted == []
        wanted = Outcome.RESULT_TIMEOUT if phase == "CANCELING" else Outcome.SERVER_LOST
        assert leaf.outcome is wanted
        assert leaf.end in (End.SERVER_GONE, End.ABORTED, End.CANCELED)
        assert journal.count("accepted") == (0 if phase == "SENDING" else 1)


class TestRestarted:
    @pytest.mark.parametrize(
        "phase",
        [
            pytest.param("SENDING", marks=pytest.mark.chaos),
            "EXECUTING",
            pytest.param("CANCELING", marks=pytest.mark.chaos),
        ],
    )
    def test_restarted_within_the_lease(
        self, new_host: HostFactory, name: str, node: Any, phase: str, record: Record
    ) -> None:
        """SIGKILL with the stock lease, another process with the same name at once; two tries"""
        victim, successor = new_host(short_lease=False), new_host(short_lease=False)
        fault = {"SENDING": "1:delay_accept=60", "CANCELING": "1:delay_cancel=60"}
        old = victim.open(name, *([fault[phase]] if phase in fault else []))
        timeouts = Timeouts(
            server=10.0, accept=2.0, cancel=12.0, result=2.0 if phase == "CANCELING" else None
        )
        retry = Retry(
            2,
            outcomes=frozenset(
                {Outcome.SERVER_LOST, Outcome.RESULT_TIMEOUT, Outcome.ACCEPT_TIMEOUT}
            ),
        )
        leaf = MoveRobot("m", 0.4, action_name=name, timeout=timeouts, retry=retry)
        leaf.goal = lambda: {"distance": 0.3 if leaf.history else 5.0}
        with started(leaf, node=node) as runner:
            until(lambda: state(leaf) == phase)
            old.wait_for("cancel_requested" if phase == "CANCELING" else "received")
            victim.kill()
            journal = successor.open(name)
            opened = journal.wait_for("opened", times=2).t
            until(lambda: leaf.history, 12.0)
            record.took(time.monotonic() - opened, RESTARTED)
            assert runner.wait(20.0) is Status.SUCCESS
            first = leaf.history[0]
            said = (first.outcome, first.end)
            if phase == "SENDING":  # while the dead one is shown, it might still be accepted
                assert first.outcome is Outcome.ACCEPT_TIMEOUT
                until(
                    lambda: first.end is End.SERVER_GONE or ended(first),
                    STOCK,
                    what="gone",
                )
                assert first.end in (End.SERVER_GONE, End.NEVER_STARTED)
        if phase != "SENDING":
            wanted = Outcome.RESULT_TIMEOUT if phase == "CANCELING" else Outcome.SERVER_LOST
            assert said == (wanted, End.SERVER_GONE)
        assert of_process(journal, successor.pid) == ["received", "accepted", "succeeded"]
        assert journal.executed_twice == []
        record.outcome = f"{first.outcome}, end {first.end}; the second try SUCCEEDED"

    @pytest.mark.chaos
    def test_restarted_after_the_lease(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """SIGKILL with the short lease; the successor comes when the loss was noticed"""
        victim, successor = new_host(), new_host()
        victim.open(name)
        lost = MoveRobot("lost", 9.0, action_name=name)
        following = MoveRobot("next", 0.3, action_name=name, timeout=Timeouts(server=10.0))
        with started(in_turn(lost, following), node=node) as runner:
            until(lambda: state(lost) == "EXECUTING")
            killed = victim.kill()
            until(lambda: lost.outcome, 9.0)
            record.took(time.monotonic() - killed, SHORT)
            journal = successor.open(name)
            assert runner.wait(9.0) is Status.SUCCESS
        assert stood(lost) == (Outcome.SERVER_LOST, End.SERVER_GONE)
        assert of_process(journal, successor.pid) == ["received", "accepted", "succeeded"]
        record.outcome = "SERVER_LOST, end SERVER_GONE; the next goal SUCCEEDED"

    @pytest.mark.chaos
    def test_restarted_again_and_again(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """Killed in mid-motion and restarted three times in a row, stock lease, four tries"""
        hosts = [new_host(short_lease=False) for _ in range(4)]
        journal = hosts[0].open(name)
        retry = Retry(4, outcomes=frozenset({Outcome.SERVER_LOST}))
        leaf = MoveRobot("m", 2.0, action_name=name, retry=retry, timeout=Timeouts(server=10.0))
        with started(leaf, node=node) as runner:
            for number, host in enumerate(hosts[1:], start=1):
                journal.wait_for("accepted", times=number, within=15.0)
                until(lambda: state(leaf) == "EXECUTING")
                hosts[number - 1].kill()
                host.open(name)
            assert runner.wait(20.0) is Status.SUCCESS
        assert [each.outcome for each in leaf.history] == [
            *[Outcome.SERVER_LOST] * 3,
            Outcome.SUCCEEDED,
        ]
        assert journal.executed_twice == []
        assert len(journal.ends()) == 4
        record.outcome = "SERVER_LOST three times, then SUCCEEDED"


class TestLate:
    @pytest.mark.chaos
    def test_a_server_that_appears_3_s_late(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """The server comes 3 s after the goal was wanted; server deadline 10 s"""
        host = new_host()
        leaf = MoveRobot("m", 0.3, action_name=name, timeout=Timeouts(server=10.0))
        with started(leaf, node=node) as runner:
            assert holds_for(lambda: leaf.outcome is None, 3.0)
            journal = host.open(name)
            opened = time.monotonic()
            assert runner.wait(9.0) is Status.SUCCESS
            record.took(time.monotonic() - opened, 3.0)
        assert journal.events() == ["received", "accepted", "succeeded"]
        record.outcome = "SUCCEEDED"


class TestTwice:
    def test_two_servers_under_one_name_execute_nothing(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """Two live servers, in two processes, under one name, and both are in sight"""
        one, other = new_host(), new_host()
        one.open(name)
        journal = other.open(name)
        until_shown(node, name, 2)
        leaf = MoveRobot("m", 0.3, action_name=name, retry=3)
        wanted = time.monotonic()
        with TreeRunner(leaf, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.FAILURE
        record.took(time.monotonic() - wanted, 5.0)
        assert stood(leaf) == (Outcome.SERVER_AMBIGUOUS, End.NEVER_STARTED)
        assert journal.events() == []
        assert len(leaf.history) == 1
        record.outcome = "SERVER_AMBIGUOUS, end NEVER_STARTED"

    def test_a_second_server_that_wakes_up_and_takes_the_goal_too(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """Two servers, one is too busy and looks dead; it goes on with the request in its queue"""
        one, other = new_host(short_lease=False), new_host(short_lease=False)
        one.open(name)
        journal = other.open(name)
        leaf = MoveRobot("m", 40.0, action_name=name, timeout=Timeouts(server=20.0))
        until_both_hear(leaf, node)
        other.freeze()
        with started(leaf, node=node) as runner:
            until(lambda: leaf.progress().feedback is not None, 20.0)
            woken = other.thaw()
            assert runner.wait(15.0) is Status.FAILURE
            record.took(time.monotonic() - woken, 5.0)
        assert stood(leaf) == (Outcome.SERVER_AMBIGUOUS, End.CANCELED)
        for each in (one, other):
            assert of_process(journal, each.pid) == CANCELED
        record.outcome = "SERVER_AMBIGUOUS, canceled at both"

    @pytest.mark.chaos
    @pytest.mark.parametrize(
        "answer",
        ["heard", "lost", "lost, and no feedback"],
    )
    def test_a_second_server_that_wakes_up_when_the_goal_has_ended(
        self, new_host: HostFactory, name: str, node: Any, answer: str, record: Record
    ) -> None:
        """The same when the first has succeeded, and one more goal; the answer heard, or lost"""
        one, other = new_host(short_lease=False), new_host(short_lease=False)
        one.open(name)
        faults = {"heard": [], "lost": ["*:drop_accept"]}
        faults["lost, and no feedback"] = ["*:drop_accept", "*:no_feedback"]
        journal = other.open(name, "*:slow=100", *faults[answer])
        leaf = MoveRobot("m", 0.3, action_name=name, timeout=Timeouts(server=20.0))
        until_both_hear(leaf, node)
        other.freeze()
        more = MoveRobot("more", 0.3, action_name=name, timeout=Timeouts(server=20.0))
        with TreeRunner(leaf, node=node) as runner:
            assert runner.run(30.0) is Status.SUCCESS
            woken = other.thaw()
            until(lambda: "canceled" in of_process(journal, other.pid), 10.0)
            record.took(time.monotonic() - woken, 8.0)
            with TreeRunner(more, node=node) as second:
                assert second.run(30.0) is Status.FAILURE
            until(lambda: runner.unaccounted == [])
            assert more.outcome is Outcome.SERVER_AMBIGUOUS
        assert stood(leaf) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert of_process(journal, one.pid)[:3] == ["received", "accepted", "succeeded"]
        assert of_process(journal, other.pid)[:5] == CANCELED
        assert stood(more) == (Outcome.SERVER_AMBIGUOUS, End.NEVER_STARTED)
        record.outcome = "SUCCEEDED; what the second server took is canceled"

    @pytest.mark.chaos
    def test_a_second_server_that_is_seen_in_part_leaves_the_firsts_goal_alone(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """The name is made not ready, as rmw has it where half of a second one is discovered"""
        one = new_host()
        journal = one.open(name, "*:no_feedback")
        leaf = MoveRobot("m", 40.0, action_name=name, timeout=Timeouts(server=20.0))
        with started(leaf, node=node):
            until(lambda: state(leaf) == "EXECUTING", 20.0)
            with process.lock:
                traffic_of(node)._endpoints[name].transport.ready = lambda: False
            assert holds_for(lambda: leaf.outcome is None, 2 * NOT_READY_FOR)
            assert journal.events() == ["received", "accepted"]
        assert stood(leaf) == (Outcome.CANCELED, End.CANCELED)
        assert of_process(journal, one.pid) == CANCELED
        record.outcome = "runs on; CANCELED when it is not wanted any more"

    @pytest.mark.chaos
    def test_a_busy_server_that_was_heard_beside_the_second_is_not_taken_for_dead(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """It answers nobody for 6 s, accepts, and is busy again for 7 s; a second server comes"""
        one, other = new_host(), new_host()
        journal = one.open(name, "*:no_feedback", thinks=6.0, busy=4.0 + SLOWEST_START)
        leaf = MoveRobot("m", 0.3, action_name=name, timeout=Timeouts(accept=30.0))
        with started(leaf, node=node) as runner:
            until(lambda: state(leaf) == "SENDING")
            other.open(name)
            assert runner.wait(30.0) is Status.SUCCESS
        assert stood(leaf) == (Outcome.SUCCEEDED, End.SUCCEEDED)
        assert of_process(journal, one.pid) == ["received", "accepted", "succeeded"]
        assert of_process(journal, other.pid) == []
        record.outcome = "runs on; SUCCEEDED"

    @pytest.mark.chaos
    def test_what_a_second_server_denies_the_first_may_still_start(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """Too busy to answer, a second one comes, which denies the goal; tried again if so told"""
        one, other = new_host(), new_host()
        journal = one.open(name, "*:slow=100")
        again = Retry(3, outcomes=["ACCEPT_TIMEOUT"])
        leaf = MoveRobot("m", 9.0, action_name=name, timeout=Timeouts(accept=1.5), retry=again)
        until_heard(leaf, node)
        one.freeze()
        with started(leaf, node=node) as runner:
            until(lambda: state(leaf) == "SENDING")
            other.open(name)
            assert runner.wait(30.0) is Status.FAILURE
            assert leaf.outcome is Outcome.ACCEPT_TIMEOUT
            assert leaf.end in (End.SERVER_GONE, End.UNKNOWN), "it has not said that it never did"
            one.thaw()
            until(lambda: "canceled" in of_process(journal, one.pid))
            until(lambda: leaf.end is End.CANCELED)
        assert len(leaf.history) == 1
        assert of_process(journal, other.pid) == []
        record.outcome = "ACCEPT_TIMEOUT, not tried again; canceled when it is accepted"

    @pytest.mark.parametrize(
        "loop", ["our runner", pytest.param("a foreign loop", marks=pytest.mark.chaos)]
    )
    def test_shutdown_waits_for_what_the_second_server_took(
        self, new_host: HostFactory, name: str, node: Any, loop: str, record: Record
    ) -> None:
        """The second server wakes up when the run is over, and takes 1.5 s to cancel; shutdown"""
        one, other = new_host(short_lease=False), new_host(short_lease=False)
        one.open(name)
        journal = other.open(name, "*:slow=100", "*:delay_cancel=1.5")
        leaf = MoveRobot("m", 0.3, action_name=name, timeout=Timeouts(server=20.0))
        until_both_hear(leaf, node)
        other.freeze()
        runner = TreeRunner(leaf, node=node)
        assert runner.run(30.0) is Status.SUCCESS
        told = list[Event]()
        runner.observe_events(told.append)
        other.thaw()
        until(lambda: not leaf.drained, 10.0)
        if loop == "a foreign loop":
            runner.tree.shutdown()
            assert leaf.drained
        runner.shutdown()
        assert "canceled" in of_process(journal, other.pid)
        ends = [(event.outcome, event.end) for event in told if isinstance(event, GoalChanged)]
        assert ends[-1] == (Outcome.SERVER_AMBIGUOUS, End.CANCELED)
        assert leaf.drained
        assert runner.unaccounted == []
        runner.shutdown()
        record.outcome = "SUCCEEDED; what the second server took is canceled before it returns"

    @pytest.mark.chaos
    def test_a_leaf_is_not_drained_while_the_second_server_refuses_to_cancel(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """The second server wakes up when the run is over, and refuses to cancel; shutdown"""
        one, other = new_host(short_lease=False), new_host(short_lease=False)
        one.open(name)
        other.open(name, "*:slow=100", "*:reject_cancel")
        leaf = MoveRobot("m", 0.3, action_name=name, timeout=Timeouts(server=20.0, cancel=0.5))
        until_both_hear(leaf, node)
        other.freeze()
        with TreeRunner(leaf, node=node) as runner:
            assert runner.run(30.0) is Status.SUCCESS
            other.thaw()
            until(lambda: not leaf.drained, 10.0)
        assert not leaf.drained
        assert [report.name for report in runner.unaccounted] == ["m"]
        record.outcome = "told as unaccounted for, also by the leaf, after shutdown"

    @pytest.mark.chaos
    def test_a_goal_that_turns_up_when_its_leaf_is_gone_is_reported_by_name(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """A leaf leaves the tree between runs; then a second server wakes, and refuses to cancel"""
        one, other = new_host(short_lease=False), new_host(short_lease=False)
        one.open(name)
        other.open(name, "*:slow=100", "*:reject_cancel")
        leaf = MoveRobot("first", 0.3, action_name=name, timeout=Timeouts(server=20.0))
        stays = MoveRobot("stays", 0.3, action_name=name, timeout=Timeouts(server=20.0))
        until_both_hear(leaf, node)
        other.freeze()
        root = in_sequence(leaf)
        with TreeRunner(root, node=node) as runner:
            assert runner.run(30.0) is Status.SUCCESS
            root.remove_child(leaf)
            root.add_child(stays)
            del leaf
            assert runner.run(30.0) is Status.SUCCESS
            gc.collect()
            other.thaw()
            names = {"first", "stays"}
            until(lambda: {report.name for report in runner.unaccounted} == names, 10.0)
        record.outcome = "told as unaccounted for, by its name"

    def test_a_dead_server_still_shown_is_not_a_second_one(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """A server was killed (stock lease: shown for 20 s), its successor is up: a new goal"""
        victim, successor = new_host(short_lease=False), new_host(short_lease=False)
        victim.open(name)
        warm = MoveRobot("warm", 0.1, action_name=name)
        leaf = MoveRobot("m", 0.3, action_name=name, timeout=Timeouts(server=10.0))
        with TreeRunner(warm, node=node) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
            victim.kill()
            journal = successor.open(name)
            until_shown(node, name, 2)
            wanted = time.monotonic()
            with TreeRunner(leaf, node=node) as second:
                assert second.run(timeout=15.0) is Status.SUCCESS
            record.took(time.monotonic() - wanted, 10.0)
        assert of_process(journal, successor.pid) == ["received", "accepted", "succeeded"]
        assert journal.executed_twice == []
        record.outcome = "SUCCEEDED, executed once"

    @pytest.mark.chaos
    def test_two_of_two_are_killed_and_one_comes_back(
        self, new_host: HostFactory, name: str, node: Any, record: Record
    ) -> None:
        """Two live servers, one of them is killed (short lease): goals go to the other again"""
        one, other = new_host(), new_host()
        one.open(name)
        journal = other.open(name)
        until_shown(node, name, 2)
        refused = MoveRobot("refused", 0.3, action_name=name)
        leaf = MoveRobot("m", 0.3, action_name=name, timeout=Timeouts(server=15.0))
        tree = in_turn(refused, in_sequence(leaf))
        with started(tree, node=node) as runner:
            until(lambda: refused.outcome, 9.0)
            runner.pause()
            killed = other.kill()
            until_shown(node, name, 1)
            runner.resume()
            runner.wait(15.0)
            record.took(time.monotonic() - killed, 10.0)
        if leaf.outcome is Outcome.SERVER_AMBIGUOUS:  # it was asked before the pause took hold
            leaf = MoveRobot("again", 0.3, action_name=name)
            with TreeRunner(leaf, node=node) as runner:
                runner.run(timeout=9.0)
        assert leaf.outcome is Outcome.SUCCEEDED
        assert of_process(journal, other.pid) == []
        assert of_process(journal, one.pid) == ["received", "accepted", "succeeded"]
        record.outcome = "SERVER_AMBIGUOUS while both live, then SUCCEEDED"


def ended(record: AttemptRecord) -> bool:
    return record.goal.lost or record.goal.state is State.DONE


def of_process(journal: Journal, pid: int) -> list[str]:
    """The events of the goals that one process has received, without the steps."""
    entries = [e for e in journal.entries() if e.pid == pid and e.event != "step"]
    received = {e.goal for e in entries if e.event == "received"}
    return [str(e.event) for e in entries if e.goal in received]
