"""What caller and judge keep: leaves, and the notes on each goal.

Values only; nothing here acts or judges.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from bt_actions.goals.attempts import Attempts
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Busy, End, Outcome, Retry, Timeouts
from bt_actions.goals.terms import State
from bt_actions.servers.replies import Replies

if TYPE_CHECKING:
    from bt_actions.traffic import state as traffic
    from tests.machine.world import Job


class Before(NamedTuple):
    """A goal before a step."""

    state: State
    outcome: Outcome | None
    reason: str
    accepted: bool
    end: End


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
    """Values of `forward`: at acceptance, and at the last feedback; None where it has ended."""
    doubted: bool = False
    """It seems to have ended, and owes a result, or has said since that it runs."""
    polled_at: float = 0.0
    slow: float = 0.0
    """The longest time between two polls: a caller that is slow makes deadlines late."""
    sends: int = 0
    releases: int = 0
    cancels: int = 0
    unwanted: bool = False
    """Interrupted, or replaced, before it had an outcome."""
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
    left: bool = False
    """Its node has gone, and somebody else is to see to it."""
    beside: tuple[GoalHandle, ...] = ()
    """Lost goals whose server was out of sight when this one was sent: they may turn up again."""
    jobs: tuple[Job, ...] = ()


@dataclass(eq=False, slots=True)
class GoalHandle:
    """A goal on its way (traffic.GoalHandle), with its name and what the judge keeps of it."""

    real: traffic.GoalHandle
    name: str
    ledger: Ledger = field(init=False)

    @property
    def goal(self) -> Goal:
        return self.real.goal

    @property
    def endpoint(self) -> traffic.Endpoint:
        return self.real.endpoint

    @property
    def node(self) -> int:
        """The number of the node that sees to it."""
        return int(self.endpoint.participant.name)

    @property
    def replies(self) -> Replies:
        return self.real.replies

    def __repr__(self) -> str:
        return self.name


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
        return f"{where}, {self.busy.value}, {sorted(self.resources)}; {limits}; {tries}"


@dataclass(eq=False, slots=True, weakref_slot=True)
class Leaf:
    """One leaf of a tree: visited, ticked, interrupted, visited again."""

    name: str
    plan: LeafPlan
    attempts: Attempts | None = None
    handle: traffic.GoalHandle | None = None
    visits: int = 0

    def __repr__(self) -> str:
        return self.name
