"""What there is: a process, its ROS domains, their endpoints, and the goals on their way.

Each belongs to the one before it, and knows it. They are values and registers, and decide nothing;
what is done with them stands in the other files of this folder. `Host` is a part of the seam: one a
process with rclpy (ros/host.py), or one a simulated run (testing/host.py). All that goals share
beyond their endpoints hangs on it, so that nothing hangs on a module.
"""

from __future__ import annotations

import itertools
import weakref
from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Busy, End, Outcome, Timeouts
from bt_actions.goals.resources import Resources
from bt_actions.goals.terms import NEVER, Command, Event, Now, State
from bt_actions.servers.presence import GID, PROBES_KEPT, Server, ServerWatch
from bt_actions.servers.replies import Replies
from bt_actions.traffic.scheduler import Scheduled, Scheduler
from bt_actions.traffic.stalls import Stalls
from bt_actions.traffic.transport import ActionTransport, Listener
from bt_actions.utilities.plain_text import raised

FEEDBACK_KEPT = 100
"""Feedback messages kept for a leaf that reads them and is not ticked; older ones are dropped."""

Action = tuple[Any, str]
"""Type and name."""
_LONG_AGO = Now(NEVER, NEVER)


class Log(Protocol):
    """Takes lines from any thread, and never waits."""

    def info(self, text: str) -> None:
        """Log at info level."""

    def warning(self, text: str) -> None:
        """Log at warning level."""

    def error(self, text: str) -> None:
        """Log at error level."""

    def flush(self) -> None:
        """Have what was said written, before more is told by other ways; waits a moment at most."""


@dataclass(frozen=True, slots=True)
class Entry:
    """What is on record of a goal."""

    action: str
    domain: int
    """ROS domain id."""
    servers: frozenset[bytes]
    """GIDs of the servers that were in sight; none where they are not known."""
    accept: float = 0.0
    """Seconds that its server is given to decide; 0: nobody said."""
    lost: bool = False
    """They have gone, as far as is known; but they may only stand still."""


class Record:
    """What was sent and is not answered yet, should the process be killed; this one keeps nothing.

    recovery/ledger.py has one that does.
    """

    def __contains__(self, goal_id: bytes) -> bool:
        """Whether a goal is on record."""
        return False

    def enter(self, goal_id: bytes, entry: Entry) -> None:
        """Put a goal on record that is about to be sent, or what more is known of it."""

    def strike(self, goal_id: bytes) -> None:
        """Take a goal off the record, if it is there."""

    def close(self) -> None:
        """Take note that the process ends."""

    def disown(self) -> None:
        """Let go of it, as the child of a fork: it is the parent's."""


class Trace:
    """Is told of every step of every goal, under the lock; this one takes no note."""

    def tells(self, handle: GoalHandle, event: Event) -> None:
        """A goal is about to be told what happened."""

    def told(
        self, handle: GoalHandle, event: Event, detail: Any, commands: tuple[Command, ...]
    ) -> None:
        """A goal was told what happened, and returned these commands."""

    def shows_time(self, handle: GoalHandle) -> None:
        """A goal is about to be shown the time."""


class Host(Protocol):
    """What the goals of a process, or of one simulated run, have in common."""

    @property
    def lock(self) -> AbstractContextManager[Any]:
        """The one lock; whoever holds it may take it again. Nothing waits under it."""

    @property
    def log(self) -> Log:
        """Where lines go."""

    record: Record
    """Where a goal is put before it is sent."""

    stalls: Stalls
    """When this process stood still, and what it may not conclude yet."""

    scheduler: Scheduler
    """The endpoints with open goals."""

    trace: Trace
    """Who watches the goals' steps."""

    forks: int
    """Forks between the first process and this one: what an older one made is not ours."""

    closing: bool
    """Whether the process ends: a tree that ticks on begins nothing any more."""

    def domain(self, number: int) -> Domain:
        """Return what is shared in the ROS domain of this number."""

    def wait(self, timeout: float) -> bool:
        """Wait for a change of any goal, at most so many seconds; the caller holds the lock."""

    def notify_all(self) -> None:
        """Wake whoever waits, as a goal has changed; the caller holds the lock."""

    def steady(self) -> float:
        """Return seconds that only ever go forward."""

    def wall(self) -> float:
        """Return seconds since 1970 on the computer's clock."""

    def new_goal_id(self) -> bytes:
        """Return 16 bytes that no goal has had."""


