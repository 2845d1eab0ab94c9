"""One tick of a tree: done, watched, and traced back to a behaviour where it raised. No ROS."""

from __future__ import annotations

import sys
import threading
import time
import weakref
from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase


def tick_once(tree: BehaviourTree) -> None:
    """Tick as `BehaviourTree.tick` does, which walks the whole tree even for no visitor."""
    if type(tree).tick is not BehaviourTree.tick or any(v.full for v in tree.visitors):
        tree.tick()
        return
    for handler in tree.pre_tick_handlers:
        handler(tree)
    for visitor in tree.visitors:
        visitor.initialise()
    for node in tree.root.tick():
        for visitor in tree.visitors:
            node.visit(visitor)
    for visitor in tree.visitors:
        visitor.finalise()
    for handler in tree.post_tick_handlers:
        handler(tree)
    tree.count += 1


class Patience:
    """How long a tick may take that should have been the last.

    While a behaviour does not return from it, nobody else can stop the tree. So whoever minds the
    tree's goals asks here, on any thread and at any time, whether they are wanted still.
    """

    GRACE = 1.0
    """Seconds for a tick to return when the tree is to end."""

    def __init__(self, told: Callable[[str], None]) -> None:
        """`told` is called, once a run, with what does not return."""
        self._told = told
        self._ends_at: float | None = None
        self._ticks_on: int | None = None
        self.gave_up = False
        """Whether it was so in this run: what the tree says since is of no account."""

    def begin(self, ends_at: float | None) -> None:
        """A run begins on this thread; it is to end at `ends_at` (time.monotonic), or some time."""
        self._ticks_on, self._ends_at, self.gave_up = threading.get_ident(), ends_at, False

    def end_now(self) -> None:
        """The run is to end; safe in a signal handler."""
        ends_at, now = self._ends_at, time.monotonic()
        self._ends_at = now if ends_at is None else min(ends_at, now)

    def end(self) -> None:
        """The last tick is over, and so is all that a behaviour does when it is stopped."""
        self._ticks_on = None

    @property
    def is_over(self) -> bool:
        """Whether the last tick should have been over for long; safe in a signal handler."""
        ends_at = self._ends_at
        if self._ticks_on is None or ends_at is None:
            return False
        return time.monotonic() - ends_at >= self.GRACE

    def gives_up(self) -> bool:
        """Whether nobody waits for the last tick any more."""
        if not self.is_over:
            return False
        if not self.gave_up:
            self.gave_up = True
            self._told(f"{self._stuck_in()} does not return from its tick: canceling all goals")
        return True

    def _stuck_in(self) -> str:
        """Name the innermost behaviour that the ticking thread is in."""
        frame = sys._current_frames().get(self._ticks_on or 0)  # noqa: SLF001 - documented
        while frame is not None:
            behaviour = frame.f_locals.get("self")
            if isinstance(behaviour, Behaviour):
                return "/".join(path_of(behaviour))
            frame = frame.f_back
        return "the tree"


class ChangeVisitor(VisitorBase):
    """Collects which behaviours have another status than before, and which run."""

    def __init__(self) -> None:
        super().__init__(full=False)
        self.running: list[Behaviour] = []
        self._visited: list[Behaviour] = []
        self._known = weakref.WeakKeyDictionary[Behaviour, Status]()

    def forget(self) -> None:
        """Begin a run."""
        self.running = []
        self._known.clear()

    def begin(self) -> None:
        """Begin a tick."""
        self._visited = []

    def run(self, behaviour: Behaviour) -> None:
        """Take note of a behaviour that was ticked (py_trees calls this)."""
        self._visited.append(behaviour)

    def finish(self, *, interrupted: bool = False) -> list[tuple[Behaviour, Status]]:
        """Return the changes of this tick: of what it visited, and of what it stopped."""
        visited = [] if interrupted else self._visited
        seen = set(visited)
        stopped = [node for node in self.running if node not in seen]
        changes = []
        for node in [*stopped, *visited]:
            if self._known.get(node) is not node.status:
                self._known[node] = node.status
                changes.append((node, node.status))
        self.running = [node for node in visited if node.status is Status.RUNNING]
        return changes


def root_of(behaviour: Behaviour) -> Behaviour:
    """Return the root of the tree that the behaviour is in."""
    while behaviour.parent is not None:
        behaviour = behaviour.parent
    return behaviour


def path_of(behaviour: Behaviour) -> tuple[str, ...]:
    """Return the names from the root down to the behaviour."""
    names = [behaviour.name]
    while behaviour.parent is not None:
        behaviour = behaviour.parent
        names.append(behaviour.name)
    return tuple(reversed(names))


def culprit_of(error: BaseException) -> Behaviour | None:
    """Return the innermost behaviour on the way to where `error` was raised."""
    culprit, traceback = None, error.__traceback__
    while traceback is not None:
        candidate = traceback.tb_frame.f_locals.get("self")
        if isinstance(candidate, Behaviour):
            culprit = candidate
        traceback = traceback.tb_next
    return culprit
