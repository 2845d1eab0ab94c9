"""The data of this room: a process, its ROS domains, their endpoints, and the goals on their way.

Each object belongs to the one before it in this list, and refers to it. The objects only hold data;
the other files of this folder act on them. `Host` is a part of the seam: a process with rclpy has
one (ros/host.py), and a simulated run has one (testing/host.py). The host holds everything that
goals share beyond their endpoints; no module has state.
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
    """A log that takes lines from any thread, and never waits."""

    def info(self, text: str) -> None:
        """Log at info level."""

    def warning(self, text: str) -> None:
        """Log at warning level."""

    def error(self, text: str) -> None:
        """Log at error level."""

    def flush(self) -> None:
        """Have the lines written before more is told by other ways; waits a moment at most."""


@dataclass(frozen=True, slots=True)
class Entry:
    """The facts on record of one goal."""

    action: str
    domain: int
    """ROS domain id."""
    servers: frozenset[bytes]
    """GIDs of the servers that were in sight; empty where they are not known."""
    accept: float = 0.0
    """Seconds that the server is given to decide; 0 where the sender set no limit."""
    lost: bool = False
    """Whether the servers have gone, as far as is known; a server may also stand still."""


class Record:
    """The record of requests without an answer, for cleanup after a kill.

    This one keeps nothing.

    The record of recovery/ledger.py keeps them in a file.
    """

    def __contains__(self, goal_id: bytes) -> bool:
        """Return whether a goal is on record."""
        return False

    def enter(self, goal_id: bytes, entry: Entry) -> None:
        """Put a goal on record before its request is sent, or update its facts on record."""

    def strike(self, goal_id: bytes) -> None:
        """Take a goal off the record, if it is there."""

    def close(self) -> None:
        """Take note that the process ends."""

    def disown(self) -> None:
        """Let go of the record in the child of a fork: the record is the parent's."""


class Trace:
    """A witness of every step of every goal, under the lock; this one takes no note."""

    def tells(self, handle: GoalHandle, event: Event) -> None:
        """Take note that a goal is about to be told an event."""

    def told(
        self, handle: GoalHandle, event: Event, detail: Any, commands: tuple[Command, ...]
    ) -> None:
        """Take note that a goal was told an event, and returned these commands."""

    def shows_time(self, handle: GoalHandle) -> None:
        """Take note that a goal is about to be shown the time."""


class Host(Protocol):
    """The common ground of all goals of a process, or of one simulated run."""

    @property
    def lock(self) -> AbstractContextManager[Any]:
        """The one lock, which its holder may take again. Nothing waits under it."""

    @property
    def log(self) -> Log:
        """The log of this process."""

    record: Record
    """The record of goals that are about to be sent."""

    stalls: Stalls
    """The stalls of this process, and the graces after them."""

    scheduler: Scheduler
    """The endpoints with open goals."""

    trace: Trace
    """The witness of the goals' steps."""

    forks: int
    """The number of forks between the first process and this one: objects from before belong to a
    parent."""

    closing: bool
    """Whether the process ends: a tree that ticks on begins nothing any more."""

    def domain(self, number: int) -> Domain:
        """Return the common data of the ROS domain of this number."""

    def wait(self, timeout: float) -> bool:
        """Wait for a change of any goal, at most so many seconds; the caller holds the lock."""

    def notify_all(self) -> None:
        """Wake all that `wait`, as a goal has changed; the caller holds the lock."""

    def steady(self) -> float:
        """Return the steady clock, in seconds that only ever grow."""

    def wall(self) -> float:
        """Return the computer's clock, in seconds since 1970."""

    def new_goal_id(self) -> bytes:
        """Return 16 bytes that no goal has had."""


class Domain:
    """The data that all nodes of this process in one ROS domain share."""

    def __init__(self) -> None:
        self.resources: Resources[GoalHandle] = Resources()
        self.effects: deque[tuple[Callable[[GoalHandle], None], GoalHandle]] = deque()
        """The effects of goals' decisions that are still to be done, in order."""
        self.does_effects = False
        self.open: dict[Endpoint, None] = {}
        """The endpoints with goals, of all nodes, in order of arrival."""
        self.unsent: dict[GoalHandle, None] = {}
        """Goals that are to be sent, and some that were sent since (driver.py drops these)."""
        self.left: dict[GoalHandle, None] = {}
        """Goals of these endpoints that hold no resources any more."""
        self.ever_lost_sight = False
        """Whether a server once went out of sight: other servers of its process may have gone with
        it."""
        self.known: set[Action] = set()
        """The actions that had a server once."""
        self.lost: dict[Action, list[GoalHandle]] = defaultdict(list)
        """Lost goals without an endpoint: the next endpoint may see their server again."""
        self.cancels: dict[Action, CancelQueue] = defaultdict(CancelQueue)


