"""Leaves, and the production traffic/endpoint.py and traffic/traffic.py beneath them, in a model
world.

A model is what lies around them: the client, the node, the graph, the clocks and the alarm's
thread. Of the two files themselves nothing is copied. Each step of a goal is shown to the judge.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

from bt_actions.goals.attempts import AttemptRecord, Attempts
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.resources import Resources
from bt_actions.goals.terms import Command, Event, Now, State
from bt_actions.ros.action_client import GOALS_KEPT
from bt_actions.servers.reachability import Reachability
from bt_actions.servers.stalls import IN_A_ROW, Stalls
from bt_actions.traffic import alarm, shared, traffic
from bt_actions.traffic import ended as past
from bt_actions.traffic import endpoint as endpoint
from bt_actions.traffic import route as route
from bt_actions.traffic.endpoint import ActionEndpoint
from bt_actions.traffic.traffic import Traffic
from tests.machine.judge import Judge, Violation
from tests.machine.parts import GoalHandle, Leaf, LeafPlan
from tests.machine.world import NODES, Job, Message, World

DOMAIN = 1
LEASE = 3.0
"""Seconds without a look after which a process has dropped the servers that it saw."""
_playing: list[Caller] = []
"""The caller of the play that goes on, last."""


def now() -> Caller:
    """Return the caller of the play that goes on."""
    return _playing[-1]


class ModelTime:
    """The module `time` of the code under test: no two moments are the same."""

    @staticmethod
    def monotonic() -> float:
        return now().moment()


class ModelClient:
    """ros/action_client.py, whose messages go through the model world."""

    def __init__(self, node: Any, action_type: Any, name: str, listener: Any) -> None:
        self.node, self.name, self._listener = node, name, listener
        self.closed = self.has_more = False
        self.reachability = Reachability()
        self._asked: dict[int, tuple[str, Any, float, dict[bytes, Any]]] = {}
        self._past: dict[int, tuple[str, Any, float, dict[bytes, Any]]] = {}

    def server_is_ready(self) -> bool:
        return now().world.ready(self.name, self.node.number)

    def send(self, goal_id: bytes, message: Any) -> None:
        caller = now()
        if caller.takes("fails_to_send"):
            raise RuntimeError("no space left")
        if caller.takes("restarts_meanwhile"):
            caller.world.restart(self.name)
        for newcomer in ("opens_meanwhile", "another_opens_meanwhile"):
            if caller.takes(newcomer):
                caller.world.start(self.name)
        caller.judge.sent(caller.seen[goal_id], self._ask("goal", goal_id, goal_id))

    def cancel(self, goal_id: bytes) -> None:
        self._ask("cancel", goal_id, goal_id)

    def ask_result(self, goal_id: bytes) -> None:
        self._ask("result", goal_id, goal_id)

    def probe(self, number: int, goal_id: bytes) -> None:
        self._ask("probe", number, b"")

    def _ask(self, kind: str, about: Any, goal_id: bytes) -> int:
        if self.closed:
            raise RuntimeError("the client is destroyed")
        caller = now()
        number = caller.file(self)
        self._asked[number] = (kind, about, caller.moment(), {})
        if kind != "result":
            self.reachability.asked(caller.moment())
        handle = caller.seen.get(goal_id)
        name = "" if handle is None else handle.name
        nobody = caller.world.servers[0]
        message = Message(kind, nobody, goal_id, name, number=number, to_server=True)
        return caller.world.send(message, self.name, self.node.number)

    def forget(self, about: Any) -> None:
        for number, question in list(self._asked.items()):
            if question[1] == about:
                del self._asked[number]
                if question[0] == "goal":
                    self._past[number] = question
        while len(self._past) > GOALS_KEPT:
            del self._past[next(iter(self._past))]

    def pump(self) -> bool:
        return False

    def destroy(self) -> None:
        self.closed = True

    def hear(self, message: Message) -> None:
        """Take an answer; one that comes twice is the same answer."""
        question = self._asked.get(message.number) or self._past.get(message.number)
        if self.closed or question is None:
            return
        kind, about, asked, by_server = question
        self.reachability.answered(asked)
        if kind == "probe":
            self._listener.probe_answered(about)
            return
        if message.server.gid in by_server:
            return
        by_server[message.server.gid] = message.detail
        answers = tuple(by_server.values())
        if kind == "goal":
            self._listener.goal_answered(about, answers)
        elif kind == "cancel":
            self._listener.cancel_answered(about, asked, answers)
        else:
            results = tuple((status, None) for status in answers)
            self._listener.result_came(about, asked, results)


class Silence:
    """The log, to which nobody listens."""

    def error(self, endpoint: str) -> None: ...

    info = warning = error


class NoLedger:
    """The record of what is sent, which nobody reads."""

    def enter(self, *entry: Any, **more: Any) -> None: ...

    strike = enter

    def __contains__(self, goal_id: bytes) -> bool:
        return False


class Context:
    """What Traffic asks of a context."""

    def get_domain_id(self) -> int:
        return DOMAIN


class Node:
    """What ActionEndpoint and Traffic ask of a node."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.context = Context()

    def get_clock(self) -> Any:
        return SimpleNamespace(ros_time_is_active=False)

    def get_namespace(self) -> str:
        return "/"

    def get_name(self) -> str:
        return "node"


