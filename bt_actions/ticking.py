"""One tick of a tree: done, watched, and traced back to a behaviour where it raised. No ROS."""

from __future__ import annotations

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


class ChangeVisitor(VisitorBase):
    """Collects which behaviours have another status than before, and which run."""

    def __init__(self) -> None:
        super().__init__(full=False)
        self.running: list[Behaviour] = []
        self._visited: list[Behaviour] = []
        self._known: dict[Behaviour, Status] = {}

    def forget(self) -> None:
        """Begin a run."""
        self.running = []
        self._known = {}

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