class Domain:
    """What all nodes of this process in one ROS domain share."""

    def __init__(self) -> None:
        self.resources: Resources[GoalHandle] = Resources()
        self.effects: deque[tuple[Callable[[GoalHandle], None], GoalHandle]] = deque()
        """What goals have decided is to be done, in that order."""
        self.does_effects = False
        self.open: dict[Endpoint, None] = {}
        """The endpoints with goals, of all nodes, in the order in which they came."""
        self.unsent: dict[GoalHandle, None] = {}
        """Goals that are to be sent, and some that were since (driver.py drops them)."""
        self.left: dict[GoalHandle, None] = {}
        """Goals of these endpoints that hold no resources any more."""
        self.ever_lost_sight = False
        """A server went out of sight once: what else its process serves may have, too."""
        self.known: set[Action] = set()
        """The actions that had a server once."""
        self.lost: dict[Action, list[GoalHandle]] = defaultdict(list)
        """Lost goals whose endpoint is gone: their server may be back for the next one."""
        self.cancels: dict[Action, CancelQueue] = defaultdict(CancelQueue)


@dataclass(slots=True)
class CancelQueue:
    """The cancel requests of this process to one server (cancel_queue.py)."""

    waiting: dict[bytes, Endpoint] = field(default_factory=dict)
    """Whom there is no room for yet, and which endpoint is to ask."""
    asked: dict[bytes, float] = field(default_factory=dict)
    """When those were asked for that have no answer since."""


class Participant(Protocol):
    """A participant of the ROS network: what it sees and hears, the goals of its node do."""

    domain: int
    """The ROS domain id."""

    name: str
    """The name of the node."""

    namespace: str
    """The namespace of the node: "/" or "/r1"."""

    seen_since: float
    """Since when it sees others (seconds, steady clock).

    A new one has dropped no server yet: what it does not see it may still discover.
    """

    long_stalls: int
    """How often the process had stood still for long by `seen_since` (Stalls.long_times)."""

    def now(self) -> Now:
        """Return this moment, by the steady clock and by its own."""

    def alive(self) -> bool:
        """Whether it is there, and can send and hear."""

    def shut_down(self) -> bool:
        """Whether all of ROS was shut down here, as by Ctrl-C; else one that is not alive has gone
        from under its goals."""

    def full_name(self, action: str) -> str:
        """Return the full name of an action; raises ValueError for one that ROS refuses."""

    def open_transport(self, action_type: Any, name: str, listener: Listener) -> ActionTransport:
        """Open one; raises what the middleware raises for a wrong name or type."""

    def instead(self, action_type: Any, name: str) -> str:
        """Say, as the end of a sentence, what is in sight where this action is not; or ""."""

    def unheard(self) -> str:
        """Say, as the end of a sentence, what may keep a server in sight from answering; or ""."""

    def seek(self, endpoint: Endpoint) -> None:
        """Have another participant look for its server, soon, as long as `route.misses` it.

        Does nothing where there can be no other, or where it would find another server than ours.
        """