@dataclass(slots=True)
class CancelQueue:
    """The cancel requests of this process to one server (cancel_queue.py)."""

    waiting: dict[bytes, Endpoint] = field(default_factory=dict)
    """The goals whose cancel request waits for room, each with the endpoint that is to send it."""
    asked: dict[bytes, float] = field(default_factory=dict)
    """The cancel requests without an answer, each with the moment of the request."""


class Participant(Protocol):
    """A participant of the ROS network; its sight is that of the goals of its node."""

    domain: int
    """The ROS domain id."""

    name: str
    """The name of the node."""

    namespace: str
    """The namespace of the node: "/" or "/r1"."""

    seen_since: float
    """The moment from which on it sees others (seconds, steady clock).

    A new participant has dropped no server yet: a server out of its sight may still be discovered.
    """

    long_stalls: int
    """The value of Stalls.long_times at `seen_since`."""

    def now(self) -> Now:
        """Return this moment, by the steady clock and by the node's own."""

    def alive(self) -> bool:
        """Return whether the participant is there, and can send and hear."""

    def shut_down(self) -> bool:
        """Return whether all of ROS was shut down here, as by Ctrl-C.

        A participant that is not alive for another reason was destroyed under its goals.
        """

    def full_name(self, action: str) -> str:
        """Return the full name of an action; raises ValueError for a name that ROS refuses."""

    def open_transport(self, action_type: Any, name: str, listener: Listener) -> ActionTransport:
        """Open a transport; raises what the middleware raises for a wrong name or type."""

    def instead(self, action_type: Any, name: str) -> str:
        """Say, as the end of a sentence, what is in sight where this action is not; or ""."""

    def unheard(self) -> str:
        """Say, as the end of a sentence, what may keep a server in sight from answering; or ""."""

    def seek(self, endpoint: Endpoint) -> None:
        """Have another participant look for the endpoint's server, as long as `route.misses` it.

        Does nothing where no other participant can exist, or where it would find another server.
        """


class Endpoint(Listener, Scheduled):
    """One action as one node sees it: the shared transport, and the goals on it.

    Each is an ActionEndpoint (endpoint.py), which has the methods of both protocols, for the world
    to call.
    """

    def __init__(
        self, host: Host, participant: Participant, of_node: dict[str, Endpoint], action: Action
    ) -> None:
        """Open the transport; raises what the middleware raises for a wrong name or type."""
        self.host, self.participant = host, participant
        self.domain = host.domain(participant.domain)
        self.of_node = of_node
        """The endpoints of its node, by name: an unused endpoint takes itself out."""
        self.action, self.name = action, action[1]
        self.users = 0
        """The number of leaves that are set up for it."""
        self.goals: dict[bytes, GoalHandle] = {}
        self.ended: dict[bytes, Ended] = {}
        """The newest goals that were DONE here."""
        self.cancels = self.domain.cancels[action]
        self.forks = host.forks
        """The number of forks when it was made."""

        # Its server (watcher.py)
        self.watch = ServerWatch()
        self.heard_at = host.steady()
        """The last moment at which a server of its goals was heard; a denial by a newcomer does not
        count."""
        self.orphaned = False
        """Whether its node is gone: nobody can want its goals any more."""
        self.look_at = 0.0
        """The moment of the next look at the server."""
        self.looked_at, self.looked_like = NEVER, Server.ABSENT
        """The last look that was told to the goals: its moment, and the server's state."""
        self.counted = 0
        """The number of servers shown then."""
        self.held_back = (True, True)
        """Why nothing was sent at that look though a server was in sight: the server had just come
        (as at the beginning); `route.holds_back`."""
        self.left_by_dead: set[bytes] = set()
        """Goals of dead processes that the log has named."""
        self.probes = itertools.count(PROBES_KEPT)

        # The way to it (route.py)
        self.elsewhere = False
        """Whether the transport is in another participant than our node's: nobody spins that one.
        """
        self.long_stalls = participant.long_stalls
        self.compared_at = NEVER
        """The moment of the question to a server that has answered a transport on trial."""
        self._warned_of: set[str] = set()
        self.transport = participant.open_transport(*action, self)
        self.former: dict[ActionTransport, list[GoalHandle]] = {}
        """Replaced transports, each with the goals whose request was under way there."""

    @property
    def is_parents(self) -> bool:
        """Whether the endpoint is from before a fork, and this process is the child.

        Its goals are not ours.
        """
        return self.forks != self.host.forks

    @property
    def handles(self) -> list[GoalHandle]:
        """The goals that are here now."""
        return list(self.goals.values())

    @property
    def has_unsent(self) -> bool:
        """Whether a goal is still to be sent."""
        return any(not handle.goal.sent for handle in self.handles)

    def look_soon(self) -> None:
        """Have the next look at the server taken at once."""
        self.look_at = 0.0

    def warn_once(self, what: str, error: Exception) -> None:
        """Log a failure the first time; the action that failed is tried again later."""
        if what not in self._warned_of:
            self._warned_of.add(what)
            self.host.log.error(f"{self.name}: {what}: {raised(error)}")


