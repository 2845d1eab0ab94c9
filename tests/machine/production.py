"""Leaves, and the production traffic beneath them, in a model world.

A model is what lies around it, as traffic/transport.py and traffic/state.py have it: transports,
participants and the host. Of traffic/ itself nothing is copied, and nothing replaced. Each step of
a goal is shown to the judge, by the host's trace.
"""

from __future__ import annotations

import contextlib
import random
from collections.abc import Iterable
from typing import Any

from bt_actions.goals.attempts import AttemptRecord, Attempts
from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End, Outcome
from bt_actions.goals.resources import Resources
from bt_actions.goals.terms import Command, Event, Now, State
from bt_actions.servers.reachability import Reachability
from bt_actions.servers.stalls import IN_A_ROW, Stalls
from bt_actions.traffic import state as traffic
from bt_actions.traffic import watcher
from bt_actions.traffic.driver import apply_deadlines, tell
from bt_actions.traffic.endpoint import ActionEndpoint
from bt_actions.traffic.scheduler import Scheduler
from bt_actions.traffic.state import Domain, Record, Trace
from bt_actions.traffic.traffic import Traffic
from bt_actions.traffic.transport import GOALS_KEPT, Listener
from tests.machine.judge import Judge, Violation
from tests.machine.parts import Before, GoalHandle, Leaf, LeafPlan
from tests.machine.world import NODES, Job, Message, World

DOMAIN = 1
LEASE = 3.0
"""Seconds without a look after which a process has dropped the servers that it saw."""


class ModelTransport:
    """One action as one node sees it, whose messages go through the model world."""

    seen_since = float("-inf")  # it has discovered who is there
    has_more = beside_another = False

    def __init__(self, caller: Caller, node: int, name: str, listener: Listener) -> None:
        self._caller, self._node, self._name, self._listener = caller, node, name, listener
        self.closed = False
        self.reachability = Reachability()
        self._asked: dict[int, tuple[Any, Any, float, dict[bytes, Any]]] = {}
        self._past: dict[int, tuple[Any, Any, float, dict[bytes, Any]]] = {}

    def ready(self) -> bool:
        return self._caller.world.ready(self._name, self._node)

    def servers(self) -> frozenset[bytes]:
        self._caller.looks += 1
        return self._caller.world.shown(self._name, self._node)

    def count(self) -> int:
        return len(self._caller.world.shown(self._name, self._node))

    def send(self, goal_id: bytes, goal: Any) -> None:
        caller = self._caller
        if caller.takes("fails_to_send"):
            raise RuntimeError("no space left")
        if caller.takes("restarts_meanwhile"):
            caller.world.restart(self._name)
        for newcomer in ("opens_meanwhile", "another_opens_meanwhile"):
            if caller.takes(newcomer):
                caller.world.start(self._name)
        caller.judge.sent(caller.seen[goal_id], self._ask("goal", goal_id))

    def cancel(self, goal_id: bytes) -> None:
        self._ask("cancel", goal_id)

    def ask_result(self, goal_id: bytes) -> None:
        self._ask("result" if goal_id in self._caller.seen else "probe", goal_id)

    def _ask(self, kind: str, goal_id: bytes) -> int:
        if self.closed:
            raise RuntimeError("the transport is closed")
        caller = self._caller
        number = caller.file(self)
        self._asked[number] = (kind, goal_id, caller.moment(), {})
        if kind not in ("result", "probe"):
            self.reachability.asked(caller.moment())
        handle = caller.seen.get(goal_id)
        name = "" if handle is None else handle.name
        nobody = caller.world.servers[0]
        message = Message(kind, nobody, goal_id, name, number=number, to_server=True)
        return caller.world.send(message, self._name, self._node)

    def forget(self, goal: Any) -> None:
        for number, question in list(self._asked.items()):
            if question[1] == goal:
                del self._asked[number]
                if question[0] == "goal":
                    self._past[number] = question
        while len(self._past) > GOALS_KEPT:
            del self._past[next(iter(self._past))]

    def deliver_arrived(self) -> None:
        """Nothing: what has arrived was delivered."""

    def close(self) -> None:
        self.closed = True

    def hear(self, message: Message) -> None:
        """Take an answer; one that comes twice is the same answer."""
        question = self._asked.get(message.number) or self._past.get(message.number)
        if self.closed or question is None:
            return
        kind, about, asked, by_server = question
        self.reachability.answer_came(asked)
        if kind == "probe":
            self._listener.answer_came("result", about, asked, ((0, None),))
            return
        if message.server.gid in by_server:
            return
        by_server[message.server.gid] = message.detail
        answers = tuple(by_server.values())
        if kind == "result":
            answers = tuple((status, None) for status in answers)
        self._listener.answer_came(kind, about, asked, answers)