class Caller:
    """Leaves, and beneath them the production traffic of two nodes."""

    def __init__(self, world: World, plans: Iterable[LeafPlan], judge: Judge) -> None:
        self.world, self.judge = world, judge
        self.leaves = [Leaf(f"leaf{number}", each) for number, each in enumerate(plans)]
        self.seen: dict[bytes, GoalHandle] = {}
        """Every goal that was ever begun, the oldest first."""
        self.closed = False
        self.froze = False
        self._freezes = 0
        self.misfortunes: set[str] = set()
        self._clients: list[ModelClient] = []
        self._moments = 0
        self._next_name = ""
        self._chance = random.Random(0)
        _playing[:] = [self]
        shared._domains.clear()
        alarm._open.clear()
        alarm.stalls = Stalls()
        self._traffics = {number: self._traffic(number) for number in NODES}
        self._endpoints: dict[
            tuple[str, int], ActionEndpoint
        ] = {}  # made when a leaf first wants them
        world.client = self
        judge.caller = self
        kinds = (
            "fails_to_send builds_nonsense unexpected restarts_meanwhile freezes "
            "opens_meanwhile another_opens_meanwhile"
        )
        world.kinds.update(
            {
                "tick": (lambda: () if self.closed else self.leaves, self.tick),
                "interrupt": (
                    lambda: [leaf for leaf in self.leaves if leaf.attempts is not None],
                    self.interrupt,
                ),
                "misfortune": (lambda: tuple(kinds.split()), self.misfortunes.add),
                "look": (lambda: (None,), lambda _: self.attend()),
                "drained": (
                    self._left_behind,
                    lambda handle: handle.endpoint.tell(handle.real, Event.DRAINED),
                ),
                "rerun": (lambda: () if self.closed else NODES, self.run_again),
            }
        )

    def takes(self, misfortune: str) -> bool:
        """Whether this misfortune waits; it strikes once."""
        waits = misfortune in self.misfortunes
        self.misfortunes.discard(misfortune)
        return waits

    def moment(self) -> float:
        """Return a moment, a little later each time it is asked for."""
        self._moments += 1
        return self.world.now.steady + self._moments * 1e-9

    def file(self, client: ModelClient) -> int:
        """Return the number of a client's next question."""
        self._clients.append(client)
        return len(self._clients)

    # What is beneath the leaves

    def _traffic(self, number: int) -> Traffic:
        node: Any = Node(number)
        clocks: Any = SimpleNamespace(now=lambda: self.world.now)
        made = Traffic(node)
        made.clocks = clocks
        made.seen_since = float("-inf")  # it has discovered who is there
        return made

    def come(self, action: str, node: int) -> ActionEndpoint:
        """Return the line of a node to an action, made when it is first wanted."""
        found = self._endpoints.get((action, node))
        if found is None:
            of_node = self._traffics[node]
            found = of_node._endpoints.get(action)
            if found is None:
                found = of_node._endpoints[action] = ActionEndpoint(of_node, "type", action)
            found.users += 1
            self._endpoints[action, node] = found
        return found

    def new_goal_id(self) -> bytes:
        return b"%d" % len(self.seen)

    def begun(self, real: shared.GoalHandle) -> None:
        """Take note of a handle that is made, but for a duplicate's, which has its goal's id."""
        if real.goal.id not in self.seen:
            handle = self.seen[real.goal.id] = GoalHandle(real, self._next_name)
            self.judge.begins(handle)

    def known(self, goal: Goal) -> GoalHandle | None:
        """Return what the judge knows of a goal: nothing where that is a duplicate."""
        handle = self.seen.get(goal.id)
        return handle if handle is not None and handle.goal is goal else None

    def told(
        self, goal: Goal, event: Event, detail: Any, step: Callable[[], tuple[Command, ...]]
    ) -> tuple[Command, ...]:
        """Have the judge see what a goal is told, and what it says."""
        handle = self.known(goal)
        if handle is None:
            return step()
        before = self.judge.before(handle)
        commands = step()
        shown = None if event.name.endswith("_DUE") else event
        self.judge.after(handle, before, shown, detail, commands)
        return commands

    def park(self, goal: Goal) -> None:
        """Have the judge see that a goal is DONE, and its line has put it away."""
        if goal.state is not State.DONE:
            return
        handle = self.known(goal)
        if handle is None:
            self.judge.twin_is_done(goal)
        else:
            self.judge.is_done(handle)

    # The leaves

    def tick(self, leaf: Leaf) -> None:
        """Visit an idle leaf, or let a running one take note and go on."""
        of_node = self._traffics[leaf.plan.node]
        to_action = self.come(leaf.plan.action, leaf.plan.node)
        if leaf.handle is not None and leaf.attempts is not None:
            to_action.look(self.moment())
            leaf.handle.endpoint.poll(leaf.handle)
            goal = leaf.handle.goal
            if goal.outcome is not None:
                self._judge_attempt(leaf, leaf.attempts, leaf.handle)
                return
        if leaf.attempts is None:
            leaf.attempts = Attempts(leaf.plan.retry, None)
            leaf.visits += 1
        if leaf.handle is None:
            if leaf.attempts.pause_left(self.world.now) > 0.0:
                return
            self._next_name = f"{leaf.name}.{leaf.visits}.{leaf.attempts.attempt}"
            wants = leaf.plan.timeouts, leaf.plan.resources, leaf.plan.busy
            leaf.handle = of_node.begin(to_action, leaf, *wants)
        of_node.advance(leaf.handle, self._message)

    def _message(self) -> str:
        if self.takes("builds_nonsense"):
            raise ValueError("no such variable")
        return "goal"

    def _judge_attempt(self, leaf: Leaf, attempts: Attempts, handle: shared.GoalHandle) -> None:
        goal = handle.goal
        outcome = goal.outcome
        assert outcome is not None
        if outcome is Outcome.SUCCEEDED and self.takes("unexpected"):
            outcome = Outcome.UNEXPECTED_RESULT
        record = AttemptRecord(attempts.attempt, outcome, goal.reason, 0.0, 0.0, None, goal)
        again = attempts.again(record, self.world.now, self._chance)
        self.judge.noted(leaf, self.seen[goal.id], record, again)
        leaf.handle = None
        if not again:
            leaf.attempts = None

    def interrupt(self, leaf: Leaf) -> None:
        """What py_trees' terminate(INVALID) does; twice, because it may come twice."""
        if leaf.handle is not None:
            leaf.handle.endpoint.tell(leaf.handle, Event.INTERRUPTED)
            self.judge.interrupted_again(self.seen[leaf.handle.goal.id])
        leaf.handle = leaf.attempts = None

    def run_again(self, node: int) -> None:
        """The run of one node ends, and another begins."""
        for leaf in self.leaves:
            if leaf.plan.node == node:
                self.interrupt(leaf)
        self._traffics[node].destroy()
        self._traffics[node] = self._traffic(node)
        for action in self.world.actions:
            self._endpoints.pop((action, node), None)

    def close(self) -> None:
        """The process ends."""
        self.closed = True
        for handle in self.handles:
            handle.endpoint.tell(handle.real, Event.PROCESS_EXITING)

    def _left_behind(self) -> list[GoalHandle]:
        """Goals that are still waited for, though no leaf has them any more."""
        held = {leaf.handle for leaf in self.leaves}
        return [
            handle
            for handle in self.handles
            if handle.real not in held
            and handle.goal.outcome is not None
            and (handle.goal.end is End.UNKNOWN or handle.goal.unconfirmed)
        ]

    # What arrives, and what time does

    def receive(self, message: Message) -> None:
        """Pass on an answer to who asked, and the rest to whoever sees the server."""
        if message.number:
            client = self._clients[message.number - 1]
            client.hear(message)
            if message.kind == "answer" and message.detail and not client.closed:
                self.judge.hears_acceptance(self.seen[message.goal_id], message.server)
            return
        for each in self._lines_to(message.server.action):
            if self.world.in_sight(message.server, each.traffic.node.number):
                if message.kind == "feedback":
                    each.feedback_came(message.goal_id, message.detail)
                elif message.kind == "status":
                    each.statuses_came({message.goal_id: message.detail})

    def attend(self) -> None:
        """What the alarm does, which is late where the process was frozen."""
        alarm.stalls.rests(self.moment())
        self._attend()
        if self.takes("freezes"):
            self._freeze((0.9, 2.5, 6.0)[self._moments % 3])

    def _attend(self) -> None:
        for each in list(alarm._open):
            assert isinstance(each, ActionEndpoint)
            each._look_at = 0.0
            each.attend(self.moment())
            for real in each.goals.values():
                handle = self.known(real.goal)
                if handle is not None and not self.froze:
                    self.judge.polled(handle)
        self.judge.nobody_waits_in_vain()

    def _freeze(self, seconds: float) -> None:
        """This process is stopped, and runs again; what it was sent comes in a moment later.

        So do servers that it sees, beyond their lease.
        """
        self.froze = True
        self._freezes += 1
        alarm.stalls.lives(self.moment())
        before = {
            handle: handle.goal.state
            for handle in self.handles
            if handle.goal.state in (State.WAITING_FOR_SERVER, State.SENDING, State.EXECUTING)
            and not (handle.ledger.crowded or self._falters(handle))
        }
        world, hidden = self.world, set[tuple[bytes, int]]()
        if seconds > LEASE:
            hidden = {(server.gid, node) for server in world.servers for node in NODES}
            hidden -= world.overlooked
        world.overlooked |= hidden
        world.now = Now(world.now.steady + seconds, world.now.ros + seconds * world.pace)
        self._attend()
        for handle, state in before.items():
            if handle.goal.state is not state and self._freezes <= IN_A_ROW:
                raise Violation(f"who was frozen looks first for what came meanwhile: {handle}")
        world.overlooked -= hidden
        for message in world._deliverable():
            if message in world.air:
                world.deliver(message)
        self.attend()

    def _falters(self, handle: GoalHandle) -> bool:
        """Whether its server is in sight without its services, which no stall does."""
        where = handle.endpoint.name, handle.node
        return bool(self.world.shown(*where)) and not self.world.ready(*where)

    def due_in(self) -> float:
        """Return the seconds until something is due (half a second where nothing is)."""
        handles = [handle for each in self.endpoints for handle in each.goals.values()]
        dues = [handle.goal.due_in(self.world.now) for handle in handles]
        return min((due for due in dues if due is not None), default=0.5)

    # For the judge

    @property
    def handles(self) -> list[GoalHandle]:
        return list(self.seen.values())

    @property
    def resources(self) -> Resources[shared.GoalHandle]:
        return shared.domain_of(DOMAIN).resources

    @property
    def endpoints(self) -> list[ActionEndpoint]:
        return [each for of_node in self._traffics.values() for each in of_node._endpoints.values()]

    def _lines_to(self, action: str) -> list[ActionEndpoint]:
        return [each for each in self.endpoints if each.name == action]

    def accepted_on_server(self, job: Job) -> None:
        """Not seen by any real caller: for the judge."""
        self.judge.accepted_on_server(job)

    def crowded(self, action: str, *, but_lost: bool = False) -> None:
        """Not seen either: there are two live servers under the name.

        Not an excuse for goals that are lost already, where one comes back.
        """
        for each in self._lines_to(action):
            for real in each.goals.values():
                handle = self.known(real.goal)
                if handle is not None:
                    handle.ledger.crowded |= not (but_lost and handle.goal.lost)

    def out_of_sight(self, lost: GoalHandle, wanted: GoalHandle) -> bool:
        """Whether nothing that the node of `wanted` sees shows the lost one's servers."""
        action, world = lost.endpoint.name, self.world
        return not any(
            lost.replies.sent_to & world.shown(action, wanted.node)
            and world.ready(action, wanted.node)
            for each in self._lines_to(action)
            if each.traffic.node.number == wanted.node
        )


