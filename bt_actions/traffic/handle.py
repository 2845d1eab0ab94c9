"""A goal on its way, and what it belongs to: its endpoint, its run, its ROS domain.

Values, registers, and the protocols by which the parts of traffic/ know each other.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.resources import Resources
from bt_actions.goals.terms import NEVER, Event, Now, State
from bt_actions.servers.presence import Server, ServerWatch
from bt_actions.servers.replies import Replies, Told
from bt_actions.traffic.cancel_queue import Cancels
from bt_actions.traffic.scheduler import Scheduled
from bt_actions.traffic.transport import ActionTransport, Listener, Participant

FEEDBACK_KEPT = 100
"""Feedback messages kept for a leaf that reads them and is not ticked; older ones are dropped."""

Action = tuple[Any, str]
"""Type and name."""
_LONG_AGO = Now(NEVER, NEVER)


class Endpoint(Listener, Scheduled, Protocol):
    """One action as one node sees it (ActionEndpoint), as its parts and its neighbors know it."""

    participant: Participant
    domain: Domain
    name: str
    action: Action
    users: int
    goals: dict[bytes, GoalHandle]
    watch: ServerWatch
    transport: ActionTransport
    cancels: Cancels
    orphaned: bool
    """Its node is gone: nobody can want its goals any more."""
    heard_at: float
    """When its servers were last heard of."""

    @property
    def is_parents(self) -> bool:
        """Whether this was made before a fork, and we are the child: the goals are not ours."""

    @property
    def handles(self) -> list[GoalHandle]:
        """Those of the goals that are here now."""

    @property
    def has_unsent(self) -> bool:
        """Whether a goal is still to be sent."""

    def tell(self, handle: GoalHandle, event: Event, detail: Any = None) -> None:
        """Tell a goal what happened and do what it says."""

    def pass_on(self, handle: GoalHandle, told: Told) -> None:
        """Tell a goal what is believed of what was said of it, or seen."""

    def apply_deadlines(self, handle: GoalHandle) -> None:
        """Let the goal's deadlines take effect; what fails in it stops nothing."""

    def take_in(self, handle: GoalHandle) -> None:
        """See to this goal from now on."""

    def retire(self, handle: GoalHandle) -> None:
        """See to it no more."""

    def deliver_arrived(self) -> None:
        """Take what has arrived, whether or not somebody spins."""

    def observe_and_tell(self, now: float) -> Server:
        """Observe the server, tell the goals what that means for them, and return its state."""

    def recent_state(self, now: float) -> Server:
        """Return the server's state; observe it, where that may have changed."""

    def observe(self) -> None:
        """Observe who is in sight; what follows is for `observe_and_tell` to say."""

    def ask_to_cancel(self, goal_id: bytes) -> None:
        """Ask the server to cancel a goal, as soon as its queue has room."""

    def in_doubt(self, now: float) -> float:
        """Return for how many seconds a server that is silent may not have heard us; or 0."""

    def holds_back(self, now: float) -> bool:
        """Whether nothing is sent though a server is in sight."""

    def probe(self) -> None:
        """Ask the server just in order to be answered."""

    def replace_transport(self, transport: ActionTransport) -> None:
        """Use another transport, of which nothing is known yet."""


