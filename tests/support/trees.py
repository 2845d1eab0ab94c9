"""Behaviours for trees in tests: gates, guards, and ones that raise."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any, cast

from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel, Selector, Sequence

from bt_actions import ActionBehaviour, TreeRunner
from bt_actions.running.telling import TreeTeller
from bt_actions.running.ticking import ChangeVisitor


@contextmanager
def started(root: Behaviour, **settings: Any) -> Iterator[TreeRunner]:
    """A tree that runs."""
    with TreeRunner(root, **settings) as runner:
        runner.start()
        yield runner


def unheard() -> ChangeVisitor:
    """A visitor of ticks whose changes nobody hears."""
    nobody = SimpleNamespace(is_heard=False, changed=lambda node: None, goes_on=lambda node: None)
    return ChangeVisitor(lambda: None, lambda: "", cast(TreeTeller, nobody))


class Gate(Behaviour):
    """RUNNING until `passed` is true; then SUCCESS."""

    def __init__(self, name: str = "gate") -> None:
        super().__init__(name)
        self.passed = False

    def update(self) -> Status:
        return Status.SUCCESS if self.passed else Status.RUNNING


class Guard(Behaviour):
    """SUCCESS while `holds`, otherwise FAILURE."""

    def __init__(self, name: str = "guard") -> None:
        super().__init__(name)
        self.holds = False

    def update(self) -> Status:
        return Status.SUCCESS if self.holds else Status.FAILURE


class Raises(Behaviour):
    """Raises in one of its methods, once it is told to (at once, where it is not said)."""

    def __init__(self, name: str, method: str, *, when: Callable[[], Any] = lambda: True) -> None:
        super().__init__(name)
        self.method = method
        self.when = when

    def _perhaps(self, method: str) -> None:
        if method == self.method and self.when():
            raise RuntimeError(f"on purpose in {method}")

    def setup(self, **kwargs: Any) -> None:
        self._perhaps("setup")

    def initialise(self) -> None:
        self._perhaps("initialise")

    def update(self) -> Status:
        self._perhaps("update")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        self._perhaps("terminate")

    def shutdown(self) -> None:
        self._perhaps("shutdown")


def in_sequence(*children: Behaviour, name: str = "sequence", memory: bool = True) -> Sequence:
    return Sequence(name, memory=memory, children=list(children))


def in_turn(*children: Behaviour, name: str = "fallback", memory: bool = True) -> Selector:
    return Selector(name, memory=memory, children=list(children))


def together(*children: Behaviour, name: str = "together") -> Parallel:
    """All at once; finished children are not started again."""
    policy = ParallelPolicy.SuccessOnAll(synchronise=True)
    return Parallel(name, policy=policy, children=list(children))


def state(leaf: ActionBehaviour) -> str:
    """The state of the goal that the leaf is at."""
    return leaf.progress().state


class LeavesLate(Behaviour):
    """Ends the program at its third tick, as a call of `sys.exit` in a behaviour does."""

    ticks = 0

    def update(self) -> Status:
        self.ticks += 1
        if self.ticks == 3:
            raise SystemExit(1)
        return Status.RUNNING


class Hangs(Behaviour):
    """Does not return from its tick."""

    def update(self) -> Status:
        threading.Event().wait()
        return Status.RUNNING
