"""When the loop ticks, what it makes of faults, and what it tells; in time of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from unittest.mock import Mock

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree

from bt_actions import TreeError
from bt_actions.events import TreeFinished
from bt_actions.running import loop as module
from bt_actions.running.loop import BURST
from bt_actions.utilities.stepping import Done, Sleep
from tests.running.stepping import Stepped
from tests.support.stories import changes_of
from tests.support.trees import Gate, Guard, Raises, in_sequence, in_turn, together


class At(Behaviour):
    """Succeeds at a moment."""

    def __init__(self, moment: float) -> None:
        super().__init__("at")
        self.moment, self.stepped = moment, Stepped(self, heartbeat=1.0)

    def update(self) -> Status:
        return Status.SUCCESS if self.stepped.now >= self.moment else Status.RUNNING


class DueAt(At):
    """And asks to be ticked then."""

    def due_in(self) -> float:
        return self.moment - self.stepped.now


class TestTicks:
    @pytest.mark.parametrize(("kind", "ends"), [(DueAt, 2.5), (At, 3.0)])
    def test_come_at_each_heartbeat_and_when_a_behaviour_asks(
        self, kind: type[At], ends: float
    ) -> None:
        stepped = kind(2.5).stepped
        assert stepped.run() is Status.SUCCESS
        assert stepped.now == ends

    def test_come_in_a_row_while_each_changes_a_status_up_to_a_bound(self) -> None:
        step = py_trees.behaviours.StatusQueue("step", [Status.RUNNING, Status.SUCCESS], None)
        stepped = Stepped(py_trees.decorators.Repeat("for ever", step, num_success=-1))
        stepped.begin()
        for _ in range(BURST):
            stepped.step()
        assert stepped.slept == [0.0] * (BURST - 1) + [0.1]

    def test_a_heartbeat_may_be_endless(self) -> None:
        stepped = Stepped(Gate(), heartbeat=float("inf"))
        with pytest.raises(TimeoutError, match="gate did not finish within 9000 s"):
            stepped.run(9000.0)
        assert stepped.slept == [0.0, 3600.0, 3600.0, 1800.0]

    def test_stop_at_once_when_it_is_paused(self) -> None:
        gate = Gate()
        stepped = Stepped(gate)
        stepped.begin()
        stepped.step()
        stepped.loop.pause(True)
        gate.passed = True
        for _ in range(3):
            assert stepped.step() is None
        stepped.traffic.pause.assert_called_once_with([], True)
        stepped.loop.pause(False)
        assert stepped.step() is Status.SUCCESS
        stepped.traffic.pause.assert_called_with([], False)


class TestInterrupt:
    def test_before_a_run_ends_it_at_its_first_step_and_not_the_next_one(self) -> None:
        stepped = Stepped(py_trees.behaviours.Success("s"))
        stepped.loop.interrupt(0.0)
        assert stepped.run(9.0) is Status.INVALID
        assert stepped.run(9.0) is Status.SUCCESS

    def test_abandons_the_drain_where_that_is_said(self, monkeypatch: pytest.MonkeyPatch) -> None:
        drain = Mock()
        drain.step.side_effect = lambda now, hurry: Done([]) if hurry else Sleep(0.01)
        monkeypatch.setattr(module, "Drain", lambda *_: drain)
        stepped = Stepped(Gate())
        stepped.begin()
        stepped.loop.interrupt(0.0)
        for _ in range(3):
            assert stepped.step() is None
        stepped.loop.interrupt(0.0, abandon=True)
        assert stepped.step() is Status.INVALID

    def test_what_the_waiting_thread_was_told_ends_the_run_after_the_drain(self) -> None:
        gate = Gate()
        stepped = Stepped(gate)
        stepped.begin()
        stepped.step()
        stepped.loop.fail(KeyboardInterrupt())
        with pytest.raises(KeyboardInterrupt):
            stepped.step()
        assert isinstance(stepped.told[-1], TreeFinished)
        assert gate.status is Status.INVALID
        with pytest.raises(SystemExit):
            stepped.loop.fail(SystemExit())

    def test_what_ends_the_drain_as_well_is_raised_once(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """A second Ctrl-C in `run()`: `shutdown()` has none of its own to tell of."""
        drain = Mock()
        drain.step.return_value = Sleep(0.01)
        monkeypatch.setattr(module, "Drain", lambda *_: drain)
        stepped = Stepped(Gate())
        stepped.begin()
        stepped.step()
        stepped.loop.fail(SystemExit("first"))  # a KeyboardInterrupt would end these tests
        stepped.step()
        with pytest.raises(SystemExit, match="second"):
            stepped.loop.fail(SystemExit("second"))
        stepped.loop.raise_what_ended_it()


class WithoutStatus(Behaviour):
    def __init__(self, status: Any = None) -> None:
        super().__init__("forgets")
        self.returns = status

    def update(self) -> Any:
        return self.returns


class ForgetfulDecorator(py_trees.decorators.Decorator):
    def update(self) -> Any:
        return None


class ForgetfulComposite(py_trees.composites.Composite):
    def tick(self) -> Iterator[Behaviour]:
        yield from self.children[0].tick()
        self.status = None  # type: ignore[assignment]
        yield self


@pytest.mark.parametrize(
    "bad",
    [
        WithoutStatus(),
        WithoutStatus("SUCCESS"),
        ForgetfulDecorator("forgets", py_trees.behaviours.Success("s")),
        ForgetfulComposite("forgets", [py_trees.behaviours.Success("s")]),
    ],
    ids=["leaf", "leaf that returns something else", "decorator", "composite"],
)
def test_a_behaviour_without_status_ends_the_run_and_nothing_passes_over_it(bad: Any) -> None:
    then = py_trees.behaviours.Success("then")
    root = in_turn(in_sequence(bad, name="branch"), then, name="root")
    with pytest.raises(TreeError, match=r"^root / branch / forgets: no status after its tick"):
        Stepped(root).run()


class Counted(Behaviour):
    """Notes what is called; SUCCESS."""

    def __init__(self, name: str, calls: list[str], *, fails: int = 0) -> None:
        super().__init__(name)
        self.calls, self.fails = calls, fails

    def setup(self, **kwargs: Any) -> None:
        assert list(kwargs) == ["node"]
        self.calls.append(f"setup {self.name}")
        self.fails -= 1
        if self.fails >= 0:
            raise OSError("no device")

    def update(self) -> Status:
        self.calls.append(self.name)
        return Status.SUCCESS

    def shutdown(self) -> None:
        self.calls.append(f"shutdown {self.name}")


class TestSetup:
    def test_is_called_once_however_often_the_tree_runs(self) -> None:
        calls: list[str] = []
        stepped = Stepped(in_sequence(Counted("a", calls)))
        stepped.loop.shutdown()
        for _ in range(3):
            stepped.run()
        stepped.loop.shutdown()
        assert calls == ["setup a", "a", "a", "a", "shutdown a"]

    def test_of_a_tree_with_a_setup_of_its_own_is_called_once(self) -> None:
        class Tree(BehaviourTree):
            def setup(self, *args: Any, **kwargs: Any) -> None:
                calls.append("setup of the tree")
                super().setup(*args, **kwargs)

        calls: list[str] = []
        stepped = Stepped(Tree(Counted("a", calls)))
        for _ in range(2):
            stepped.run()
        assert calls == ["setup of the tree", "setup a", "a", "a"]

    def test_that_raised_is_called_again_for_those_that_were_not_set_up(self) -> None:
        calls: list[str] = []
        root = in_sequence(Counted("a", calls), Counted("b", calls, fails=1), name="root")
        stepped = Stepped(root)
        with pytest.raises(TreeError, match="root / b: setup raised OSError: no device"):
            stepped.run()
        stepped.run()
        assert calls == ["setup a", "setup b", "setup b", "a", "b"]

    @pytest.mark.parametrize("who", ["handler", "observer"])
    def test_of_what_is_inserted_in_a_run_comes_before_its_first_tick(self, who: str) -> None:
        calls: list[str] = []
        inner = in_sequence(Gate(), name="inner")
        tree = BehaviourTree(in_sequence(inner, name="root"))

        def replace(_: object) -> None:
            if tree.root.status is Status.RUNNING and len(inner.children) == 1:
                inner.remove_all_children()
                inner.add_child(Counted("new", calls))
                inner.add_child(Counted("last", calls))

        stepped = Stepped(tree)
        if who == "handler":
            tree.add_pre_tick_handler(replace)
        else:
            stepped.loop.observe_events(replace)
        assert stepped.run() is Status.SUCCESS
        assert calls == ["setup new", "setup last", "new", "last"]

    def test_of_what_is_inserted_in_a_run_is_named_where_it_raises(self) -> None:
        root, new = in_sequence(Gate(), name="root"), Raises("new", "setup")
        tree = BehaviourTree(root)
        tree.add_pre_tick_handler(lambda _: root.add_child(new))
        with pytest.raises(TreeError, match=r"^root / new: setup raised"):
            Stepped(tree).run()


class TestEvents:
    @pytest.mark.parametrize("when", ["at the end", "in a tick"])
    def test_of_a_tree_whose_terminate_raises_end_with_each_status(self, when: str) -> None:
        ends = Guard("ends")
        bad = Raises("bad", "terminate")
        branch = in_sequence(together(Gate("before"), bad, Gate("behind")), name="branch")
        stepped = Stepped(in_turn(ends, branch, name="root", memory=False))
        stepped.begin()
        stepped.step()
        if when == "at the end":
            stepped.loop.interrupt(0.0)
            assert stepped.step() is Status.INVALID
        else:
            ends.holds = True
            with pytest.raises(TreeError, match="bad: tick raised RuntimeError: on purpose"):
                stepped.step()
        told = {path[-1]: status for path, status in changes_of(stepped.told)}
        stopped = ["root", "branch", "together", "before", "bad", "behind"]
        assert {each: told[each] for each in stopped} == dict.fromkeys(stopped, Status.INVALID)
        assert told["ends"] is (Status.FAILURE if when == "at the end" else Status.SUCCESS)
        assert all(each.status is Status.INVALID for each in branch.iterate())

    def test_an_observer_that_raises_is_dropped_and_the_run_goes_on(self) -> None:
        stepped = Stepped(py_trees.behaviours.Success("s"))
        stepped.loop.observe_events(faulty := Mock(side_effect=RuntimeError("on purpose")))
        stepped.loop.observe_events(good := Mock())
        assert stepped.run() is Status.SUCCESS
        faulty.assert_called_once()
        assert isinstance(good.call_args.args[0], TreeFinished)
