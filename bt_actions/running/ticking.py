"""One tick of a tree: done, watched, and traced back to a behaviour where it raised. No ROS."""

from __future__ import annotations

import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase

from bt_actions.utilities.places import path_of


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


class Misbehaviour(Exception):
    """What a behaviour did wrong without raising anything; raised in its `visit`."""


class SetUp:
    """Which behaviours of a tree have been set up, and whether others have been inserted since.

    That is asked at each tick, so it compares the lists of children with what they were (about
    10 ns a behaviour), and walks the tree only where one differs.
    """

    def __init__(self) -> None:
        self._done = weakref.WeakSet[Behaviour]()
        self._root: Behaviour | None = None
        self._parents: list[Behaviour] = []
        self._children: list[list[Behaviour]] = []

    @property
    def has_begun(self) -> bool:
        """Whether any behaviour has been."""
        return len(self._done) > 0

    def is_complete(self, root: Behaviour) -> bool:
        """Whether the tree holds what it held when nothing was missing any more."""
        return self._root is root and self._children == [each.children for each in self._parents]

    def missing(self, root: Behaviour) -> Iterator[Behaviour]:
        """Yield what has not been set up, children first; who asks for the next one has done it."""
        while new := [each for each in root.iterate() if each not in self._done]:
            for behaviour in new:
                yield behaviour
                self._done.add(behaviour)
        self._root = root
        self._parents = [
            each for each in root.iterate() if each.children or isinstance(each, Composite)
        ]
        self._children = [list(each.children) for each in self._parents]


class ChangeVisitor(VisitorBase):
    """Collects which behaviours have another status than before, and which run."""

    def __init__(
        self,
        before: Callable[[], None] = lambda: None,
        after_each: Callable[[], str] = lambda: "",
    ) -> None:
        """`before` is called between the handlers of a tick and its first behaviour.

        `after_each` is called when a behaviour has ticked, and what it returns is its misbehaviour.
        """
        super().__init__(full=False)
        self.running: list[Behaviour] = []
        self._before, self._after_each = before, after_each
        self._visited: list[Behaviour] = []
        self._known = weakref.WeakKeyDictionary[Behaviour, Status]()

    def forget(self) -> None:
        """Begin a run."""
        self.running = []
        self._known.clear()

    def begin(self) -> None:
        """Begin a tick."""
        self._visited = []

    def initialise(self) -> None:
        """Do what has to be done before (py_trees calls this)."""
        self._before()

    def run(self, behaviour: Behaviour) -> None:
        """Take note of a behaviour that was ticked (py_trees calls this).

        Raises Misbehaviour, also where it has no status: py_trees makes INVALID of what is none,
        and goes on with its parent. Nothing else leaves that after a tick.
        """
        status = behaviour.status
        if status is Status.INVALID or status.__class__ is not Status:
            raise Misbehaviour(
                "no status after its tick; update() has to return RUNNING, SUCCESS or FAILURE"
            )
        self._visited.append(behaviour)
        if wrong := self._after_each():
            raise Misbehaviour(wrong)

    def finish(self) -> list[tuple[Behaviour, Status]]:
        """Return the changes of a tick, also of one that raised: what it visited and stopped."""
        visited = self._visited
        seen = set(visited)
        stopped = [node for node in self.running if node not in seen]
        self.running = [node for node in visited if node.status is Status.RUNNING]
        return self._changes([*stopped, *visited])

    def stopped(self) -> list[tuple[Behaviour, Status]]:
        """Return the changes of what was last known to run."""
        return self._changes([n for n, s in list(self._known.items()) if s is Status.RUNNING])

    def _changes(self, nodes: list[Behaviour]) -> list[tuple[Behaviour, Status]]:
        changes = []
        for node in nodes:
            if self._known.get(node) is not node.status:
                self._known[node] = node.status
                changes.append((node, node.status))
        return changes
