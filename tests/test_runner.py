"""The runner: what it returns and raises, what it drains, and that it leaves nothing behind."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import Any

import py_trees
import pytest
import rclpy
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Running
from py_trees.common import Status
from rclpy.executors import SingleThreadedExecutor

from bt_actions import End, MoveRobot, Outcome, TreeError, TreeRunner
from bt_actions.events import Event, GoalChanged, RunBegan, TreeFinished
from bt_actions.ros import spinning
from bt_actions.running import threads
from bt_actions.running.threads import StartedRun
from bt_actions.story.state import State
from bt_actions.story.why import why
from tests.conftest import OUR_OWN
from tests.support.processes import Host, Journal
from tests.support.stories import changes_of
from tests.support.trees import Gate, Raises, in_sequence, started, state, together
from tests.support.waiting import until


@pytest.fixture
def journal(host: Host, name: str) -> Iterator[Journal]:
    """A server without faults, and what it writes."""
    yield host.open(name)
    host.close_server(name)


@contextlib.contextmanager
def spun(node: Any, kind: str = "single") -> Iterator[Any]:
    """Spin `node` as its user does."""
    from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor

    classes = {"single": SingleThreadedExecutor, "multi": MultiThreadedExecutor}
    executor = classes[kind](context=node.context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        yield executor
    finally:
        executor.shutdown()
        thread.join()
        if kind == "multi":
            executor._executor.shutdown(wait=True)
        node.executor = None


class TestRun:
    @pytest.mark.parametrize("executor", ["multi", "single"])
    def test_on_a_node_of_its_own(self, journal: Journal, name: str, executor: str) -> None:
        leaf = MoveRobot("m", 0.1, action_name=name)
        with TreeRunner(leaf, executor=executor) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
            assert runner.node.context.ok()
            context = runner.node.context
        assert not context.ok()
        assert journal.ends() == ["succeeded"]

    def test_a_namespace_is_that_of_its_own_node(self, journal: Journal, name: str) -> None:
        namespace, _, action = name.rpartition("/")
        leaf = MoveRobot("m", 0.1, action_name=action)
        with TreeRunner(leaf, namespace=namespace) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
        assert journal.ends() == ["succeeded"]

    def test_in_a_place_that_is_told(self, node: Any) -> None:
        with TreeRunner(py_trees.behaviours.Success("s"), node=node) as runner:
            begun: list[Event] = []
            runner.observe_events(begun.append)
            runner.run(timeout=9.0)
        assert isinstance(begun[0], RunBegan)
        assert begun[0].where == {
            "node": node.get_fully_qualified_name(),
            "domain": str(node.context.get_domain_id()),
            "host": socket.gethostname(),
        }

    def test_again_and_again(self, journal: Journal, name: str, node: Any) -> None:
        leaf = MoveRobot("m", 0.05, action_name=name)
        with TreeRunner(leaf, node=node) as runner:
            for _ in range(5):
                assert runner.run(timeout=9.0) is Status.SUCCESS
        assert journal.ends() == ["succeeded"] * 5

    def test_a_behaviour_tree_keeps_its_handlers_and_visitors(
        self, journal: Journal, name: str, node: Any
    ) -> None:
        tree = py_trees.trees.BehaviourTree(MoveRobot("m", 0.1, action_name=name))
        ticks: list[int] = []
        tree.add_post_tick_handler(lambda tree: ticks.append(tree.count))
        with TreeRunner(tree, node=node) as runner:
            runner.run(timeout=9.0)
        assert ticks
        assert tree.visitors == []

    def test_a_second_run_at_a_time_is_refused(self, node: Any) -> None:
        gate = Gate()
        with started(gate, node=node) as runner:
            with pytest.raises(RuntimeError, match="running already"):
                runner.run()
            with pytest.raises(RuntimeError, match="already"):
                runner.start()
            gate.passed = True
            assert runner.wait(5.0) is Status.SUCCESS

    def test_after_shutdown_it_raises(self, node: Any) -> None:
        runner = TreeRunner(Gate(), node=node)
        runner.shutdown()
        runner.shutdown()
        with pytest.raises(RuntimeError, match="shut down"):
            runner.run()

    def test_a_heartbeat_of_nothing_is_refused(self) -> None:
        with pytest.raises(ValueError, match="heartbeat"):
            TreeRunner(Gate(), heartbeat=0.0)

    @pytest.mark.parametrize("wrong", [float("nan"), "3"])
    def test_a_timeout_that_is_no_number_is_refused(self, node: Any, wrong: Any) -> None:
        with TreeRunner(Gate(), node=node) as runner:
            for call in runner.run, runner.wait:
                with pytest.raises(ValueError, match="timeout must be a number of seconds"):
                    call(wrong)

    def test_an_unknown_executor_is_refused_and_leaves_nothing(self, domain: int) -> None:
        before = threading.active_count()
        with pytest.raises(ValueError, match="'multi', 'single'"):
            TreeRunner(Gate(), executor="fast")
        assert threading.active_count() == before


def called(executor: Any, call: Callable[[], Any]) -> Any:
    """Return what `call` returns in a callback of the executor, or the error that it raises."""
    told: list[Any] = []

    def callback() -> None:
        try:
            told.append(call())
        except Exception as error:  # noqa: BLE001 - whatever it is
            told.append(error)

    executor.create_task(callback)
    until(lambda: told, 20.0)
    return told[0]


class TestInACallback:
    @pytest.mark.parametrize(("kind", "how"), [("single", "start"), ("multi", "run")])
    def test_of_another_executor_a_runner_on_its_own_node_works_and_leaves_nothing(
        self, journal: Journal, name: str, node: Any, kind: str, how: str
    ) -> None:
        def offer() -> Status:
            with TreeRunner(MoveRobot("m", 0.1, action_name=name)) as runner:
                if how == "run":
                    return runner.run(timeout=9.0)
                runner.start()
                return runner.wait()

        with spun(node, kind) as executor:
            called(executor, lambda: None)  # each pool has its threads by now
            called(executor, lambda: None)
            before = set(threading.enumerate())
            assert called(executor, offer) is Status.SUCCESS
            left = {each for each in set(threading.enumerate()) - before if each.is_alive()}
        assert [each.name for each in left if each.name not in OUR_OWN] == []

    def test_of_a_multi_threaded_executor_a_runner_on_its_node_works(
        self, journal: Journal, name: str, node: Any
    ) -> None:
        with (
            spun(node, "multi") as executor,
            TreeRunner(MoveRobot("m", 0.1, action_name=name), node=node) as runner,
        ):
            assert called(executor, lambda: runner.run(timeout=9.0)) is Status.SUCCESS

    @pytest.mark.parametrize("whose", ["the user's", "its own"])
    def test_of_the_executor_that_this_thread_has_to_spin_it_says_what_to_do(
        self, node: Any, whose: str
    ) -> None:
        def waits(runner: TreeRunner) -> Status:
            runner.start()
            return runner.wait()

        def within(runner: TreeRunner) -> Status:
            with runner:
                return runner.run()

        with contextlib.ExitStack() as stack:
            if whose == "the user's":
                stack.enter_context(spun(node))
            runner = stack.enter_context(TreeRunner(py_trees.behaviours.Success("s"), node=node))
            runner.run()  # it spins from now on
            for call in [waits, within] if whose == "the user's" else [within]:
                error = called(runner.executor, lambda call=call: call(runner))
                assert isinstance(error, RuntimeError)
                assert "in a done callback of `future`" in str(error)


class TestWithNothingSaid:
    def test_runners_share_a_node_and_a_spin_thread_until_the_last_is_shut_down(
        self, journal: Journal, name: str
    ) -> None:
        closed = list[bool]()
        leaves = [MoveRobot(f"m{at}", 0.1, action_name=name, busy="wait") for at in range(3)]
        first, *others = runners = [TreeRunner(leaf) for leaf in leaves]
        assert {runner.node for runner in others} == {first.node}
        first.on_close(lambda: closed.append("bt_actions-spin" in names_of_threads()))
        for runner in runners:
            runner.start()
        assert {runner.wait(9.0) for runner in runners} == {Status.SUCCESS}
        assert names_of_threads().count("bt_actions-spin") == 1
        first.shutdown()
        assert closed == [False]
        for runner in others:
            assert runner.run(9.0) is Status.SUCCESS
            runner.shutdown()
        assert not first.node.context.ok()
        assert journal.ends() == ["succeeded"] * 5

    def test_one_that_says_something_or_finds_other_settings_has_a_node_of_its_own(
        self, domain: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with contextlib.ExitStack() as stack:
            first = stack.enter_context(TreeRunner(Running("r")))
            named = stack.enter_context(TreeRunner(Running("r"), name="named"))
            monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
            unseen = stack.enter_context(TreeRunner(Running("r")))
            assert len({first.node, named.node, unseen.node}) == 3

    def test_a_leaf_of_the_users_has_the_node_to_itself(self, domain: int) -> None:
        class Declares(Behaviour):
            def setup(self, node: Any, **_: Any) -> None:
                node.declare_parameter("speed", 1.0)

            def update(self) -> Status:
                return Status.SUCCESS

        trees = [in_sequence(Declares("d")) for _ in range(2)]
        with TreeRunner(trees[0]) as one, TreeRunner(trees[1]) as other:
            assert [one.run(9.0), other.run(9.0)] == [Status.SUCCESS] * 2

    def test_they_run_in_callbacks_of_the_executor_that_they_share(
        self, journal: Journal, name: str
    ) -> None:
        """More of them than that has threads."""
        leaves = [MoveRobot(f"m{at}", 0.1, action_name=name, busy="wait") for at in range(4)]
        runners, statuses = [TreeRunner(leaf) for leaf in leaves], list[Status]()
        with started(Running("r")) as outer:
            for each in runners:
                outer.executor.create_task(lambda each=each: statuses.append(each.run(9.0)))
            until(lambda: len(statuses) == len(leaves), 20.0)
            within = called(outer.executor, lambda: TreeRunner(Running("r")))
            assert within.node is not outer.node, "who made it may wait for it"
            for runner in [*runners, within]:
                runner.shutdown()
            outer.interrupt()
        assert statuses == [Status.SUCCESS] * len(leaves)


def names_of_threads() -> list[str]:
    return [each.name for each in threading.enumerate()]


class TestFuture:
    def test_has_the_status_of_the_run_that_was_started(self, node: Any) -> None:
        gate, told = Gate(), list[Any]()
        with TreeRunner(gate, node=node) as runner:
            with pytest.raises(RuntimeError, match="not been started"):
                _ = runner.future
            assert not runner.running
            runner.start()
            assert runner.running
            runner.future.add_done_callback(lambda f: told.append((f.result(), runner.running)))
            assert not runner.future.cancel()
            gate.passed = True
            assert runner.future.result(9.0) is Status.SUCCESS
            until(lambda: told)
            assert told == [(Status.SUCCESS, False)]

    def test_has_what_the_run_raised(self, node: Any, capfd: pytest.CaptureFixture[str]) -> None:
        with started(Raises("culprit", "update"), node=node) as runner:
            assert isinstance(runner.future.exception(9.0), TreeError)
        assert "the tree that was started raised TreeError: culprit" in capfd.readouterr().err

    def test_may_be_awaited(self, node: Any) -> None:
        async def awaits() -> Status:
            with started(py_trees.behaviours.Success("s"), node=node) as runner:
                return await asyncio.wrap_future(runner.future)

        assert asyncio.run(awaits()) is Status.SUCCESS

    def test_a_done_callback_may_start_the_next_run_and_shut_down(self, node: Any) -> None:
        gate, statuses, is_down = Gate(), list[Status](), threading.Event()

        def next_one(future: Any) -> None:
            statuses.append(future.result())
            if len(statuses) < 3:
                runner.start()
                runner.future.add_done_callback(next_one)
            else:
                runner.shutdown()
                is_down.set()

        runner = TreeRunner(gate, node=node)
        runner.start()
        runner.future.add_done_callback(next_one)
        gate.passed = True
        assert is_down.wait(9.0)
        assert statuses == [Status.SUCCESS] * 3
        assert node.executor is None


class TestOneRunAtATime:
    @pytest.mark.parametrize("part", ["the same root", "a subtree"])
    def test_a_tree_that_runs_in_another_runner_is_refused_and_both_are_named(
        self, node: Any, part: str
    ) -> None:
        inner = in_sequence(Gate(), name="inner")
        root = in_sequence(inner, name="root")
        with TreeRunner(root, node=node) as runner:
            runner.start()
            with TreeRunner(root if part == "the same root" else inner) as other:
                here, there = (r.node.get_fully_qualified_name() for r in (other, runner))
                for call in other.run, other.start:
                    with pytest.raises(RuntimeError, match=f"{here}: root is running .* {there},"):
                        call()
                runner.interrupt()
                runner.wait()
                other.interrupt()
                assert other.run() is Status.INVALID

    def test_who_never_ran_a_tree_does_not_shut_it_down(self, node: Any) -> None:
        root = ShutsDown("root")
        with started(root, node=node) as runner:
            until(lambda: root.status is Status.RUNNING)
            TreeRunner(root).shutdown()
            assert not root.downs
            root.passed = True
            assert runner.wait(5.0) is Status.SUCCESS
        assert root.downs == 1


class ShutsDown(Gate):
    """Counts how often it was shut down."""

    downs = 0

    def shutdown(self) -> None:
        self.downs += 1


class Stuck(Behaviour):
    """Does not return from its first tick after its cue until it is let go; then SUCCESS."""

    def __init__(self, cue: Callable[[], object], name: str = "Stuck") -> None:
        super().__init__(name)
        self.cue = cue
        self.entered, self.may_return = threading.Event(), threading.Event()

    def update(self) -> Status:
        if self.cue():
            self.entered.set()
            assert self.may_return.wait(30.0)
        return Status.SUCCESS if self.entered.is_set() else Status.RUNNING


class TestStuckInATick:
    """A behaviour that does not return must not keep the goals of a tree alive that is to end."""

    def test_a_reader_is_told_in_whose_tick_the_tree_is_though_it_wants_no_goal(
        self, node: Any
    ) -> None:
        stuck, run = Stuck(lambda: True), State()

        def told() -> list[str]:
            for event in reader.take():
                run.fold(event)
            return why(run, time.monotonic())

        with TreeRunner(in_sequence(stuck, name="Look"), node=node) as runner:
            reader = runner.stream.reader()
            runner.start()
            until(lambda: [each for each in told() if each.startswith("Stuck: in its tick for 1.")])
            stuck.may_return.set()
            assert runner.wait(9.0) is Status.SUCCESS
        told()
        assert run.lasting is None

    def test_the_goals_are_canceled_all_the_same(
        self, journal: Journal, name: str, node: Any, capfd: Any
    ) -> None:
        leaf = MoveRobot("m", 30.0, action_name=name)
        stuck = Stuck(lambda: state(leaf) == "EXECUTING")
        with started(together(leaf, in_sequence(stuck, name="Look")), node=node) as runner:
            assert stuck.entered.wait(9.0)
            runner.interrupt()
            until(lambda: journal.ends() == ["canceled"], 9.0)
            assert runner.running
            stuck.may_return.set()
        assert (leaf.outcome, leaf.end) == (Outcome.CANCELED, End.CANCELED)
        told = "together/Look/Stuck does not return from its tick"
        until(lambda: told in capfd.readouterr().err)


class TestInterrupt:
    def test_drains_and_returns_invalid(
        self, journal: Journal, name: str, node: Any, executor: str
    ) -> None:
        leaf = MoveRobot("m", 9.0, action_name=name)
        with started(leaf, node=node, executor=executor) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            runner.interrupt()
            assert runner.wait(5.0) is Status.INVALID
            assert journal.ends() == ["canceled"]

    def test_is_safe_in_a_signal_handler(self, journal: Journal, name: str, node: Any) -> None:
        leaf = MoveRobot("m", 9.0, action_name=name)
        with TreeRunner(leaf, node=node) as runner:
            before = signal.signal(signal.SIGUSR2, lambda *_: runner.interrupt())
            runner.observe_events(
                lambda event: (
                    os.kill(os.getpid(), signal.SIGUSR2)
                    if isinstance(event, GoalChanged) and event.state == "EXECUTING"
                    else None
                )
            )
            try:
                assert runner.run(timeout=9.0) is Status.INVALID
            finally:
                signal.signal(signal.SIGUSR2, before)
        assert journal.ends() == ["canceled"]


class TestStart:
    def test_inside_a_node_that_its_user_spins(
        self, journal: Journal, name: str, node: Any, executor: str
    ) -> None:
        with (
            spun(node, executor),
            TreeRunner(MoveRobot("m", 0.1, action_name=name), node=node) as runner,
        ):
            runner.start()
            assert runner.wait(5.0) is Status.SUCCESS

    def test_a_run_takes_the_thread_of_one_that_is_over_until_that_ends(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(threads, "_at_rest", at_rest := list[Any]())
        said, found = ContextVar("said", default="nothing"), list[tuple[str, threading.Thread]]()

        def runs(at_once: int) -> None:
            gate = threading.Barrier(at_once)

            def work() -> Status:
                gate.wait()
                found.append((said.get(), threading.current_thread()))
                said.set("something, in the context of this run alone")
                return Status.SUCCESS

            every = [StartedRun(work, print) for _ in range(at_once)]
            for call in (StartedRun.start, StartedRun.join):
                for each in every:
                    call(each)

        for at_once in (2, 1, 2):
            runs(at_once)
            until(lambda: len(at_rest) == 2)
        monkeypatch.setattr(threads, "LINGER", 0.01)
        runs(2)
        assert [len({*each}) for each in zip(*found, strict=True)] == [1, 2]
        until(lambda: not at_rest)
        until(lambda: not any(thread.is_alive() for _, thread in found))

    def test_sigint_while_its_thread_starts_leaves_a_run_that_can_be_ended(
        self, node: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        start = threading.Thread.start

        def interrupted(thread: threading.Thread) -> None:
            is_ours = thread.name == "bt_actions-rest"
            start(thread)
            if is_ours:
                raise KeyboardInterrupt

        monkeypatch.setattr(threads, "_at_rest", [])
        monkeypatch.setattr(threading.Thread, "start", interrupted)
        with TreeRunner(Gate(), node=node) as runner, pytest.raises(KeyboardInterrupt):
            runner.start()
        assert runner.future.result(0.0) is Status.INVALID

    def test_wait_gives_up_and_the_tree_goes_on(self, node: Any) -> None:
        gate = Gate()
        with started(gate, node=node) as runner:
            with pytest.raises(TimeoutError, match=r"is still running after 0.05 s$"):
                runner.wait(0.05)
            gate.passed = True
            assert runner.wait(5.0) is Status.SUCCESS

    def test_wait_without_start_raises(self, node: Any) -> None:
        with TreeRunner(Gate(), node=node) as runner, pytest.raises(RuntimeError, match="started"):
            runner.wait()

    def test_wait_raises_what_run_would(self, node: Any) -> None:
        culprit = Raises("culprit", "update")
        with started(culprit, node=node) as run, pytest.raises(TreeError, match="culprit"):
            run.wait(5.0)

    @pytest.mark.parametrize("last", [GoalChanged, TreeFinished])
    def test_shutdown_by_an_observer_is_refused(
        self, journal: Journal, name: str, node: Any, last: type[Event]
    ) -> None:
        """It would wait for the run that waits for it; the observer is dropped, the run goes on."""

        def observer(event: Event) -> None:
            if isinstance(event, last):
                try:
                    runner.shutdown()
                except RuntimeError as error:
                    told.append(str(error))

        told: list[str] = []
        with TreeRunner(MoveRobot("m", 0.1, action_name=name), node=node) as runner:
            runner.observe_events(observer)
            runner.start()
            assert runner.wait(5.0) is Status.SUCCESS
        assert "interrupt()" in told[0]


class TestWhoSpins:
    def test_a_node_in_an_executor_that_nobody_spins_is_an_error(
        self, node: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(spinning, "PATIENCE_SPUN", 0.5)
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        started = time.monotonic()
        with (
            TreeRunner(Gate(), node=node) as runner,
            pytest.raises(RuntimeError, match="nobody spins"),
        ):
            runner.run(timeout=9.0)
        assert 0.5 <= time.monotonic() - started < 9.0
        executor.shutdown()
        node.executor = None

    def test_an_executor_of_the_users_that_is_shut_down_ends_the_run_at_once(
        self, journal: Journal, name: str, node: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(spinning, "PATIENCE_SPUN", 60.0)
        leaf = MoveRobot("m", 0.5, action_name=name)
        with contextlib.ExitStack() as stack:
            theirs = contextlib.ExitStack()
            theirs.enter_context(spun(node))
            runner = stack.enter_context(TreeRunner(leaf, node=node))
            runner.start()
            until(lambda: state(leaf) == "EXECUTING")
            theirs.close()
            with pytest.raises(RuntimeError, match="was shut down"):
                runner.wait(9.0)
        assert journal.ends() in (["succeeded"], ["canceled"])

    @pytest.mark.parametrize(
        "whose", ["the executor's", pytest.param("rclpy's", marks=pytest.mark.chaos)]
    )
    def test_a_loop_that_spins_once_now_and_then_spins(
        self, journal: Journal, name: str, node: Any, whose: str
    ) -> None:
        executor, over = SingleThreadedExecutor(context=node.context), threading.Event()
        executor.add_node(node)

        def loop() -> None:
            while not over.wait(0.05):
                if whose == "rclpy's":  # puts the node in and out each time
                    rclpy.spin_once(node, executor=executor, timeout_sec=0.0)
                else:
                    executor.spin_once(timeout_sec=0.0)

        thread = threading.Thread(target=loop)
        with TreeRunner(MoveRobot("m", 1.5, action_name=name), node=node) as runner:
            if whose == "rclpy's":
                executor.remove_node(node)
            thread.start()
            assert runner.run(timeout=20.0) is Status.SUCCESS
        over.set()
        thread.join()
        executor.shutdown()
        node.executor = None

    @pytest.mark.parametrize("whose", ["the user's", "its own"])
    def test_a_behaviour_that_spins_the_node_is_named(self, node: Any, whose: str) -> None:
        class Asks(Behaviour):
            def update(self) -> Status:
                theirs = SingleThreadedExecutor(context=node.context)
                theirs.add_node(node)
                theirs.spin_until_future_complete(theirs.create_task(lambda: None), 5.0)
                theirs.remove_node(node)
                theirs_all.append(theirs)
                return Status.RUNNING

        theirs_all: list[SingleThreadedExecutor] = []
        with contextlib.ExitStack() as stack:
            if whose == "the user's":
                stack.enter_context(spun(node))
            runner = stack.enter_context(TreeRunner(in_sequence(Asks("asks")), node=node))
            with pytest.raises(TreeError, match="sequence / asks: node /tests was taken out of"):
                runner.run(timeout=9.0)
        for each in theirs_all:
            each.shutdown()
        node.executor = None

    @pytest.mark.parametrize(
        "how", ["shut down", pytest.param("node removed", marks=pytest.mark.chaos)]
    )
    def test_an_executor_that_is_taken_away_fails_the_tree(
        self, journal: Journal, name: str, executor: str, how: str
    ) -> None:
        leaf = MoveRobot("m", 9.0, action_name=name)
        with started(leaf, executor=executor) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            if how == "shut down":
                runner.executor.shutdown()
            else:
                runner.executor.remove_node(runner.node)
            with pytest.raises(TreeError, match="was taken out of its executor, or that was shut"):
                runner.wait(5.0)
            assert journal.ends() == ["canceled"]
            assert runner.unaccounted == []
            with pytest.raises(TreeError, match="was taken out of its executor, or that was shut"):
                runner.run(timeout=5.0)

    def test_a_context_that_is_shut_down_under_the_tree_ends_it(
        self, journal: Journal, name: str, executor: str
    ) -> None:
        leaf = MoveRobot("m", 9.0, action_name=name, retry=3)
        with started(in_sequence(leaf, Gate()), executor=executor) as runner:
            until(lambda: state(leaf) == "EXECUTING")
            runner.node.context.shutdown()
            try:
                assert runner.wait(9.0) is not Status.SUCCESS
            except TreeError as error:
                assert "context" in str(error) or "spin" in str(error)  # noqa: PT017
        assert journal.ends() == ["canceled"]

    def test_a_node_that_is_in_an_executor_is_spun_by_its_owner(
        self, journal: Journal, name: str, node: Any, executor: str
    ) -> None:
        leaf = MoveRobot("m", 0.1, action_name=name)
        with spun(node) as theirs:
            with TreeRunner(leaf, node=node, executor=executor) as runner:
                assert runner.executor is theirs
                assert runner.run(timeout=9.0) is Status.SUCCESS
            another = SingleThreadedExecutor(context=node.context)
            with pytest.raises(ValueError, match="is in another executor than the one given"):
                TreeRunner(leaf, node=node, executor=another)
            another.shutdown()
            assert node.executor is theirs

    def test_an_executor_without_nodes_is_spun_here(
        self, journal: Journal, name: str, node: Any
    ) -> None:
        executor = SingleThreadedExecutor(context=node.context)
        leaf = MoveRobot("m", 0.1, action_name=name)
        with TreeRunner(leaf, node=node, executor=executor) as runner:
            assert runner.run(timeout=9.0) is Status.SUCCESS
        executor.shutdown()

    def test_an_executor_that_was_given_stays_usable(
        self, journal: Journal, name: str, node: Any
    ) -> None:
        executor = SingleThreadedExecutor(context=node.context)
        for _ in range(2):
            leaf = MoveRobot("m", 0.1, action_name=name)
            with TreeRunner(leaf, node=node, executor=executor) as runner:
                assert runner.run(timeout=9.0) is Status.SUCCESS
        done = threading.Event()
        executor.create_task(done.set)
        executor.spin_once(timeout_sec=1.0)
        assert done.is_set()
        executor.shutdown()


class TestEvents:
    def test_come_in_order(self, journal: Journal, name: str, node: Any) -> None:
        events: list[Event] = []
        leaf = MoveRobot("m", 0.2, action_name=name)
        with TreeRunner(in_sequence(leaf, name="root"), node=node) as runner:
            runner.observe_events(events.append)
            runner.run(timeout=9.0)
        assert isinstance(events[0], RunBegan)
        assert isinstance(events[-1], TreeFinished)
        assert events[-1].status is Status.SUCCESS
        assert [event.at.number for event in events] == list(range(1, len(events) + 1))
        times = [event.at.steady for event in events]
        assert times == sorted(times)
        states = [event.state for event in events if isinstance(event, GoalChanged)]
        order = ["QUEUED", "WAITING_FOR_SERVER", "SENDING", "EXECUTING", "DONE"]
        assert [each for each in order if each in states] == states
        assert states[-3:] == ["SENDING", "EXECUTING", "DONE"]
        last = [event for event in events if isinstance(event, GoalChanged)][-1]
        assert (last.outcome, last.end, last.attempt) == ("SUCCEEDED", "SUCCEEDED", 1)
        assert changes_of(events) == [
            (("root", "m"), Status.RUNNING),
            (("root",), Status.RUNNING),
            (("root", "m"), Status.SUCCESS),
            (("root",), Status.SUCCESS),
        ]

    def test_tell_the_moment_at_which_it_happened_beside_a_leaf_that_sleeps(
        self, journal: Journal, name: str, node: Any
    ) -> None:
        class Sleeps(py_trees.behaviours.Running):
            def update(self) -> Status:
                if journal.count("accepted"):
                    journal.wait_for("succeeded")
                    time.sleep(0.6)  # what is looked at: nothing may be told late for it
                    return Status.SUCCESS
                return Status.RUNNING

        events: list[Event] = []
        leaf = MoveRobot("m", 0.2, action_name=name)
        with TreeRunner(together(leaf, Sleeps("sleeps")), node=node) as runner:
            runner.observe_events(events.append)
            assert runner.run(timeout=20.0) is Status.SUCCESS
        told = {e.state: e.at.steady for e in events if isinstance(e, GoalChanged)}
        at_server = {str(entry.event): entry.t for entry in journal.entries() if entry.goal}
        assert told["EXECUTING"] == pytest.approx(at_server["accepted"], abs=0.3)
        assert told["DONE"] == pytest.approx(at_server["succeeded"], abs=0.3)

    def test_an_observer_is_called_on_the_ticking_thread(
        self, journal: Journal, name: str, node: Any
    ) -> None:
        threads: set[int] = set()
        with TreeRunner(MoveRobot("m", 0.1, action_name=name), node=node) as runner:
            runner.observe_events(lambda event: threads.add(threading.get_ident()))
            runner.run(timeout=9.0)
        assert threads == {threading.get_ident()}

    def test_two_trees_on_one_node_hear_of_their_own_goals(
        self, journal: Journal, name: str, node: Any
    ) -> None:
        """They have the same names, and share the server."""
        heard: list[list[Event]] = [[], []]
        leaves = [MoveRobot("m", 0.2, action_name=name) for _ in range(2)]
        with spun(node), contextlib.ExitStack() as stack:
            runners = [stack.enter_context(TreeRunner(leaf, node=node)) for leaf in leaves]
            for runner, events in zip(runners, heard, strict=True):
                runner.observe_events(events.append)
                runner.start()
            for runner in runners:
                assert runner.wait(5.0) is Status.SUCCESS
        goals = [{e.goal_id for e in each if isinstance(e, GoalChanged)} for each in heard]
        assert [len(each) for each in goals] == [1, 1]
        assert goals[0] != goals[1]
        assert journal.max_live == 1


class TestWhoWaits:
    def test_a_wait_ends_when_another_thread_shuts_down(
        self, journal: Journal, name: str, node: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        runner = TreeRunner(MoveRobot("m", 9.0, action_name=name), node=node)
        waits, hears = threading.Event(), runner._hear_signals
        monkeypatch.setattr(runner, "_hear_signals", lambda: (waits.set(), hears())[1])
        runner.start()
        journal.wait_for("accepted")

        def shut_down() -> None:
            waits.wait()
            runner.shutdown()

        threading.Thread(target=shut_down).start()
        assert runner.wait(9.0) is Status.INVALID
        assert journal.ends() == ["canceled"]


def test_all_goals_end_of_a_node_that_ends_with_its_runner(journal: Journal, name: str) -> None:
    """A second runner on the node of the first, which is shut down under it."""
    leaf = MoveRobot("m", 9.0, action_name=name)
    with started(Gate()) as owner:
        guest = TreeRunner(leaf, node=owner.node)
        guest.start()
        until(lambda: state(leaf) == "EXECUTING")
        owner.interrupt()
        owner.wait(9.0)
    assert journal.ends() == ["canceled"]
    with contextlib.suppress(Exception):  # its node is gone, and it may say so
        guest.wait(9.0)
    guest.shutdown()
