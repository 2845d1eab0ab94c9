"""One tick of a tree: what it has changed, and what a behaviour did wrong in it. No ROS."""

from __future__ import annotations

from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase


def tick_once(tree: BehaviourTree) -> None:
    """Tick as `BehaviourTree.tick` does, which walks the whole tree even for no visitor.

    That is most of the time in a large tree of which little runs (docs/performance.md, row 6).
    """
    if type(tree).tick is not BehaviourTree.tick or any(each.full for each in tree.visitors):
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
        self._known: dict[Behaviour, Status] = {}

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

    def forget_others(self, tree: set[Behaviour]) -> None:
        """Forget what is in the tree no more, unless its end has still to be told."""
        self._known = {
            node: status
            for node, status in self._known.items()
            if node in tree or status is Status.RUNNING
        }

    def finish(self) -> list[tuple[Behaviour, Status]]:
        """Return the changes of a tick, also of one that raised: what it visited and stopped."""
        visited = self._visited
        seen = set(visited)
        stopped = [node for node in self.running if node not in seen]
        self.running = [node for node in visited if node.status is Status.RUNNING]
        return self._changes([*stopped, *visited])

    def stopped(self) -> list[tuple[Behaviour, Status]]:
        """Return the changes of what was last known to run."""
        return self._changes([n for n, s in self._known.items() if s is Status.RUNNING])

    def _changes(self, nodes: list[Behaviour]) -> list[tuple[Behaviour, Status]]:
        known = self._known
        changes = [(node, node.status) for node in nodes if known.get(node) is not node.status]
        known.update(changes)
        return changes
