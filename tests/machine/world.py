"""A world of action servers in virtual time, in which every message may be lost, late or doubled.

It holds what is true: both clocks, the network, and what really runs on each server. It knows
nothing of goals/ (production.py has that driven) and judges nothing (judge.py does). No ROS,
no thread, no randomness: a move is offered by `World.options` and made by `World.make`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, Protocol

from bt_actions.goals.terms import (
    CANCEL_ACCEPTED,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN_GOAL,
    STATUS_ABORTED,
    STATUS_CANCELED,
    STATUS_SUCCEEDED,
    Now,
)

UNANSWERED, EXECUTING, CANCELING = 0, 2, 3
TERMINAL = (STATUS_SUCCEEDED, STATUS_CANCELED, STATUS_ABORTED)
NODES = (0, 1)
"""Nodes of the caller's process; each discovers servers for itself."""
IN_THE_AIR = 30
"""So many messages are under way at most; what is over gets lost."""


class Mood(Enum):
    """How a server takes cancel requests."""

    OBEYS = "obeys"
    REFUSES = "refuses"
    UNHEARING = "hears nothing"


@dataclass(eq=False, slots=True)
class Job:
    """A goal as its server sees it."""

    goal_id: bytes
    name: str
    server: ModelServer
    status: int = UNANSWERED
    canceled: bool = False
    """A cancel request was granted."""
    unwanted: bool = False
    """A cancel request has come."""
    asked: list[int] = field(default_factory=list)
    """Result requests that wait for the end, by number."""

    @property
    def live(self) -> bool:
        return self.server.alive and self.status in (EXECUTING, CANCELING)

    def __repr__(self) -> str:
        return f"{self.name} on {self.server}"


@dataclass(eq=False, slots=True)
class ModelServer:
    """One process that serves an action."""

    action: str
    gid: bytes
    alive: bool = True
    cut: bool = False
    """The link is down: nothing arrives, but it runs on."""
    shown: bool = True
    """Discovery shows it; a dead server is shown, too, for a while."""
    matched: bool = True
    """Its services are matched, too; without them it is shown, and not ready."""
    mood: Mood = Mood.OBEYS
    jobs: dict[bytes, Job] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"{self.action}#{self.gid.decode()}"

    def becomes(self, mood: Mood) -> None:
        self.mood = mood

    def is_cut(self) -> None:
        self.cut = True

    def lapses(self) -> None:
        self.shown = False


@dataclass(eq=False, slots=True)
class Message:
    """Something under way between the client and one server."""

    kind: str
    server: ModelServer
    goal_id: bytes
    name: str
    detail: Any = None
    number: int = 0
    """Of the request, and of its answer."""
    to_server: bool = False

    def __repr__(self) -> str:
        route = "to" if self.to_server else "from"
        about = f" of {self.name}" if self.name else ""
        detail = "" if self.detail is None else f" {self.detail}"
        return f"{self.kind}{about}{detail} {route} {self.server}"


class Client(Protocol):
    """Who gets the answers, and acts as time goes by (production.Caller)."""

    def receive(self, message: Message) -> None: ...

    def attend(self) -> None: ...

    def due_in(self) -> float: ...

    def accepted_on_server(self, job: Job) -> None: ...

    def crowded(self, action: str, *, but_lost: bool = False) -> None: ...


Options = Sequence[Any]