@dataclass(eq=False, slots=True)
class GoalHandle:
    """A goal on its way, with the facts that its owner and its server need."""

    goal: Goal
    endpoint: Endpoint
    """The endpoint that sends the goal; the one that sees a lost goal's server again takes it over.
    """
    owner: Any
    """The leaf; None where the leaf is gone, and a second server has taken its goal, too."""
    name: str
    """The name of the leaf."""
    run: RunListener | None = None
    """The run that ticked the leaf last; None in a loop of the user's."""
    attempt: int = 1
    keeps_feedback: bool = False
    begun_at: Now = _LONG_AGO
    """The moment at which the leaf began the goal; long ago where that is unknown."""
    feedback: deque[Any] = field(default_factory=lambda: deque(maxlen=FEEDBACK_KEPT))
    replies: Replies = field(init=False)
    end_logged: End | None = None
    """The end that the log knows: the log tells an UNKNOWN end, and when it becomes known."""
    paused: bool = False
    """Whether the tree is paused, and the goal is not sent."""
    held_back_since: float | None = None
    """The moment (steady clock) from which on the deadlines stand still: the goal is paused, or is
    not sent though a server is in sight (route.holds_back)."""
    not_gone_before: float = NEVER
    """The moment (steady clock) until which a server out of sight does not count as gone. The
    server may be stopped, and is shown again within LEASE. A new node may not have discovered it,
    which takes TOO_NEW (handover.adopt, watcher.move_to)."""

    standing: Standing = field(init=False)
    """The standing of the goal after its last step."""

    def __post_init__(self) -> None:
        self.replies = Replies(self.goal)
        self.standing = Standing.of(self)

    @property
    def is_decided(self) -> bool:
        """Whether the outcome is decided, with the end and the result that are known by then.

        Readable without the lock: the step of the decision is over.
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
        """Whether nothing is left to wait for, not even a server that may only stand still."""
        return self.accounted_for and not self.looked_out_for

    @property
    def looked_out_for(self) -> bool:
        """Whether the return of a server that went away with the goal is awaited."""
        return self.goal.lost and Event.LOOK_OUT_DUE in self.goal.deadlines


class Standing(NamedTuple):
    """The part of a goal's state from which the effects of a step follow."""

    state: State
    shown: tuple[str, Outcome | None, End]
    in_the_way: tuple[bool, ...]
    """The facts that other goals may wait for: room at the server, or this goal's end."""
    off_record: bool
    """Whether the goal need not be on record: its server shows the goal, or will not run it.

    Of two servers with the request, one accepts first, and the other may not have decided. A server
    that has gone may only stand still, for longer than this process lives.
    """

    @classmethod
    def of(cls, handle: GoalHandle) -> Standing:
        """Return the present standing of a goal."""
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
    """A run of a tree as its goals know it; the listener outlives both."""

    notify: Callable[[GoalHandle | None], None]
    """The call for a goal with a new state, outcome or end, on any thread and under the lock; None
    as the goal: the tree has reason to tick."""
    feedback: Callable[[GoalHandle, Any], None] = lambda handle, message: None
    """The call for feedback of one of its goals, likewise."""
    sight: Callable[[str, bool], None] = lambda server, in_sight: None
    """The call for a server of one of its goals that comes in sight, or goes, likewise."""


ticking_run: ContextVar[RunListener | None] = ContextVar("ticking_run", default=None)
"""The run that sets up or ticks a tree on this thread; None in a loop of the user's."""


def waker() -> Callable[[], None]:
    """Return a function for any thread, which has the run of this thread tick soon."""
    run = ticking_run.get()
    return (lambda: None) if run is None else (lambda: run.notify(None))


def wake(handles: Iterable[GoalHandle]) -> None:
    """Have the runs of these goals tick: something may be sent, or can be read."""
    for run in {handle.run: None for handle in handles}:
        if run is not None:
            run.notify(None)


@dataclass(slots=True)
class Ended:
    """The facts kept of a DONE goal; the goal itself, with its result, is dropped."""

    timeouts: Timeouts
    resources: frozenset[str]
    busy: Busy
    owner: weakref.ref[Any] | None
    name: str
    run: RunListener | None
    attempt: int
    accepted: bool
    servers: frozenset[GID]
    """The servers that may have had the goal."""
    since: float
    asked_at: float = NEVER
    """The last moment at which a server was asked to cancel the goal all the same."""
