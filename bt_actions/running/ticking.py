"""One tick of a tree: the changes that it made, and the faults of a behaviour in it. No ROS."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from operator import attrgetter

from py_trees import composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from py_trees.visitors import VisitorBase

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.running.telling import TreeTeller

QUIET_REST = 2.0
"""Seconds between two ticks of a tree in which nothing watches the clock; a longer heartbeat
counts."""
_PASS_ON = {
    composites.Sequence,
    composites.Selector,
    composites.Parallel,
    decorators.Inverter,
    decorators.FailureIsSuccess,
    decorators.SuccessIsFailure,
    decorators.OneShot,
}
"""Classes of py_trees whose status follows from that of their children alone.

A class of ours says so by `passes_on`; a subclass of it may look at more.
"""
_ASKS = attrgetter("asks")
"""Whether a node asks something at each tick."""


def tick_once(tree: BehaviourTree, changes: ChangeVisitor) -> None:
    """Tick as `BehaviourTree.tick` does, without its walk through the whole tree for no visitor.

    The walk is most of the time in a large tree of which little runs (docs/performance.md, row 6).
    """
    if type(tree).tick is not BehaviourTree.tick or any(each.full for each in tree.visitors):
        tree.tick()
        return
    for handler in tree.pre_tick_handlers:
        handler(tree)
    for visitor in tree.visitors:
        visitor.initialise()
    changes.follow(tree.root.tick(), [each for each in tree.visitors if each is not changes])
    for visitor in tree.visitors:
        visitor.finalise()
    for handler in tree.post_tick_handlers:
        handler(tree)
    tree.count += 1


class Misbehaviour(Exception):
    """A fault of a behaviour that raised nothing."""

    def __init__(self, behaviour: Behaviour, what: str) -> None:
        super().__init__(what)
        self.behaviour = behaviour


class ChangeVisitor(VisitorBase):
    """The collector of behaviours with a new status, and of running ones."""

    def __init__(
        self,
        before: Callable[[], None],
        after_each: Callable[[], str],
        teller: TreeTeller,
    ) -> None:
        """Make the visitor; `before` is called between a tick's handlers and its first behaviour.

        `after_each` is called when a behaviour has ticked, and returns a fault of it.
        """
        super().__init__(full=False)
        self._before, self._after_each, self._teller = before, after_each, teller
        self._visited: list[Behaviour] = []
        self._visited_before: list[Behaviour] = []
        self._kinds = {Behaviour}  # of visited nodes; any class, for a tree that shows nothing
        self._asking: list[Behaviour] = []  # visited nodes that may ask at each tick
        self._known: dict[Behaviour, Status] = {}  # at the last tick of each
        self._live: dict[Behaviour, None] = {}  # told of as RUNNING
        self._changed = False

    def initialise(self) -> None:
        """Begin a tick (py_trees calls this)."""
        self._visited, self._changed = [], False
        self._before()

    def run(self, behaviour: Behaviour) -> None:
        """Take note of a behaviour that was ticked (py_trees calls this)."""
        self.follow([behaviour])

    def follow(self, ticked: Iterable[Behaviour], others: Collection[VisitorBase] = ()) -> None:
        """Take note of each behaviour as it has been ticked, behind the `others`.

        Raises Misbehaviour, also for a behaviour without a status: py_trees makes INVALID of what
        is none, and goes on with its parent. After a tick, no other behaviour is INVALID.
        """
        after_each, visited, none = self._after_each, self._visited, Status.INVALID
        live, running, teller = self._live, Status.RUNNING, self._teller
        known, heard, tell, settle = self._known, teller.is_heard, teller.changed, teller.goes_on
        for behaviour in ticked:
            for visitor in others:
                behaviour.visit(visitor)
            status = behaviour.status
            if status is none or status.__class__ is not Status:
                what = (
                    "no status after its tick; update() has to return RUNNING, SUCCESS or FAILURE"
                )
                raise Misbehaviour(behaviour, what)
            visited.append(behaviour)
            if status is not running:
                live.pop(behaviour, None)
                if known.get(behaviour) is not status:
                    known[behaviour], self._changed = status, True
                if heard:
                    tell(behaviour)
            elif behaviour not in live:
                live[behaviour] = None
                known[behaviour], self._changed = status, True
                if heard:
                    tell(behaviour)
            elif heard:
                settle(behaviour)
            if wrong := after_each():
                raise Misbehaviour(behaviour, wrong)

    def forget_others(self, tree: set[Behaviour]) -> None:
        """Forget nodes that are out of the tree, unless their end has still to be told."""
        self._known = {node: status for node, status in self._known.items() if node in tree}

    def finish(self) -> bool:
        """Return whether a tick, also one that raised, has changed a status."""
        if self._visited != self._visited_before:
            self._kinds = {type(node) for node in self._visited}
            self._asking = [node for node in self._visited if hasattr(node, "asks")]
            self._visited_before = self._visited
        self.stopped()
        return self._changed

    def stopped(self) -> None:
        """Tell the nodes that have stopped running without a tick."""
        for node in [each for each in self._live if each.status is not Status.RUNNING]:
            del self._live[node]
            self._known.pop(node, None)
            self._changed = True
            self._teller.changed(node)

    @property
    def watching(self) -> bool:
        """Whether a ticked node may watch a source without events: the clock, or a variable."""
        if True in map(_ASKS, self._asking):
            return True
        ours = ActionBehaviour.tick, ActionBehaviour.update
        return any(
            (kind.tick, kind.update) != ours and not vars(kind).get("passes_on")
            for kind in self._kinds - _PASS_ON
        )

    @property
    def may_go_on(self) -> bool:
        """Whether another tick, at once, may do more: an action's leaf waits for arrivals."""
        return self.watching or not all(
            isinstance(node, ActionBehaviour) or getattr(node, "memory", False)
            for node in self._visited
        )

    @property
    def timed(self) -> list[Callable[[], object]]:
        """`due_in` of the running nodes that have one (ActionBehaviour.due_in)."""
        timed = {kind for kind in self._kinds if callable(getattr(kind, "due_in", None))}
        running = (n for n in self._visited if n.status is Status.RUNNING) if timed else ()
        return [getattr(n, "due_in") for n in running if type(n) in timed]  # noqa: B009
