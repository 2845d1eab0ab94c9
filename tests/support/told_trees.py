"""A tree that is only told of, and its events: for what is made of events. No ROS, no behaviour."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    Event,
    FeedbackCame,
    GoalChanged,
    Moment,
    Node,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    RoundBegan,
    RunBegan,
    TickLasts,
    TreeFinished,
    Value,
)
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.unaccounted import GoalReport
from bt_actions.story.state import State
from tests.support.stories import state_of


@dataclass(eq=False)
class FakeNode:
    """A node of a tree; a `Story` of the tree gives it a number."""

    name: str
    children: list[FakeNode] = field(default_factory=list)
    kind: str = "sequence"
    server: str = ""
    action: str = ""
    place: str = ""
    settings: Mapping[str, Value] = field(default_factory=dict)
    parent: FakeNode | None = None
    id: int = 0

    def __post_init__(self) -> None:
        for child in self.children:
            child.parent = self

    def iterate(self) -> Iterator[FakeNode]:
        """Yield it and all below, parents first."""
        yield self
        for child in self.children:
            yield from child.iterate()


def FakeAction(  # noqa: N802 - it stands for a class
    name: str, server: str = "move_robot", place: str = "", **settings: Value
) -> FakeNode:
    """A leaf that looks like an action's."""
    return FakeNode(name, [], "move", server, "MoveRobot", place, settings)


@dataclass
class Story:
    """Makes the events of a tree, with a clock of their own; the run begins at 100 s."""

    root: FakeNode
    step: float = 0.5
    time: float = 100.0
    number: int = 1

    def __post_init__(self) -> None:
        self._numbers = 0
        self.began = RunBegan(
            Moment(1, self.time, self.time + 1e9, 0.0),
            "0" * 32,
            self.root.name,
            tuple(self._node(each) for each in self.root.iterate()),
            {},
            {},
            {},
        )

    def _node(self, node: FakeNode) -> Node:
        self._numbers += 1
        node.id = self._numbers
        parent = None if node.parent is None else node.parent.id
        given = node.kind, node.place, node.server, node.action, node.settings
        return Node(node.id, parent, node.name, *given)

    def _next(self) -> Moment:
        self.time += self.step
        self.number += 1
        return Moment(self.number, self.time, self.time + 1e9, 0.0)

    def add(self, node: FakeNode, parent: FakeNode) -> NodesAdded:
        """A node that is inserted while the tree runs."""
        node.parent = parent
        return NodesAdded(self._next(), (self._node(node),))

    def remove(self, node: FakeNode) -> NodesRemoved:
        """A leaf that is taken out while the tree runs."""
        return NodesRemoved(self._next(), (node.id,))

    def node(
        self,
        node: FakeNode,
        status: Status,
        message: str = "",
        *,
        by_itself: bool = False,
        warning: str = "",
    ) -> NodeChanged:
        return NodeChanged(self._next(), node.id, status, message, by_itself, warning)

    def goal(
        self,
        leaf: FakeNode,
        state: str,
        *,
        attempt: int = 1,
        visit: int = 1,
        outcome: Outcome | None = None,
        end: End | None = None,
        reason: str = "",
        goal: Value = None,
        result: Value = None,
    ) -> GoalChanged:
        """An event of goal `attempt`; `visit` tells apart what has the same number."""
        which = self._next(), leaf.id, f"{leaf.name}-{visit}-{attempt}", attempt
        return GoalChanged(*which, state, outcome, end, reason, leaf.server, goal, result)

    def verdict(
        self,
        leaf: FakeNode,
        outcome: Outcome,
        reason: str = "",
        *,
        attempt: int = 1,
        visit: int = 1,
        again_in: float | None = None,
    ) -> AttemptEnded:
        which = self._next(), leaf.id, f"{leaf.name}-{visit}-{attempt}", attempt
        return AttemptEnded(*which, outcome, reason, again_in=again_in)

    def feedback(self, leaf: FakeNode, value: Value, *, attempt: int = 1) -> FeedbackCame:
        return FeedbackCame(self._next(), leaf.id, f"{leaf.name}-1-{attempt}", value)

    def lasts(self, node: FakeNode, seconds: float, *, is_over: bool = False) -> TickLasts:
        return TickLasts(self._next(), node.id, seconds, is_over)

    def round(
        self, loop: FakeNode, number: int, item: Value = None, of: int | None = None
    ) -> RoundBegan:
        return RoundBegan(self._next(), loop.id, number, of, item)

    def finish(self, status: Status, *unaccounted: GoalReport, **more: object) -> TreeFinished:
        return TreeFinished(self._next(), status, unaccounted=unaccounted, **more)

    def succeed(self, leaf: FakeNode, visit: int = 1) -> list[Event]:
        """A leaf that runs and succeeds at the first attempt."""
        done = {"outcome": Outcome.SUCCEEDED, "end": End.SUCCEEDED}
        return [
            self.node(leaf, Status.RUNNING),
            self.goal(leaf, "SENDING", visit=visit),
            self.goal(leaf, "EXECUTING", visit=visit),
            self.goal(leaf, "DONE", visit=visit, **done),
            self.node(leaf, Status.SUCCESS),
        ]

    def fail(self, leaf: FakeNode, reason: str = "", visit: int = 1) -> list[Event]:
        """A leaf whose only attempt is aborted."""
        done = {"outcome": Outcome.ABORTED, "end": End.ABORTED, "reason": reason}
        return [
            self.goal(leaf, "EXECUTING", visit=visit),
            self.goal(leaf, "DONE", visit=visit, **done),
            self.node(leaf, Status.FAILURE, f"{Outcome.ABORTED}: {reason}"),
        ]

    def told(self, *events: Event) -> State:
        """The state after the run's beginning and `events`."""
        return state_of((self.began, *events))