def _drain(handles: Iterable[shared.GoalHandle], hurry: Any = None) -> None:
    """A drain whose patience is over at once."""
    wanted = [handle for handle in handles if handle.goal.state is not State.DONE]
    for handle in wanted:
        handle.endpoint.tell(handle, Event.INTERRUPTED)
    for handle in wanted:
        if not handle.accounted_for:
            handle.endpoint.tell(handle, Event.DRAINED)


@contextmanager
def installed() -> Iterator[None]:
    """Put the model world around the production code; the one lock is ours meanwhile."""
    made, retire = shared.GoalHandle.__post_init__, ActionEndpoint.retire
    on, poll = Goal.on, Goal.poll

    def post_init(handle: shared.GoalHandle) -> None:
        made(handle)
        now().begun(handle)

    def told(goal: Goal, event: Event, moment: Any, detail: Any = None) -> Any:
        return now().told(goal, event, detail, lambda: on(goal, event, moment, detail))

    def polled(goal: Goal, moment: Now) -> tuple[Command, ...]:
        handle = now().known(goal)
        if handle is not None:
            now().judge.sees_clock(handle)
        return poll(goal, moment)

    def park(of_ticket: ActionEndpoint, handle: shared.GoalHandle) -> None:
        retire(of_ticket, handle)
        now().park(handle.goal)

    def fail(of_what: ActionEndpoint, what: str, error: Exception) -> None:
        raise error

    def appears() -> None:
        alarm.stalls.lives(now().moment())
        alarm.stalls.rests(now().moment())

    patches: list[tuple[Any, str, Any]] = [
        (endpoint, "time", ModelTime),
        (past, "time", ModelTime),
        (route, "time", ModelTime),
        (traffic, "time", ModelTime),
        (endpoint, "ActionClient", ModelClient),
        (route, "ActionClient", ModelClient),
        (route, "servers", lambda node, name: now().world.shown(name, node.number)),
        (endpoint, "is_valid", lambda node: True),
        (route, "is_valid", lambda node: True),
        (traffic, "is_valid", lambda node: True),
        (route, "_remapped", lambda node, name: True),  # nothing is looked for out of sight
        (ActionEndpoint, "_instead", lambda self, handle: ""),
        (ActionEndpoint, "retire", park),
        (ActionEndpoint, "_warn_once", fail),
        (
            ActionEndpoint,
            "__hash__",
            lambda self: self.traffic.node.number,
        ),  # sets are in the same order
        (endpoint, "log", Silence()),
        (route, "log", Silence()),
        (traffic, "log", Silence()),
        (traffic, "new_goal_id", lambda: now().new_goal_id()),
        (traffic, "drain", _drain),
        (alarm, "stalls", Stalls()),
        (alarm, "_open", set()),
        (alarm, "mind", lambda each: alarm._open.add(each)),
        (alarm, "appears", appears),
        (endpoint, "ledger", NoLedger()),
        (shared, "_domains", {}),
        (shared.GoalHandle, "__post_init__", post_init),
        (Goal, "on", told),
        (Goal, "poll", polled),
    ]
    with shared.lock:
        replaced = [(where, name, getattr(where, name)) for where, name, _ in patches]
        for where, name, instead in patches:
            setattr(where, name, instead)
        try:
            yield
        finally:
            for where, name, before in replaced:
                setattr(where, name, before)
            _playing.clear()