class World:
    """What is true, and what can happen next."""

    def __init__(self, actions: Sequence[str]) -> None:
        self.now = Now(100.0, 1000.0)
        self.preempts = False
        """A server that accepts a goal aborts those that it runs."""
        self.pace = 1.0
        """How fast the node's clock runs against the steady one; 0 is a paused simulator."""
        self.servers: list[ModelServer] = []
        self.jobs: list[Job] = []
        self.overlooked: set[tuple[bytes, int]] = set()
        """Servers that one of the nodes is not shown."""
        self.air: list[Message] = []
        self.room = IN_THE_AIR
        self.was_full = False
        """Something was lost, as there was too much in the air."""
        self.actions = actions
        self.client: Client
        self.kinds: dict[str, tuple[Callable[[], Options], Callable[[Any], object]]] = {
            "deliver": (self._deliverable, self.deliver),
            "lose": (lambda: self.air, self.air.remove),
            "repeat": (self._repeatable, self._add),
            "answer": (self._answerable, lambda choice: self.answer(*choice)),
            "feedback": (self._running, self.give_feedback),
            "finish": (self._finishable, lambda choice: self.finish(*choice)),
            "expire": (self._finished, self._expire),
            "mood": (self._moods, lambda choice: choice[0].becomes(choice[1])),
            "kill": (self._alive, self._kill),
            "leave": (self._alive, self._leave),
            "crash": (self._alive, self._crash),
            "start": (self._startable, self.start),
            "cut": (self._connected, lambda server: server.is_cut()),
            "outage": (self._connected, self._outage),
            "lapse": (self._lapsable, lambda server: server.lapses()),
            "falter": (self._alive, self._falter),
            "overlook": (self._overlookable, self.overlooked.add),
            "notice": (lambda: sorted(self.overlooked), self._notice),
            "heal": (lambda: [s for s in self.servers if s.cut and s.alive], self.heal),
            "wait": (lambda: (0.05, 0.3, 0.3, 0.9, 0.9, None, 3.1), self.wait),
            "calm": (lambda: (None,), lambda _: self.calm()),
            "clock": (lambda: ("runs", "stops", "crawls", "back", "ahead"), self.set_clock),
        }

    def options(self, kind: str) -> Options:
        """Return what a move of this kind can be made with now; empty when it cannot be."""
        return self.kinds[kind][0]()

    def make(self, kind: str, choice: Any) -> None:
        """Make a move."""
        self.kinds[kind][1](choice)

    # Time

    def wait(self, seconds: float | None) -> None:
        """Let time pass, until the client's next deadline where `seconds` is None."""
        if seconds is None:
            seconds = self.client.due_in()
        self.now = Now(self.now.steady + seconds, self.now.ros + seconds * self.pace)
        self.client.attend()

    def calm(self) -> None:
        """For some seconds all that is under way arrives, and nothing else happens."""
        for _ in range(6):
            for message in self._deliverable():
                if message in self.air:
                    self.deliver(message)
            self.wait(0.9)

    def set_clock(self, what: str) -> None:
        """Do something to the node's clock; the client notices when it next looks."""
        if what in ("back", "ahead"):
            jump = -7.0 if what == "back" else 7.0
            self.now = Now(self.now.steady, self.now.ros + jump)
        else:
            self.pace = {"runs": 1.0, "stops": 0.0, "crawls": 0.1}[what]

    # What the client does

    def in_sight(self, server: ModelServer, node: int) -> bool:
        """Return whether discovery shows a server to a node."""
        return server.shown and (server.gid, node) not in self.overlooked

    def _seen(self, action: str, node: int) -> list[ModelServer]:
        return [s for s in self.servers if s.action == action and self.in_sight(s, node)]

    def shown(self, action: str, node: int) -> frozenset[bytes]:
        """Return the GIDs that discovery shows to a node."""
        return frozenset(server.gid for server in self._seen(action, node))

    def send(self, message: Message, action: str, node: int) -> int:
        """Send a request to whoever is matched; return how many live servers that are."""
        reached = [server for server in self._seen(action, node) if server.alive]
        for server in reached:
            self._add(replace(message, server=server))
        return len(reached)

    def ready(self, action: str, node: int) -> bool:
        """Return whether discovery shows a node a server with all its services."""
        return any(server.matched for server in self._seen(action, node))

    def _add(self, message: Message) -> None:
        if len(self.air) < self.room:
            self.air.append(replace(message))
        else:
            self.was_full = True

    # The network

    def _deliverable(self) -> Options:
        return [message for message in self.air if not message.server.cut]

    def _repeatable(self) -> Options:
        """A request is never doubled: DDS takes a sample from a writer once."""
        return [message for message in self.air if not message.to_server]

    def deliver(self, message: Message) -> None:
        """Let a message arrive."""
        self.air.remove(message)
        if not message.to_server:
            self.client.receive(message)
        elif message.server.alive:
            self._serve(message)

    # The servers

    def _serve(self, message: Message) -> None:
        server, job = message.server, message.server.jobs.get(message.goal_id)
        if message.kind == "goal":
            server.jobs[message.goal_id] = job = Job(message.goal_id, message.name, server)
            self.jobs.append(job)
            job.asked.append(message.number)  # until it is answered: the number of the request
        elif message.kind == "probe":
            self._reply(message, "probe answer", None)
        elif message.kind == "cancel":
            if server.mood is not Mood.UNHEARING:
                self._reply(message, "cancel answer", self._cancel(server, job))
        elif job is None or job.status == UNANSWERED:
            self._reply(message, "result", 0)
        elif job.status in TERMINAL:
            self._reply(message, "result", job.status)
        else:
            job.asked.append(message.number)

    @staticmethod
    def _cancel(server: ModelServer, job: Job | None) -> int:
        if job is None or job.status == UNANSWERED:
            return CANCEL_UNKNOWN_GOAL
        if job.status in TERMINAL:
            return CANCEL_TERMINATED
        job.unwanted = True
        if server.mood is Mood.REFUSES:
            return CANCEL_REJECTED
        job.status, job.canceled = CANCELING, True
        return CANCEL_ACCEPTED

    def _reply(self, request: Message, kind: str, detail: Any) -> None:
        self._add(
            Message(kind, request.server, request.goal_id, request.name, detail, request.number)
        )

    def _tell(self, job: Job, kind: str, detail: Any = None, number: int = 0) -> None:
        self._add(Message(kind, job.server, job.goal_id, job.name, detail, number))

    def _answerable(self) -> Options:
        open_jobs = [job for job in self.jobs if job.status == UNANSWERED and job.server.alive]
        return [(job, accepts) for job in open_jobs for accepts in (True, True, True, False)]

    def answer(self, job: Job, accepts: bool) -> None:
        """Accept a goal, or refuse it."""
        number = job.asked.pop()
        self._tell(job, "answer", accepts, number)
        if accepts:
            job.status = EXECUTING
            self._tell(job, "status", EXECUTING)
            self.client.accepted_on_server(job)
            if self.preempts:
                for other in [other for other in self.jobs if other.live and other is not job]:
                    if other.server is job.server:
                        self.finish(other, STATUS_ABORTED)
        else:
            self.jobs.remove(job)
            del job.server.jobs[job.goal_id]

    def _running(self) -> Options:
        return [job for job in self.jobs if job.live]

    def give_feedback(self, job: Job) -> None:
        """Publish feedback."""
        self._tell(job, "feedback", "moving")

    def _finishable(self) -> Options:
        return [(job, status) for job in self.jobs if job.live for status in TERMINAL]

    def publish_status(self, servers: Collection[bytes] | None = None) -> None:
        """Publish the status of every goal, or those of some servers, once more.

        As servers do at each change of any, and the middleware for whoever discovers them later.
        """
        for job in self.jobs:
            if servers is not None and job.server.gid not in servers:
                continue
            if job.server.alive and job.status != UNANSWERED and job.goal_id in job.server.jobs:
                self._tell(job, "status", job.status)

    def _notice(self, which: tuple[bytes, int]) -> None:
        self.overlooked.discard(which)
        self.publish_status(which[:1])

    def finish(self, job: Job, status: int) -> None:
        """Bring a goal to its end; CANCELED without being asked is what an operator does."""
        job.status = status
        self._tell(job, "status", status)
        for number in job.asked:
            self._tell(job, "result", status, number)
        job.asked.clear()

    def _finished(self) -> Options:
        return [
            job
            for job in self.jobs
            if job.status in TERMINAL and job.server.alive and job.goal_id in job.server.jobs
        ]

    @staticmethod
    def _expire(job: Job) -> None:
        """The server forgets a finished goal: its `result_timeout` has passed."""
        del job.server.jobs[job.goal_id]

    def _moods(self) -> Options:
        return [(s, mood) for s in self.servers if s.alive for mood in Mood if mood is not s.mood]

    def _alive(self) -> Options:
        return [server for server in self.servers if server.alive]

    def _connected(self) -> Options:
        return [server for server in self.servers if server.alive and not server.cut]

    def _kill(self, server: ModelServer) -> None:
        server.alive = server.cut = False  # it stays in discovery until the lease runs out

    def _crash(self, server: ModelServer) -> None:
        """It dies, and what watches over it starts it anew; the dead one is shown beside it."""
        self._kill(server)
        if self._startable():
            self.start(server.action)

    def _leave(self, server: ModelServer) -> None:
        self._kill(server)
        server.shown = False

    def _overlookable(self) -> Options:
        pairs = [(s.gid, node) for s in self.servers if s.shown for node in NODES]
        return [pair for pair in pairs if pair not in self.overlooked]

    def _lapsable(self) -> Options:
        return [s for s in self.servers if s.shown and (s.cut or not s.alive)]

    @staticmethod
    def _outage(server: ModelServer) -> None:
        """The link is down for longer than the lease, at one blow."""
        server.cut, server.shown = True, False

    @staticmethod
    def _falter(server: ModelServer) -> None:
        """Its services vanish from discovery, or are there again; messages pass all the same."""
        server.matched = not server.matched

    def _startable(self) -> Options:
        return self.actions if len(self.servers) < 8 else ()

    def start(self, action: str) -> None:
        """Start a server, beside others of the same name where there are any."""
        if any(
            server.alive and server.shown and server.action == action for server in self.servers
        ):
            self.client.crowded(action)
        self.servers.append(ModelServer(action, b"%d" % (len(self.servers) + 1)))

    def restart(self, action: str) -> None:
        """A server leaves in good order, and another takes its place at once."""
        for server in self.servers:
            if server.alive and server.shown and server.action == action:
                self._leave(server)
                self.start(action)
                break

    def heal(self, server: ModelServer) -> None:
        """The link is up again, and with it everything that was kept back."""
        if any(s.alive and s is not server and s.action == server.action for s in self.servers):
            self.client.crowded(server.action, but_lost=True)
        server.cut, server.shown = False, True
        self.publish_status([server.gid])
