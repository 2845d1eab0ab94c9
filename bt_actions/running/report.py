"""What happened to a tree's actions, collected from the one stream of events.

Every view and the exit code read from here. Draws nothing, waits for nothing, and looks at no
behaviour's state that an event has not told (the tree ticks on another thread meanwhile).
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector

from bt_actions import document
from bt_actions.behaviours.decorators import Gate
from bt_actions.events import Event, GoalChanged, NodeChanged, TreeFinished, TreeStarted
from bt_actions.goals.policy import End, Outcome
from bt_actions.utilities.places import path_of

DONE = "DONE"
UNSENT = ("QUEUED", "WAITING_FOR_SERVER")
"""States of a goal before its request goes out."""
REMEMBERED = 64
"""Goals of a leaf that are known again when their last news come late."""


@dataclass(slots=True)
class Row:
    """All that one action leaf did in this run, over all its visits."""

    behaviour: Behaviour
    name: str
    path: tuple[str, ...]
    place: str
    """file:line:column, or ""."""
    server: str
    attempts: int = 0
    """Goals wished for in all visits."""
    attempt: int = 0
    """The number of the latest within its visit."""
    visits: int = 0
    outcome: Outcome | None = None
    """Of the latest attempt; None while it is under way."""
    end: End | None = None
    reason: str = ""
    state: str = ""
    begun: float = 0.0
    """When the latest visit began."""
    counted: float = 0.0
    """Seconds of the visits before the latest."""
    duration: float = 0.0
    """Seconds from the first wish to the last outcome of each visit, summed up."""
    _goals: dict[str, GoalChanged] = field(default_factory=dict)  # of which more may come: latest
    _recent: deque[str] = field(default_factory=lambda: deque(maxlen=REMEMBERED))

    @property
    def live(self) -> bool:
        """Whether a goal of this leaf may be running, be it one that the leaf has left."""
        return bool(self.live_goals)

    @property
    def live_goals(self) -> dict[str, str]:
        """The goals that may be running, by their ids: their states."""
        latest = self._goals.values()
        return {e.goal_id: e.state for e in latest if _is_open(e) and e.state not in UNSENT}

    @property
    def left_at_server(self) -> bool:
        """Whether a goal of this leaf had a server that went away, and may be back with it."""
        return any(event.end is End.SERVER_GONE for event in self._goals.values())

    @property
    def in_doubt(self) -> bool:
        """Whether the latest goal has not begun as far as its server knows, which may change."""
        return bool(self._recent) and _is_doubtful(self._goals.get(self._recent[-1]))

    @property
    def waited_for(self) -> int:
        """How many goals of this leaf a run that is over waits for."""
        return len(self.live_goals) + sum(map(_is_doubtful, self._goals.values()))

    def observe(self, event: GoalChanged) -> None:
        """Take in one event of a goal of this leaf."""
        if _is_open(event) or _is_doubtful(event) or event.end is End.SERVER_GONE:
            self._goals[event.goal_id] = event
        else:
            self._goals.pop(event.goal_id, None)
        if event.goal_id not in self._recent:
            self._begin(event)
        elif event.goal_id != self._recent[-1]:
            return  # an older goal, on its way to its end
        elif event.outcome is not None and self.outcome is None:
            self._count(event)
        self.state, self.outcome, self.end = event.state, event.outcome, event.end
        self.reason = event.reason

    def settle(self) -> None:
        """Take over the leaf's own judgement: it may have expected more than the server did, and
        knows why it did not try again."""
        outcome = getattr(self.behaviour, "outcome", None)
        if outcome is not None:  # None: it is visited anew already
            self.outcome = outcome
            self.reason = str(getattr(self.behaviour, "reason", "")) or self.reason

    def leave(self, now: float) -> None:
        """Its goals are waited for no longer: how they end is not known."""
        if self.outcome is None:
            self.outcome = Outcome.CANCELED
            self.duration = self.counted + max(0.0, now - self.begun)
        self.end = End.UNKNOWN

    def _begin(self, event: GoalChanged) -> None:
        self._recent.append(event.goal_id)
        self.attempts += 1
        self.attempt = event.attempt
        if event.attempt <= 1:
            self.visits += 1
            self.begun, self.counted = event.time, self.duration
        if event.outcome is not None:
            self._count(event)

    def _count(self, event: GoalChanged) -> None:
        self.duration = self.counted + max(0.0, event.time - self.begun)


def _is_open(event: GoalChanged) -> bool:
    """Whether its goal has no known end, be it that it was not sent yet."""
    return event.state != DONE and (event.outcome is None or event.end in (None, End.UNKNOWN))


def _is_doubtful(event: GoalChanged | None) -> bool:
    """Whether its goal has not begun as far as its server knows, which may change."""
    if event is None or event.state == DONE or event.outcome is None:
        return False
    return event.end is End.NEVER_STARTED


@dataclass(frozen=True, slots=True)
class Culprit:
    """One leaf that made the tree fail, or is warned of."""

    node: Behaviour
    path: tuple[str, ...]
    message: str
    place: str
    row: Row | None
    """What the action did; None for a leaf that is no action."""


@dataclass(slots=True)
class Report:
    """Collects events; answers what a view, the table, the summary and the exit code need."""

    root: Behaviour
    status: Status = Status.INVALID
    started: float = 0.0
    finished: bool = False
    now: float = 0.0
    """The time of the latest event."""
    unaccounted: list[str] = field(default_factory=list)
    """One line for each goal whose end is not known, now that the run is over."""
    _clock: Callable[[], float] = time.monotonic
    _begun: float | None = None
    _rows: dict[UUID, Row] = field(default_factory=dict)
    _statuses: dict[UUID, tuple[Status, str]] = field(default_factory=dict)
    _warnings: dict[UUID, Culprit] = field(default_factory=dict)

    def observe(self, event: Event) -> None:
        """Take in one event, in the order of their coming."""
        self.now = event.time
        self.started = self.started or event.time  # a tree that cannot be set up never starts
        if isinstance(event, TreeStarted):
            self.started = event.time
            self._begun = self._clock()
        elif isinstance(event, NodeChanged):
            self._statuses[event.node.id] = (event.status, event.message)
            warning = str(getattr(event.node, "warning", ""))
            if warning and event.status is Status.SUCCESS:
                node = event.node
                warned = Culprit(node, event.path, warning, place_of(node), None)
                self._warnings[node.id] = warned
            row = self._rows.get(event.node.id)
            if row is not None and event.status in (Status.SUCCESS, Status.FAILURE):
                row.settle()
        elif isinstance(event, GoalChanged):
            self.row(event.behaviour).observe(event)
        elif isinstance(event, TreeFinished):
            self.status = event.status
            self.finished = True

    def row(self, behaviour: Behaviour) -> Row:
        """Return the row of an action leaf, a new one at its first event."""
        row = self._rows.get(behaviour.id)
        if row is None:
            row = Row(
                behaviour,
                behaviour.name,
                path_of(behaviour),
                place_of(behaviour),
                str(getattr(behaviour, "server", "")),
            )
            self._rows[behaviour.id] = row
        return row

    def elapsed(self) -> float:
        """Return the seconds since the tree started, between events too."""
        return 0.0 if self._begun is None else self._clock() - self._begun

    @property
    def rows(self) -> list[Row]:
        """The actions that were tried, in the order of their first goal."""
        return list(self._rows.values())

    @property
    def live(self) -> list[Row]:
        """The actions whose goal may be running now."""
        return [row for row in self._rows.values() if row.live]

    @property
    def servers_gone(self) -> list[str]:
        """The actions with a goal whose server went away; one that only stood still goes on."""
        return [f"{row.name} on {row.server}" for row in self._rows.values() if row.left_at_server]

    @property
    def decided(self) -> bool:
        """Whether the tree has come to its end, be it that goals of it have not."""
        return self.status_of(self.root) in (Status.SUCCESS, Status.FAILURE)

    def seconds(self, row: Row) -> float:
        """Return how long `row` took so far, a visit that is not over included."""
        if row.outcome is not None or not row.visits:
            return row.duration
        return row.counted + max(0.0, self.now - row.begun)

    def status_of(self, node: Behaviour) -> Status:
        """Return the status that `node` was last seen with."""
        return self._statuses.get(node.id, (Status.INVALID, ""))[0]

    def message_of(self, node: Behaviour) -> str:
        """Return the feedback message that `node` last changed with."""
        return self._statuses.get(node.id, (Status.INVALID, ""))[1]

    @property
    def warnings(self) -> list[Culprit]:
        """The leaves that succeeded in something that may not be what was meant, and why."""
        return list(self._warnings.values())

    def culprits(self) -> list[Culprit]:
        """Return the leaves by whose failure the root has failed, in tree order."""
        if self.status is not Status.FAILURE:
            return []
        return [
            Culprit(leaf, path_of(leaf), self._why(leaf), place_of(leaf), self._rows.get(leaf.id))
            for leaf in self._failed_leaves()
        ]

    def _why(self, node: Behaviour) -> str:
        """Return what a node says of its failure, which may not be its first of that status."""
        as_it_ended = node.status is self.status_of(node)
        return node.feedback_message if as_it_ended else self.message_of(node)

    def _stands(self, child: Behaviour) -> Status:
        """Return the status of a child when its parent failed.

        What was reset since an earlier visit was not told of. But a parent that was stopped when it
        had failed has no status in its children any more, and a Selector resets those that failed.
        """
        parent = child.parent
        if parent is None:
            return self.status
        as_it_ended = parent.status is self.status_of(parent)
        if as_it_ended and not isinstance(parent, Selector):
            return child.status
        return self.status_of(child)

    def _failed_leaves(self) -> Iterator[Behaviour]:
        """Go down from the root along what failed.

        What failed though nothing below it did speaks for itself, as a leaf does.
        """
        waiting = [self.root]
        while waiting:
            node = waiting.pop()
            below = [child for child in node.children if self._stands(child) is Status.FAILURE]
            if isinstance(node, Gate) and node.refused:
                below = []  # whose statuses may be those of an earlier time
            if below:
                waiting.extend(reversed(below))
            else:
                yield node


def place_of(node: Behaviour) -> str:
    """Return file:line:column where a tree file says `node`, or "" for a node made in Python."""
    place = document.place_of(node)
    return "" if place is None else f"{place.file}:{place.line}:{place.column}"