@dataclass(eq=False, slots=True)
class GoalHandle:
    """A goal on its way, with what its owner and its server need to know."""

    goal: Goal
    endpoint: Endpoint
    """Where it is sent; the endpoint that sees a lost goal's server again takes it over."""
    owner: Any
    """The leaf; None where it is gone, and a second server has taken its goal, too."""
    name: str
    """The leaf's."""
    begun_in: Run | None = None
    """Which run it belongs to: the last one that ticked its leaf; None where nobody said it."""
    attempt: int = 1
    keeps_feedback: bool = False
    begun_at: Now = _LONG_AGO
    """When it was wished for; long ago where nobody knows."""
    feedback: deque[Any] = field(default_factory=lambda: deque(maxlen=FEEDBACK_KEPT))
    replies: Replies = field(init=False)
    told: End | None = None
    """The end that the log knows of: it says where that is UNKNOWN, and is not any more."""
    paused: bool = False
    """Its tree is, and it was not sent."""
    held_back_since: float | None = None
    """Since when (steady clock) its deadlines stand still, as it is paused, or not sent though a
    server is in sight (Route.holds_back)."""
    not_gone_before: float = NEVER
    """Until when (steady clock) its server does not count as gone where it is not shown. It may be
    stopped, and is shown again within LEASE, or not be discovered by a new node, which takes
    TOO_NEW (handover.adopt, Route.move_to)."""

    standing: Standing = field(init=False)
    """How the goal stood after its last step."""

    def __post_init__(self) -> None:
        self.replies = Replies(self.goal)
        self.standing = Standing.of(self)

    @property
    def is_decided(self) -> bool:
        """Whether its outcome is decided, and its end and result are set as they are known then.

        Asked without the lock: the step that decided it is over.
        """
        return self.standing.shown[1] is not None

    @property
    def accounted_for(self) -> bool:
        """Whether the goal's end is known."""
        goal = self.goal
        return (
            goal.outcome is not None
            and goal.end is not End.UNKNOWN
            and not goal.may_still_be_accepted
        )

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to wait for: nor a server that may only have stood still."""
        return self.accounted_for and not self.looked_out_for

    @property
    def looked_out_for(self) -> bool:
        """Whether a server is looked out for that went away with it, and has not told its end."""
        return self.goal.lost and Event.LOOK_OUT_DUE in self.goal.deadlines


class Standing(NamedTuple):
    """What of a goal matters for what follows from a step."""

    state: State
    shown: tuple[str, Outcome | None, End]
    in_the_way: tuple[bool, ...]
    """What others may wait for: room at its server, or its end."""
    answered: bool
    """Whether it need not be on record any more: whoever got it shows it, or will not run it.

    One that two servers got is accepted by one of them first. And a server that has gone may only
    stand still, for longer than this process is there."""

    @classmethod
    def of(cls, handle: GoalHandle) -> Standing:
        """Return it as it is now."""
        goal = handle.goal
        pending = goal.in_flight, goal.request_pending
        in_the_way = *pending, goal.outstanding, goal.lost, goal.claims_resources
        answered = (goal.accepted and len(handle.replies.sent_to) <= 1) or (
            handle.accounted_for and goal.end is not End.SERVER_GONE
        )
        shown = goal.state.shown, goal.outcome, goal.end
        return cls(goal.state, shown, in_the_way, answered)


@dataclass(eq=False)
class Run:
    """Who runs a tree, as its goals know it, which outlive both."""

    tell: Callable[[GoalHandle | None], None]
    """Takes note, on any thread and under the lock, of a goal of its that has a new state, outcome
    or end; of None: there is reason to tick."""


begun_in: ContextVar[Run | None] = ContextVar("begun_in", default=None)
"""Which run sets up, or ticks, a tree on this thread; None where nobody has said it, as in a loop
of the user's."""


def waker() -> Callable[[], None]:
    """Return what has the run of this thread tick soon; that may be called on any thread."""
    run = begun_in.get()
    return (lambda: None) if run is None else (lambda: run.tell(None))


def wake(handles: Iterable[GoalHandle]) -> None:
    """Have the runs of these goals tick: something may be sent, or can be read."""
    for run in {handle.begun_in: None for handle in handles}:
        if run is not None:
            run.tell(None)


Effect = Callable[[GoalHandle], None]
"""What is done for a goal."""


class Effects:
    """What goals have decided is to be done, in that order; the caller holds the host's lock."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Effect, GoalHandle]] = deque()
        self._runs = False

    def run(self, handle: GoalHandle, effects: Iterable[Effect]) -> None:
        """Do these for a goal behind what was decided before, and what is meanwhile behind these.

        Where that is under way, whoever has begun it does all.
        """
        self._waiting.extend([(effect, handle) for effect in effects])
        if self._runs:
            return
        self._runs = True
        try:
            while self._waiting:
                effect, whose = self._waiting.popleft()
                effect(whose)
        finally:
            self._runs = False


class Domain:
    """What all nodes of this process in one ROS domain share."""

    def __init__(self) -> None:
        self.resources: Resources[GoalHandle] = Resources()
        self.effects = Effects()
        self.open: dict[Endpoint, None] = {}
        """The endpoints with goals, of all nodes, in the order in which they came."""
        self.unsent: dict[GoalHandle, None] = {}
        """Goals that are to be sent, and some that were since (Driver drops them)."""
        self.left: dict[GoalHandle, None] = {}
        """Goals of these endpoints that hold no resources any more."""
        self.ever_lost_sight = False
        """A server went out of sight once: what else its process serves may have, too."""
        self.known: set[Action] = set()
        """The actions that had a server once."""
        self.lost: dict[Action, list[GoalHandle]] = defaultdict(list)
        """Lost goals whose endpoint is gone: their server may be back for the next one."""
        self.cancels: dict[Action, Cancels] = defaultdict(Cancels)
        """The cancel requests of this process."""