class ModelParticipant:
    """A node of the model world."""

    domain, namespace = DOMAIN, "/"

    def __init__(self, caller: Caller, number: int) -> None:
        self._caller = caller
        self.name = str(number)
        self.seen_since = caller.moment()
        self.long_stalls = caller.host.stalls.long_times

    def now(self) -> Now:
        return self._caller.world.now

    def alive(self) -> bool:
        return True

    def shut_down(self) -> bool:
        return False

    def full_name(self, action: str) -> str:
        return action

    def open_transport(self, action_type: Any, name: str, listener: Listener) -> ModelTransport:
        return ModelTransport(self._caller, int(self.name), name, listener)

    def instead(self, action_type: Any, name: str) -> str:
        return ""

    def unheard(self) -> str:
        return ""

    def seek(self, endpoint: Any) -> None:
        """There is nothing that is out of sight for good."""


class ModelLog:
    """The log, to which nobody listens; what production calls a mistake of its own is one."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller

    def info(self, text: str) -> None: ...

    warning = info

    def error(self, text: str) -> None:
        if "not accounted for" not in text:
            self._caller.judge.found(text)


class Witness(Trace):
    """Has the judge see what goals are told, and what they say; not those of a duplicate."""

    def __init__(self, caller: Caller) -> None:
        self._caller, self._judge = caller, caller.judge
        self._before: Before | None = None

    def shows_time(self, handle: traffic.GoalHandle) -> None:
        if known := self._caller.known(handle.goal):
            self._caller.judge.sees_clock(known)

    def tells(self, handle: traffic.GoalHandle, event: Event) -> None:
        self._caller.begun(handle)
        self._caller.steps.add((handle.goal.state, event))
        known = self._caller.known(handle.goal)
        self._before = None if known is None else self._caller.judge.before(known)

    def told(
        self,
        handle: traffic.GoalHandle,
        event: Event,
        detail: Any,
        commands: tuple[Command, ...],
    ) -> None:
        known = self._caller.known(handle.goal)
        if known is not None and self._before is not None:
            shown = None if event.name.endswith("_DUE") else event
            self._caller.judge.after(known, self._before, shown, detail, commands)
            if handle.goal.state is State.DONE and self._before.state is not State.DONE:
                self._caller.judge.is_done(known)


class ModelHost:
    """A process, whose time is the model world's."""

    forks, closing = 0, False

    def __init__(self, caller: Caller) -> None:
        self.caller = caller
        self.lock = contextlib.nullcontext()
        self.log, self.record, self.trace = ModelLog(caller), Record(), Witness(caller)
        self.stalls = Stalls()
        self.scheduler = Scheduler(self.steady, self.stalls, lambda: None, lambda *_: None)
        self._domain = Domain()

    def domain(self, number: int) -> Domain:
        return self._domain

    def steady(self) -> float:
        return self.caller.moment()

    def new_goal_id(self) -> bytes:
        return b"%d" % len(self.caller.seen)

    def notify_all(self) -> None: ...

    def wait(self, timeout: float) -> bool:
        """Nobody else is there to change anything meanwhile."""
        self.caller.passes(timeout)
        return False


