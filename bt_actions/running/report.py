"""What happened to a tree's actions, collected from the one stream of events.

Every view and the exit code read from here. Draws nothing, waits for nothing, and looks at no
behaviour's state that an event has not told (the tree ticks on another thread meanwhile).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector

from bt_actions import document
from bt_actions.behaviours.decorators import Gate
from bt_actions.behaviours.places import path_of, told_apart
from bt_actions.events import Event, GoalChanged, NodeChanged, TreeStarted
from bt_actions.goals.policy import End, Outcome
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import fit

DONE = "DONE"
UNSENT = ("QUEUED", "WAITING_FOR_SERVER")
"""States of a goal before its request goes out."""


@dataclass(slots=True)
class Row:
    """All that one action leaf did in this run, over all its visits."""

    behaviour: Behaviour
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
    _latest: str = ""

    @property
    def live(self) -> dict[str, str]:
        """The goals that may be running, also those that the leaf has left: their states by id."""
        return {
            event.goal_id: event.state
            for event in self._goals.values()
            if event.state not in UNSENT and event.end in (None, End.UNKNOWN)
        }

    @property
    def left_at_server(self) -> bool:
        """Whether a goal of this leaf had a server that went away, and may be back with it."""
        return any(event.end is End.SERVER_GONE for event in self._goals.values())

    @property
    def in_doubt(self) -> bool:
        """Whether the latest goal has not begun as far as its server knows, which may change."""
        return self.end is End.NEVER_STARTED and self._latest in self._goals

    @property
    def waited_for(self) -> int:
        """How many goals of this leaf a run that is over waits for."""
        return len(self.live) + sum(each.end is End.NEVER_STARTED for each in self._goals.values())

    def observe(self, event: GoalChanged) -> None:
        """Take in one event of a goal of this leaf."""
        is_latest = event.goal_id == self._latest
        is_new = not is_latest and event.goal_id not in self._goals
        if event.state != DONE or event.end is End.SERVER_GONE:
            self._goals[event.goal_id] = event
        else:
            self._goals.pop(event.goal_id, None)
        if not is_latest and not is_new:
            return  # an older goal, on its way to its end
        if is_new:
            self._latest, self.attempt, self.outcome = event.goal_id, event.attempt, None
            self.attempts += 1
            if event.attempt <= 1:
                self.visits += 1
                self.begun, self.counted = event.time, self.duration
        if event.outcome is not None and self.outcome is None:
            self.duration = self.seconds(event.time)
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
            self.duration = self.seconds(now)
            self.outcome = Outcome.CANCELED
        self.end = End.UNKNOWN

    def seconds(self, now: float) -> float:
        """Return how long it took so far, a visit that is not over included."""
        if self.outcome is not None:
            return self.duration
        return self.counted + max(0.0, now - self.begun)


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
    _rows: dict[Behaviour, Row] = field(default_factory=dict)
    _changes: dict[Behaviour, NodeChanged] = field(default_factory=dict)  # of each node the latest
    _warnings: dict[Behaviour, Culprit] = field(default_factory=dict)
    _called: dict[Behaviour, str] = field(default_factory=dict)

    def observe(self, event: Event) -> None:
        """Take in one event, in the order of their coming."""
        self.now = event.time
        self.started = self.started or event.time  # a tree that cannot be set up never starts
        if isinstance(event, TreeStarted):
            self.started = event.time
        elif isinstance(event, NodeChanged):
            node, status = event.node, event.status
            self._changes[node] = event
            warning = str(getattr(node, "warning", ""))
            if warning and status is Status.SUCCESS:
                self._warnings[node] = self._culprit(node, warning)
            if node in self._rows and status in (Status.SUCCESS, Status.FAILURE):
                self._rows[node].settle()
        elif isinstance(event, GoalChanged):
            self.row(event.behaviour).observe(event)
        else:  # TreeFinished
            self.status = event.status
            self.finished = True

    def row(self, behaviour: Behaviour) -> Row:
        """Return the row of an action leaf, a new one at its first event."""
        if behaviour not in self._rows:
            server = str(getattr(behaviour, "server", ""))
            self._rows[behaviour] = Row(behaviour, path_of(behaviour), place_of(behaviour), server)
        return self._rows[behaviour]

    def called(self, leaf: Behaviour) -> str:
        """Return a leaf's name; where others have it, behind what of its path tells them apart."""
        if leaf not in self._called:  # also one that was added since
            paths = {each: path_of(each) for each in self.root.iterate() if not each.children}
            paths[leaf] = path_of(leaf)
            names = told_apart(paths.values())
            self._called = {each: names[path] for each, path in paths.items()}
        return self._called[leaf]

    def elapsed(self) -> float:
        """Return the seconds since the tree started, between events too."""
        return time.monotonic() - self.started if self.started else 0.0

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
        return [
            f"{self.called(row.behaviour)} on {row.server}"
            for row in self._rows.values()
            if row.left_at_server
        ]

    @property
    def decided(self) -> bool:
        """Whether the tree has come to its end, be it that goals of it have not."""
        return self.status_of(self.root) in (Status.SUCCESS, Status.FAILURE)

    def status_of(self, node: Behaviour) -> Status:
        """Return the status that `node` was last seen with."""
        change = self._changes.get(node)
        return change.status if change else Status.INVALID

    def message_of(self, node: Behaviour) -> str:
        """Return the feedback message that `node` last changed with."""
        change = self._changes.get(node)
        return change.message if change else ""

    @property
    def warnings(self) -> list[Culprit]:
        """The leaves that succeeded in something that may not be what was meant, and why."""
        return list(self._warnings.values())

    def culprits(self) -> list[Culprit]:
        """Return the leaves by whose failure the root has failed, in tree order."""
        if self.status is not Status.FAILURE:
            return []
        return [
            self._culprit(  # which may not be what it said first of that status
                leaf, leaf.feedback_message if self._as_it_ended(leaf) else self.message_of(leaf)
            )
            for leaf in self._failed_leaves(self.root)
        ]

    def summary(self) -> list[str]:
        """Say why the tree failed: for each culprit its path, attempts, outcome, reason, place."""
        lines: list[str] = []
        for culprit in self.culprits():
            how, why, row = "failed", culprit.message, culprit.row
            if row is not None and row.outcome is not None:
                tries = "1 attempt" if row.attempt == 1 else f"{row.attempt} attempts"
                is_told = row.end is End.UNKNOWN  # of the goal that is not accounted for
                how, why = f"{row.outcome} after {tries}", "" if is_told else row.reason or why
            lines += [" / ".join(culprit.path), f"  {how}{f': {clean(why)}' if why else ''}"]
            if culprit.place:
                lines.append(f"  {culprit.place}")
        return [fit(line) for line in lines]

    def _culprit(self, node: Behaviour, message: str) -> Culprit:
        return Culprit(node, path_of(node), message, place_of(node), self._rows.get(node))

    def _as_it_ended(self, node: Behaviour) -> bool:
        """Whether it was not stopped since it ended."""
        return node.status is self.status_of(node)

    def _failed_leaves(self, node: Behaviour) -> Iterator[Behaviour]:
        """Go down from a node that failed along what failed.

        What failed though nothing below it did speaks for itself, as a leaf does. What was reset
        since an earlier visit was not told of, so a child's own status counts; but a parent that
        was stopped when it had failed has none in its children any more, and a Selector resets
        those that failed.
        """
        own = self._as_it_ended(node) and not isinstance(node, Selector)
        below = [
            child
            for child in node.children
            if (child.status if own else self.status_of(child)) is Status.FAILURE
        ]
        if not below or (isinstance(node, Gate) and node.refused):  # they are of an earlier time
            yield node
        else:
            for child in below:
                yield from self._failed_leaves(child)


def place_of(node: Behaviour) -> str:
    """Return file:line:column where a tree file says `node`, or "" for a node made in Python."""
    return str(document.place_of(node) or "")