class Endpoint(Listener, Scheduled):
    """One action as one node sees it: the shared transport, and the goals on it.

    Each is an ActionEndpoint (endpoint.py), which has what the world calls: the methods of these
    two protocols.
    """

    def __init__(
        self, host: Host, participant: Participant, of_node: dict[str, Endpoint], action: Action
    ) -> None:
        """Open the transport; raises what the middleware raises for a wrong name or type."""
        self.host, self.participant = host, participant
        self.domain = host.domain(participant.domain)
        self.of_node = of_node
        """The endpoints of its node, by name: it takes itself out when it is not used any more."""
        self.action, self.name = action, action[1]
        self.users = 0
        """How many leaves are set up for it."""
        self.goals: dict[bytes, GoalHandle] = {}
        self.ended: dict[bytes, Ended] = {}
        """The newest goals that were DONE here."""
        self.cancels = self.domain.cancels[action]
        self.forks = host.forks
        """How many forks there had been when it was made."""

        # Its server (watcher.py)
        self.watch = ServerWatch()
        self.heard_at = host.steady()
        """When a server of its goals was last heard; a denial by a newcomer does not count."""
        self.orphaned = False
        """Its node is gone: nobody can want its goals any more."""
        self.look_at = 0.0
        """When to look at the server again."""
        self.looked_at, self.looked_like = NEVER, Server.ABSENT
        """When that was last done and told to the goals, and what was found."""
        self.counted = 0
        """How many servers were shown then."""
        self.held_back = (True, True)
        """Why nothing was sent then, though a server was in sight: it had just come, as it has in
        the beginning; `route.holds_back`."""
        self.left_by_dead: set[bytes] = set()
        """Goals of dead processes that were named."""
        self.probes = itertools.count(PROBES_KEPT)

        # The way to it (route.py)
        self.elsewhere = False
        """The transport is not in our node's participant: nobody spins it."""
        self.long_stalls = participant.long_stalls
        self.compared_at = NEVER
        """When a server was asked that has answered a transport on trial."""
        self._warned_of: set[str] = set()
        self.transport = participant.open_transport(*action, self)
        self.former: dict[ActionTransport, list[GoalHandle]] = {}
        """Transports that were replaced, and the goals whose request was under way there."""

    @property
    def is_parents(self) -> bool:
        """Whether this was made before a fork, and we are the child: the goals are not ours."""
        return self.forks != self.host.forks

    @property
    def handles(self) -> list[GoalHandle]:
        """Those of the goals that are here now."""
        return list(self.goals.values())

    @property
    def has_unsent(self) -> bool:
        """Whether a goal is still to be sent."""
        return any(not handle.goal.sent for handle in self.handles)

    def look_soon(self) -> None:
        """Have the next look at the server taken at once."""
        self.look_at = 0.0

    def warn_once(self, what: str, error: Exception) -> None:
        """Log, the first time, what could not be done, which is tried again later."""
        if what not in self._warned_of:
            self._warned_of.add(what)
            self.host.log.error(f"{self.name}: {what}: {raised(error)}")


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
    run: RunListener | None = None
    """Which run it belongs to: the last one that ticked its leaf; None where nobody said it."""
    attempt: int = 1
    keeps_feedback: bool = False
    begun_at: Now = _LONG_AGO
    """When it was wished for; long ago where nobody knows."""
    feedback: deque[Any] = field(default_factory=lambda: deque(maxlen=FEEDBACK_KEPT))
    replies: Replies = field(init=False)
    end_logged: End | None = None
    """The end that the log knows of: it says where that is UNKNOWN, and is not any more."""
    paused: bool = False
    """Its tree is, and it was not sent."""
    held_back_since: float | None = None
    """Since when (steady clock) its deadlines stand still, as it is paused, or not sent though a
    server is in sight (route.holds_back)."""
    not_gone_before: float = NEVER
    """Until when (steady clock) its server does not count as gone where it is not shown. It may be
    stopped, and is shown again within LEASE, or not be discovered by a new node, which takes
    TOO_NEW (handover.adopt, watcher.move_to)."""

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
    off_record: bool
    """Whether it need not be on record any more: whoever got it shows it, or will not run it.

    One that two servers got is accepted by one of them first. And a server that has gone may only
    stand still, for longer than this process is there."""

    @classmethod
    def of(cls, handle: GoalHandle) -> Standing:
        """Return it as it is now."""
        goal = handle.goal
        pending = goal.in_flight, goal.request_pending
        in_the_way = *pending, goal.outstanding, goal.lost, goal.claims_resources
        off_record = (goal.accepted and len(handle.replies.sent_to) <= 1) or (
            handle.accounted_for and goal.end is not End.SERVER_GONE
        )
        shown = goal.state.shown, goal.outcome, goal.end
        return cls(goal.state, shown, in_the_way, off_record)


@dataclass(eq=False)
class RunListener:
    """Who runs a tree, as its goals know it, which outlive both."""

    notify: Callable[[GoalHandle | None], None]
    """Takes note, on any thread and under the lock, of a goal of its that has a new state, outcome
    or end; of None: there is reason to tick."""
    feedback: Callable[[GoalHandle, Any], None] = lambda handle, message: None
    """Takes note, likewise, of feedback of a goal of its."""
    sight: Callable[[str, bool], None] = lambda server, in_sight: None
    """Takes note, likewise, that the server of one of its goals has come in sight, or gone."""


ticking_run: ContextVar[RunListener | None] = ContextVar("ticking_run", default=None)
"""Which run sets up, or ticks, a tree on this thread; None where nobody has said it, as in a loop
of the user's."""


def waker() -> Callable[[], None]:
    """Return what has the run of this thread tick soon; that may be called on any thread."""
    run = ticking_run.get()
    return (lambda: None) if run is None else (lambda: run.notify(None))


def wake(handles: Iterable[GoalHandle]) -> None:
    """Have the runs of these goals tick: something may be sent, or can be read."""
    for run in {handle.run: None for handle in handles}:
        if run is not None:
            run.notify(None)


@dataclass(slots=True)
class Ended:
    """What is kept of a goal that is DONE; not the goal itself, which has its result."""

    timeouts: Timeouts
    resources: frozenset[str]
    busy: Busy
    owner: weakref.ref[Any] | None
    name: str
    run: RunListener | None
    attempt: int
    accepted: bool
    servers: frozenset[GID]
    """Who may have had it."""
    since: float
    asked_at: float = NEVER
    """When it was last asked to be canceled all the same."""
