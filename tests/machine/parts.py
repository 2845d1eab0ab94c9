"""What caller and judge keep: goals on their way, lines, leaves, and the notes on each goal.

Values only; nothing here acts or judges.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from bt_actions.attempts import Attempts
from bt_actions.goal import Goal
from bt_actions.goal_terms import State
from bt_actions.policy import Busy, End, Outcome, Retry, Timeouts
from bt_actions.server import ServerWatch
from bt_actions.testimony import Testimony

if TYPE_CHECKING:
    from tests.machine.world import Job


class Before(NamedTuple):
    """A goal before a step."""

    state: State
    outcome: Outcome | None
    reason: str
    accepted: bool
    end: End
    lost: bool


@dataclass(eq=False, slots=True)
class Ledger:
    """What the judge has written down of one goal."""

    since: float
    """When its state began, steady clock."""
    ros: float
    forward: float = 0.0
    """How far the node's clock has gone forward, as the goal saw it."""
    begun_at: float = 0.0
    heard_at: float | None = 0.0
    """Values of `forward`: at acceptance, and at the last feedback."""
    polled_at: float = 0.0
    slow: float = 0.0
    """The longest time between two polls: a caller that is slow makes deadlines late."""
    sends: int = 0
    releases: int = 0
    cancels: int = 0
    unwanted: bool = False
    """Interrupted, or replaced, before it had an outcome."""
    replaced: bool = False
    refused: bool = False
    denied: bool = False
    """The last answer to a cancel request was: unknown goal."""
    excuse: str = ""
    """Why it may run beside another goal on its resource."""
    crowded: bool = False
    """Its request reached two live servers."""
    heard: frozenset[bytes] = frozenset()
    """Servers whose acceptance has been heard."""
    closed: bool = False
    beside: tuple[Ticket, ...] = ()
    """Lost goals whose server was out of sight when this one was sent: they may turn up again."""
    jobs: tuple[Job, ...] = ()


@dataclass(eq=False, slots=True)
class Ticket:
    """A goal on its way, with what the caller and the judge keep of it."""

    goal: Goal
    name: str
    line: Line
    twin: bool = False
    """A goal that has ended, as a second server runs it."""
    ledger: Ledger = field(init=False)
    testimony: Testimony = field(init=False)

    def __post_init__(self) -> None:
        self.testimony = Testimony(self.goal)

    def __repr__(self) -> str:
        return self.name


@dataclass(eq=False, slots=True)
class Line:
    """One action as one node sees it: its watch, and the goals on it."""

    action: str
    node: int
    watch: ServerWatch = field(default_factory=ServerWatch)
    tickets: dict[bytes, Ticket] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LeafPlan:
    """How a leaf is made."""

    action: str
    timeouts: Timeouts = Timeouts()  # noqa: RUF009 - frozen
    retry: Retry = Retry()  # noqa: RUF009 - frozen
    resources: frozenset[str] = frozenset()
    busy: Busy = Busy.WAIT
    node: int = 0

    def __repr__(self) -> str:
        limits = ", ".join(f"{f} {getattr(self.timeouts, f)}" for f in Timeouts.__slots__)
        named = "everything" if Outcome.SERVER_LOST in self.retry.outcomes else "the default"
        tries = f"{self.retry.attempts} tries, on {named}"
        where = f"{self.action} on node {self.node}"
        return f"{where}, {self.busy.value}, {set(self.resources)}; {limits}; {tries}"


@dataclass(eq=False, slots=True)
class Leaf:
    """One leaf of a tree: visited, ticked, interrupted, visited again."""

    name: str
    plan: LeafPlan
    line: Line
    attempts: Attempts | None = None
    ticket: Ticket | None = None
    visits: int = 0

    def __repr__(self) -> str:
        return self.name
