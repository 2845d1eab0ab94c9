"""What all action traffic of this process shares: the one lock, the goals' handles, the resources.

Under the lock nothing waits, and no code of the user's runs. It is taken before a client's own
lock, never after. Nothing is decided or sent here.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.resources import Resources
from bt_actions.goals.terms import State
from bt_actions.recovery.ledger import Ledger
from bt_actions.ros.log import log
from bt_actions.servers.replies import Replies
from bt_actions.traffic.cancel_queue import Cancels

if TYPE_CHECKING:
    from bt_actions.traffic.endpoint import ActionEndpoint
    from bt_actions.traffic.traffic import Traffic

NEVER = float("-inf")
FEEDBACK_KEPT = 100
"""Feedback messages kept for a leaf that reads them and is not ticked; older ones are dropped."""

lock = threading.RLock()
changed = threading.Condition(lock)
"""Notified at every change of any goal."""
ledger = Ledger(log.warning)
"""What was sent and is not answered yet, for `cleanup`, should this process be killed."""
LOOKED_OUT_FOR = 3.0
"""Seconds for which a run that is over, or a leaf that is shut down, looks out for a server that
went away: one that only stood still goes on with its goal. Once for each goal."""
LOST_KEPT = 100
"""Goals of one action remembered in case their server, or their request, turns up: the newest."""


class Domain:
    """What all nodes of this process in one ROS domain share."""

    def __init__(self, number: int) -> None:
        self.resources: Resources[GoalHandle] = Resources()
        self.number = number
        self.lost_sight = False
        """A server that was in sight is not any more: what else its process serves may not be."""
        self.known: set[tuple[str, Any]] = set()
        """Names and types of the actions that had a server once."""
        self._lost: dict[tuple[str, Any], list[GoalHandle]] = {}
        self._cancels: dict[tuple[str, Any], Cancels] = {}

    def cancels_at(self, action: str, action_type: Any) -> Cancels:
        """Return the cancel requests of this process to an action."""
        return self._cancels.setdefault((action, action_type), Cancels())

    def keep_lost(self, action: str, action_type: Any, handle: GoalHandle) -> None:
        """Remember a lost goal whose endpoint goes: its server may be back for the next one."""
        kept = self._lost.setdefault((action, action_type), [])
        kept.append(handle)
        for forgotten in kept[:-LOST_KEPT]:
            ledger.strike(forgotten.goal.id)
        del kept[:-LOST_KEPT]

    def lost_with(self, resources: frozenset[str]) -> list[tuple[str, Any]]:
        """Return the actions of which goals are remembered that had some of these resources."""
        return [
            action
            for action, kept in self._lost.items()
            if any(handle.goal.resources & resources for handle in kept)
        ]

    def take_lost(self, action: str, action_type: Any) -> list[GoalHandle]:
        """Give them to a new endpoint."""
        return self._lost.pop((action, action_type), [])


_domains: dict[int, Domain] = {}


def domain_of(number: int) -> Domain:
    """Return what is shared in the ROS domain of this number."""
    with lock:
        domain = _domains.get(number)
        if domain is None:
            domain = _domains[number] = Domain(number)
        return domain


generation = 0
"""Forks between the first process and this one: what an older one made is not ours."""


def disown() -> None:
    """In the child of a fork: the goals are the parent's, and nobody is here who has the lock."""
    global generation
    generation += 1
    lock._at_fork_reinit()  # type: ignore[attr-defined]  # noqa: SLF001 - as threading itself does
    _domains.clear()
    ledger.disown()


@dataclass(eq=False, slots=True)
class GoalHandle:
    """A goal on its way, with what its owner and its server need to know."""

    goal: Goal
    endpoint: ActionEndpoint
    """Where it is sent; the endpoint that sees a lost goal's server again takes it over."""
    traffic: Traffic
    """Of the node that is told of its changes: where it was begun, or was adopted later."""
    owner: Any
    """The leaf; None where it is gone, and a second server has taken its goal, too."""
    name: str
    """The leaf's."""
    begun_in: object = None
    """What was ticking at the time (traffic/begun.py); None where nobody said it."""
    attempt: int = 1
    keeps_feedback: bool = False
    feedback: deque[Any] = field(default_factory=lambda: deque(maxlen=FEEDBACK_KEPT))
    replies: Replies = field(init=False)
    told_unknown: bool = False
    """The log says that it is not accounted for; and later, on whatever node, that it is."""
    told_gone: bool = False
    look_out_left: float | None = None
    """Seconds for which a server that went away with it is looked out for yet; None: none did."""
    kept_since: float | None = None
    """Since when it is not sent though a server is in sight (Route.holds_back), steady clock."""
    paused_at: float | None = None
    begun_at: float = NEVER
    not_gone_before: float = NEVER
    """Until when it is no news that its server is not shown: it may be stopped for less than its
    lease, or not be discovered yet. Both in seconds of the steady clock."""

    def __post_init__(self) -> None:
        self.replies = Replies(self.goal)

    @property
    def accounted_for(self) -> bool:
        """Whether the goal's end is known."""
        goal = self.goal
        return goal.outcome is not None and goal.end is not End.UNKNOWN and not goal.unconfirmed

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to wait for: nor a server that may only have stood still."""
        return self.accounted_for and not self.looked_out_for

    @property
    def looked_out_for(self) -> bool:
        """Whether a server is looked out for that went away with it, and has not told its end."""
        return self.goal.lost and bool(self.look_out_left)


@dataclass(frozen=True, slots=True)
class Change:
    """What an observer is told: a goal has a new state, outcome or end."""

    time: float
    handle: GoalHandle
    state: State
    outcome: Outcome | None
    end: End
    reason: str


Observer = Callable[[Change | None], None]
"""Called under the lock, on any thread; None means: something to read, no change of a goal."""
