"""What a tick has changed, and what a behaviour did wrong in it. No ROS."""

from __future__ import annotations

import weakref
from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.visitors import VisitorBase


class Misbehaviour(Exception):
    """What a behaviour did wrong without raising anything; raised in its `visit`."""


class ChangeVisitor(VisitorBase):
    """Collects which behaviours have another status than before, and which run."""

    def __init__(
        self,
        before: Callable[[], None],
        after_each: Callable[[], str],
    ) -> None:
        """`before` is called between the handlers of a tick and its first behaviour.

        `after_each` is called when a behaviour has ticked, and what it returns is its misbehaviour.
        """
        super().__init__(full=False)
        self.running: list[Behaviour] = []
        self._before, self._after_each = before, after_each
        self._visited: list[Behaviour] = []
        self._known = weakref.WeakKeyDictionary[Behaviour, Status]()

    def initialise(self) -> None:
        """Begin a tick (py_trees calls this)."""
        self._visited = []
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