class Caller:
    """Leaves, and beneath them the production traffic of two nodes."""

    def __init__(self, world: World, plans: Iterable[LeafPlan], judge: Judge) -> None:
        self.world, self.judge = world, judge
        self.leaves = [Leaf(f"leaf{number}", each) for number, each in enumerate(plans)]
        self.seen: dict[bytes, GoalHandle] = {}
        """Every goal that was ever begun, the oldest first."""
        self.steps: set[tuple[State, Event]] = set()
        """What any goal was told, and in which state it was."""
        self.closed = False
        self.froze = False
        self._freezes = 0
        self.misfortunes: set[str] = set()
        self._transports: list[ModelTransport] = []
        self._moments, self._passed = 0, 0.0
        self.looks = 0
        """How often the graph was asked who serves an action."""
        self._next_name = ""
        self._chance = random.Random(0)
        self.host = ModelHost(self)
        self._traffics = {number: self._traffic(number) for number in NODES}
        self._endpoints: dict[
            tuple[str, int], traffic.Endpoint
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
                    lambda handle: tell(handle.real, Event.DRAIN_GAVE_UP),
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
        return self.world.now.steady + self._passed + self._moments * 1e-9

    def passes(self, seconds: float) -> None:
        """Time goes by for this process alone."""
        self._passed += seconds

    def file(self, transport: ModelTransport) -> int:
        """Return the number of a transport's next question."""
        self._transports.append(transport)
        return len(self._transports)

    # What is beneath the leaves

    def _traffic(self, number: int) -> Traffic:
        return Traffic(self.host, ModelParticipant(self, number))

    def come(self, action: str, node: int) -> traffic.Endpoint:
        """Return the line of a node to an action, made when it is first wanted."""
        found = self._endpoints.get((action, node))
        if found is None:
            found = self._endpoints[action, node] = self._traffics[node].endpoint("type", action)
        return found

    def begun(self, real: traffic.GoalHandle) -> None:
        """Take note of a goal, when it is first told something, or queues."""
        if real.goal.id in self.seen:
            return
        handle = self.seen[real.goal.id] = GoalHandle(real, self._next_name)
        self.judge.begins(handle)

    def known(self, goal: Goal) -> GoalHandle | None:
        """Return what the judge knows of a goal: nothing where that is a duplicate."""
        handle = self.seen.get(goal.id)
        return handle if handle is not None and handle.goal is goal else None

    # The leaves

    def tick(self, leaf: Leaf) -> None:
        """Visit an idle leaf, or let a running one take note and go on."""
        of_node = self._traffics[leaf.plan.node]
        to_action = self.come(leaf.plan.action, leaf.plan.node)
        if leaf.handle is not None and leaf.attempts is not None:
            watcher.look(to_action, self.moment())
            apply_deadlines(leaf.handle)
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
            self.begun(leaf.handle)
        of_node.advance(leaf.handle, self._message)

    def _message(self) -> str:
        if self.takes("builds_nonsense"):
            raise ValueError("no such variable")
        return "goal"

    def _judge_attempt(self, leaf: Leaf, attempts: Attempts, handle: traffic.GoalHandle) -> None:
        goal = handle.goal
        outcome = goal.outcome
        assert outcome is not None
        if outcome is Outcome.SUCCEEDED and self.takes("unexpected"):
            outcome = Outcome.UNEXPECTED_RESULT
        ended = self.world.now.ros
        record = AttemptRecord(attempts.attempt, outcome, goal.reason, 0.0, ended, None, goal)
        again = attempts.again(record, self._chance)
        self.judge.noted(leaf, self.seen[goal.id], record, again)
        leaf.handle = None
        if not again:
            leaf.attempts = None

    def interrupt(self, leaf: Leaf) -> None:
        """What py_trees' terminate(INVALID) does; twice, because it may come twice."""
        if leaf.handle is not None:
            tell(leaf.handle, Event.INTERRUPTED)
            self.judge.interrupted_again(self.seen[leaf.handle.goal.id])
        leaf.handle = leaf.attempts = None

    def run_again(self, node: int) -> None:
        """The run of one node ends, and another begins."""
        for leaf in self.leaves:
            if leaf.plan.node == node:
                self.interrupt(leaf)
        self._traffics[node].destroy(lambda: True)
        self._traffics[node] = self._traffic(node)
        for action in self.world.actions:
            self._endpoints.pop((action, node), None)

    def close(self) -> None:
        """The process ends."""
        self.closed = True
        for handle in self.handles:
            tell(handle.real, Event.PARKED)
            tell(handle.real, Event.ABANDONED)

    def _left_behind(self) -> list[GoalHandle]:
        """Goals that are still waited for, though no leaf has them any more."""
        held = {leaf.handle for leaf in self.leaves}
        return [
            handle
            for handle in self.handles
            if handle.real not in held
            and handle.goal.outcome is not None
            and (handle.goal.end is End.UNKNOWN or handle.goal.may_still_be_accepted)
        ]

    # What arrives, and what time does

    def receive(self, message: Message) -> None:
        """Pass on an answer to who asked, and the rest to whoever sees the server."""
        if message.number:
            transport = self._transports[message.number - 1]
            transport.hear(message)
            if message.kind == "answer" and message.detail and not transport.closed:
                self.judge.hears_acceptance(self.seen[message.goal_id], message.server)
            return
        for each in self._endpoints_to(message.server.action):
            if self.world.in_sight(message.server, int(each.participant.name)):
                if message.kind == "feedback":
                    each.feedback_came(message.goal_id, message.detail)
                elif message.kind == "status":
                    each.statuses_came({message.goal_id: message.detail})

    def attend(self) -> None:
        """What the alarm does, which is late where the process was frozen."""
        self.host.stalls.rests(self.moment())
        self._run_due()
        if self.takes("freezes"):
            self._freeze((0.9, 2.5, 6.0)[self._moments % 3])

    def _run_due(self) -> None:
        for each in self.host.scheduler.scheduled:
            assert isinstance(each, ActionEndpoint)
            each.look_soon()  # a look is due
            each.run_due(self.moment())
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
        self.host.stalls.lives(self.moment())
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
        self._run_due()
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
    def resources(self) -> Resources[traffic.GoalHandle]:
        return self.host.domain(DOMAIN).resources

    @property
    def endpoints(self) -> list[traffic.Endpoint]:
        return [each for of_node in self._traffics.values() for each in of_node._endpoints.values()]

    def _endpoints_to(self, action: str) -> list[traffic.Endpoint]:
        return [each for each in self.endpoints if each.name == action]

    def accepted_on_server(self, job: Job) -> None:
        """Not seen by any real caller: for the judge."""
        self.judge.accepted_on_server(job)

    def crowded(self, action: str, *, but_lost: bool = False) -> None:
        """Not seen either: there are two live servers under the name.

        Not an excuse for goals that are lost already, where one comes back.
        """
        for each in self._endpoints_to(action):
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
            for each in self._endpoints_to(action)
            if int(each.participant.name) == wanted.node
        )
