"""The state of a run, folded from its events: nodes, actions, failures, variables, the end.

All that is shown or decided of a run reads from here: terminal, `--json`, table, exit code,
`/rosout`, diagnostics, RunTree's feedback and result, the virtual runner.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from py_trees.common import Status

from bt_actions.events.kinds import (
    AttemptEnded,
    Event,
    EventsLost,
    FeedbackCame,
    GoalChanged,
    Moment,
    Node,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    Paused,
    RoundBegan,
    RunBegan,
    RunEnded,
    ServerSeen,
    StopWanted,
    TickLasts,
    TreeFinished,
    VariableWritten,
    says_left_out,
)
from bt_actions.events.snapshot import Value
from bt_actions.goals.policy import End
from bt_actions.goals.unaccounted import GoalReport
from bt_actions.story.actions import ActionStory
from bt_actions.story.failures import Failure, Warned
from bt_actions.utilities.names import told_apart

OVER = (Status.SUCCESS, Status.FAILURE)
KEPT = 100
"""Dealt-with failures that are kept; older ones are counted."""


@dataclass(slots=True)
class NodeStory:
    """One node of the tree, as its latest event left it."""

    node: Node
    children: list[int] = field(default_factory=list)
    status: Status = Status.INVALID
    message: str = ""
    since: Moment | None = None
    """The moment at which it got its status."""
    visits: int = 0
    """The number of its visits."""
    ended: int = 0
    """The number of the event that ended its visit before the latest."""
    number: int = 0
    """The number of its latest event."""
    warning: str = ""
    due_in: float | None = None
    """Seconds from `since` on until its own time runs out."""
    round: RoundBegan | None = None
    """The latest round of a loop."""
    pending: list[Failure] = field(default_factory=list)
    """Failures at or below it that no node above it has dealt with yet."""

    @property
    def is_left_out(self) -> bool:
        """Whether the node has ended as if it were not there."""
        return says_left_out(self.status, self.message)

    @property
    def has_failed(self) -> bool:
        """Whether the node has ended in a FAILURE, and was not left out."""
        return self.status is Status.FAILURE and not self.is_left_out

    @property
    def is_leaf(self) -> bool:
        """Whether the node has no children."""
        return not self.children


@dataclass(slots=True, eq=False)
class State:
    """A run as it stands after the events that were folded into it."""

    began: RunBegan | None = None
    nodes: dict[int, NodeStory] = field(default_factory=dict)
    """The nodes by number, parents before their children."""
    root: int = 1
    now: Moment | None = None
    """The moment of the latest event."""
    finished: TreeFinished | None = None
    ended: RunEnded | None = None
    stop: StopWanted | None = None
    """The first request to end the run."""
    stopped: list[Failure] = field(default_factory=list)
    """The nodes that ran when the run was asked to end."""
    lasting: TickLasts | None = None
    """The node in whose tick the tree is, where that lasts."""
    leaves_ended: int = 0
    """The number of ends of leaves."""
    changes: int = 0
    """The number of new statuses of leaves, of lasting ticks and their ends, and of pauses."""
    abandoned: bool = False
    """Whether goals that are being drained are waited for no longer."""
    paused: bool = False
    lost: int = 0
    """Events that this reader was too slow for."""
    variables: dict[str, VariableWritten] = field(default_factory=dict)
    servers: dict[str, ServerSeen] = field(default_factory=dict)
    dealt_with: deque[Failure] = field(default_factory=lambda: deque(maxlen=KEPT))
    """Dealt-with failures, in the order of the dealing."""
    dealt_with_in_all: int = 0
    _actions: dict[int, ActionStory] = field(default_factory=dict)
    _warnings: dict[int, Warned] = field(default_factory=dict)
    _names: dict[int, str] = field(default_factory=dict)
    """The names of all nodes, also of those that are out of the tree."""
    _called: dict[int, str] = field(default_factory=dict)

    @property
    def simulation(self) -> str:
        """The stand-in for the world, as options of the command line; "" for a run in the world."""
        return self.began.where.get("simulation", "") if self.began is not None else ""

    # Taking in

    def fold(self, event: Event) -> None:
        """Fold one event, in the order of their numbers."""
        self.now = event.at
        node = getattr(event, "node", None)
        if isinstance(node, int) and node not in self.nodes:
            return  # the node is gone, or this reader has not seen the run's beginning
        self.changes += isinstance(event, TickLasts | Paused)
        match event:
            case NodeChanged():
                self._node_changed(event)
            case GoalChanged():
                self.action(event.node).goal_changed(event)
            case FeedbackCame():
                if (goal := self.action(event.node).goals.get(event.goal_id)) is not None:
                    goal.feedback = event
            case AttemptEnded():
                self.action(event.node).judge(event)
            case RoundBegan():
                self.nodes[event.node].round = event
            case VariableWritten():
                self.variables[event.name] = event
            case ServerSeen():
                self.servers[event.server] = event
            case TickLasts():
                self.lasting = None if event.is_over else event
                for each in self.stopped:
                    if each.in_tick and each.node.id == event.node:
                        each.ran = event.seconds
                if self.stop is not None and not event.is_over:
                    self._stop(event.at.steady)
            case NodesAdded():
                self._add(event.nodes)
            case NodesRemoved():
                self._remove(event.nodes)
            case RunBegan():
                stop, abandoned, servers = self.stop, self.abandoned, self.servers
                is_new = self.began is None or (
                    self.finished is not None
                    and stop is not None
                    and stop.at.number > self.finished.at.number
                )
                self.__init__()  # type: ignore[misc]
                if is_new:  # events of the setup
                    self.stop, self.abandoned, self.servers = stop, abandoned, servers
                self.now, self.began = event.at, event
                self._add(event.nodes)
                self.root = event.nodes[0].id
            case StopWanted():
                if self.stop is None:
                    self.stop = event
                    self._stop(event.at.steady)
                self.abandoned |= event.abandons
            case Paused():
                self.paused = event.paused
            case EventsLost():
                self.lost += event.count
            case TreeFinished():
                self.finished = event
            case RunEnded():
                self.ended = event
                for action in self.live if event.unaccounted else ():
                    action.leave(event.at.steady)

    def _add(self, nodes: tuple[Node, ...]) -> None:
        for node in nodes:
            self.nodes[node.id] = NodeStory(node)
            self._names[node.id] = node.name
            if node.parent in self.nodes:
                siblings = self.nodes[node.parent].children
                siblings.insert(len(siblings) if node.index is None else node.index, node.id)
        self._called.clear()

    def _remove(self, nodes: tuple[int, ...]) -> None:
        for number in nodes:
            story = self.nodes.pop(number, None) if number != self.root else None  # always there
            if story is not None and story.node.parent in self.nodes:
                self.nodes[story.node.parent].children.remove(number)
        self._called.clear()

    def _node_changed(self, event: NodeChanged) -> None:
        story = self.nodes[event.node]
        before = story.status
        if before is not Status.RUNNING:  # another visit
            story.ended = story.number
            story.visits += event.status is not Status.INVALID
            self._deal_with(story.pending, story.node.parent)
            story.pending = []
        self.changes += story.is_leaf
        self.leaves_ended += story.is_leaf and event.status in OVER
        story.status, story.message, story.number = event.status, event.message, event.at.number
        story.since, story.warning, story.due_in = event.at, event.warning, event.due_in
        if event.warning and event.status is Status.SUCCESS:
            self._warnings[event.node] = Warned(story.node, self.path(event.node), event.warning)
        if event.status is Status.FAILURE and not event.is_left_out:
            self._failed(story, event)
        elif event.status is not Status.RUNNING:
            for child in story.children:
                self._settle(child, event.node)

    def _failed(self, story: NodeStory, event: NodeChanged) -> None:
        passed: list[Failure] = []
        for child in story.children:
            below = self.nodes[child]
            failed = below.has_failed and below.number > story.ended
            if failed and not event.by_itself:
                passed += below.pending
                below.pending = []
            else:
                self._settle(child, event.node)
        if event.node in self._actions:
            self._actions[event.node].failed += 1
        story.pending = passed or [self._failure(story, event.message)]

    def _stop(self, now: float) -> None:
        """Take note of the running nodes, as the run is to end."""
        lasting = self.lasting
        self.stopped = [self._failure(each, each.message) for each in self.running]
        for failure, story in zip(self.stopped, self.running, strict=True):
            if lasting is not None and lasting.node == story.node.id:
                failure.in_tick = True
                failure.ran = now - lasting.at.steady + lasting.seconds
            else:
                failure.ran = now - story.since.steady if story.since is not None else 0.0

    def _failure(self, story: NodeStory, message: str) -> Failure:
        number = story.node.id
        action = self._actions.get(number)
        return Failure(
            story.node,
            self.now or Moment(0, 0.0, 0.0, 0.0),
            tuple(each.node for each in self.above(number)),
            message,
            self.rounds(number),
            action,
            tuple(action.tried) if action is not None else (),
            tuple(self._failure(each, each.message) for each in self._stopped_below(story)),
        )

    def _stopped_below(self, story: NodeStory) -> list[NodeStory]:
        """Return the leaves that a node has stopped in the visit that has failed."""
        found, waiting = list[NodeStory](), list(story.children)
        while waiting:
            below = self.nodes[waiting.pop()]
            waiting += below.children
            is_stopped = below.status in (Status.INVALID, Status.RUNNING)
            if below.is_leaf and is_stopped and below.number > story.ended:
                found.append(below)
        return found

    def _settle(self, child: int, by: int) -> None:
        """Take failures at or below `child` as dealt with, as they did not make `by` fail."""
        story = self.nodes[child]
        if story.pending:
            self._deal_with(story.pending, by)
            story.pending = []

    def _deal_with(self, failures: list[Failure], by: int | None) -> None:
        if by not in self.nodes or self.nodes[by].node.kind == "invert":  # for it a failure is none
            return
        for failure in failures:
            failure.by = self.nodes[by].node
            self.dealt_with.append(failure)
            self.dealt_with_in_all += 1

    # Asking

    def action(self, node: int) -> ActionStory:
        """Return the story of an action leaf; a new story at its first event."""
        if node not in self._actions:
            of = self.nodes[node].node
            self._actions[node] = ActionStory(of, self.path(node), of.server)
        return self._actions[node]

    def acts(self, node: int) -> bool:
        """Return whether a node is an action with an event."""
        return node in self._actions

    @property
    def actions(self) -> list[ActionStory]:
        """The actions that were tried, in the order of their first goal."""
        return list(self._actions.values())

    @property
    def live(self) -> list[ActionStory]:
        """The actions whose goal may be running now."""
        return [action for action in self._actions.values() if action.live]

    @property
    def servers_gone(self) -> list[str]:
        """The actions with a goal whose server went away.

        A server that only stood still goes on.
        """
        return [
            f"{self.called(action.node.id)} on {action.server}"
            for action in self._actions.values()
            if action.left_at_server
        ]

    @property
    def status(self) -> Status:
        """The status that the run has ended with; INVALID before that, and after a stop."""
        return self.finished.status if self.finished is not None else Status.INVALID

    @property
    def outputs(self) -> Mapping[str, Value]:
        """The outputs of the tree, once it has succeeded."""
        return self.finished.outputs if self.finished is not None else {}

    @property
    def decided(self) -> bool:
        """Whether the tree has come to its end, with or without all of its goals."""
        return self.status_of(self.root) in OVER

    @property
    def tree(self) -> str:
        """The name of the tree."""
        return self.began.tree if self.began is not None else ""

    @property
    def started(self) -> float:
        """The beginning of the run, in seconds on the steady clock."""
        if self.began is not None:
            return self.began.at.steady
        return self.latest

    @property
    def latest(self) -> float:
        """The moment of the latest event, in seconds on the steady clock."""
        return self.now.steady if self.now is not None else 0.0

    def since_began(self, now: float) -> float:
        """Return the seconds from the run's beginning to `now`; zero before it."""
        return max(0.0, now - self.started) if self.began is not None else 0.0

    @property
    def elapsed(self) -> float:
        """The seconds from the run's beginning to the latest event."""
        return max(0.0, self.latest - self.started)

    def status_of(self, node: int) -> Status:
        """Return the latest status of a node."""
        story = self.nodes.get(node)
        return story.status if story is not None else Status.INVALID

    def is_begun(self, node: int) -> bool:
        """Return whether a node did anything in the latest visits and rounds of all its holders."""
        number = self.nodes[node].number
        return all(
            number > above.ended and (above.round is None or number > above.round.at.number)
            for above in self.above(node)
        )

    def above(self, node: int) -> Iterator[NodeStory]:
        """Yield the nodes that hold a node, upwards."""
        parent = self.nodes[node].node.parent
        while parent is not None and parent in self.nodes:
            yield self.nodes[parent]
            parent = self.nodes[parent].node.parent

    def rounds(self, node: int) -> tuple[tuple[Node, RoundBegan], ...]:
        """Return the loops that hold a node, each with its latest round, the outermost first."""
        above = reversed(list(self.above(node)))
        return tuple((each.node, each.round) for each in above if each.round is not None)

    def below(self, node: int) -> Iterator[int]:
        """Yield all nodes below one."""
        waiting = list(self.nodes[node].children)
        while waiting:
            child = waiting.pop()
            waiting += self.nodes[child].children
            yield child

    def in_order(self) -> list[int]:
        """Return all nodes, each before its children."""
        waiting, found = [key for key in (self.root,) if key in self.nodes], list[int]()
        while waiting:
            node = waiting.pop()
            found.append(node)
            waiting.extend(reversed(self.nodes[node].children))
        return found

    def path(self, node: int) -> tuple[str, ...]:
        """Return the names from the root down to a node."""
        names = [self.nodes[node].node.name, *(above.node.name for above in self.above(node))]
        return tuple(reversed(names))

    def called(self, node: int) -> str:
        """Return a leaf's name; where others have it, behind the telling part of its path."""
        if not self._called:
            paths = {key: self.path(key) for key, each in self.nodes.items() if each.is_leaf}
            names = told_apart(paths.values())
            self._called = {key: names[path] for key, path in paths.items()}
        return self._called.get(node, self._names[node])

    @property
    def running(self) -> list[NodeStory]:
        """The running leaves, deepest first, and a node in whose tick the tree stays for long."""
        inside = self.lasting.node if self.lasting is not None else 0
        holders = {each.node.id for each in self.above(inside)} if inside in self.nodes else set()
        leaves = [
            each
            for each in self.nodes.values()
            if each.node.id == inside
            or (
                each.status is Status.RUNNING
                and each.node.id not in holders
                and not any(self.nodes[child].status is Status.RUNNING for child in each.children)
            )
        ]
        return sorted(leaves, key=lambda each: -sum(1 for _ in self.above(each.node.id)))

    @property
    def retries(self) -> bool:
        """Whether a running action is not at its first attempt."""
        tried = (self._actions.get(each.node.id) for each in self.running)
        return any(action is not None and action.attempt > 1 for action in tried)

    @property
    def unaccounted(self) -> list[str]:
        """A line for each goal whose end is not known, now that nothing more is waited for."""
        last = {key: goal.latest for action in self.actions for key, goal in action.goals.items()}
        told = self.finished.unaccounted if self.finished is not None else ()
        goals = {
            goal.goal_id: goal
            for goal in told
            if goal.goal_id not in last or last[goal.goal_id].end in (None, End.UNKNOWN)
        }
        for action in self.actions if self.abandoned else ():
            left = {each.goal_id: each.reason for each in action.given_up}
            left |= {key: f"{state.lower()} when left" for key, state in action.live.items()}
            for key, reason in left.items():
                name = self.called(action.node.id)
                report = GoalReport(name, action.server, key, action.outcome, reason)
                goals.setdefault(key, report)
        return [str(goal) for goal in goals.values()]

    @property
    def failures(self) -> list[Failure]:
        """The nodes by whose failure the tree has failed, in tree order."""
        if self.status is not Status.FAILURE:
            return []
        return sorted(self.nodes[self.root].pending, key=lambda each: each.node.id)

    @property
    def warnings(self) -> list[Warned]:
        """The leaves that succeeded in something that may not be meant, and why."""
        return list(self._warnings.values())
