"""The production ros/line.py and ros/traffic.py in a model world, with the rules of the judge.

A model is what lies around them: the client, the node, the graph, the clocks and the alarm's
thread. Of the two files themselves nothing is copied.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any
from unittest import mock

from bt_actions.attempts import AttemptRecord, Attempts
from bt_actions.goal import Goal
from bt_actions.goal_terms import Event, Now, State
from bt_actions.hearing import Hearing
from bt_actions.policy import End, Outcome
from bt_actions.ros import alarm, line, past, shared, traffic, way
from bt_actions.ros.action_client import GOALS_KEPT
from bt_actions.ros.line import Line
from bt_actions.ros.shared import Ticket
from bt_actions.ros.traffic import Traffic
from bt_actions.standstill import Standstill
from tests.machine.histories import ACTIONS, Play, plan
from tests.machine.judge import Judge, Violation
from tests.machine.parts import LeafPlan, Ledger
from tests.machine.world import NODES, Message, World

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
        self.closed = False
        self.hearing = Hearing()
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
            self.hearing.asked(caller.moment())
        view = caller.seen.get(goal_id)
        nobody = caller.world.servers[0]
        message = Message(
            kind, nobody, goal_id, view.name if view else "", number=number, to_server=True
        )
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
        self.hearing.answered(asked)
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


class Node:
    """What Line and Traffic ask of a node."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.context = mock.Mock()
        self.context.get_domain_id = lambda: DOMAIN

    def get_clock(self) -> Any:
        return SimpleNamespace(ros_time_is_active=False)

    def get_namespace(self) -> str:
        return "/"

    def get_name(self) -> str:
        return "node"


class LineView:
    """A production line, as the judge sees one (parts.Line)."""

    def __init__(self, real: Line) -> None:
        self.real = real
        self.action, self.node = real.name, real.traffic.node.number
        self.watch = real.watch

    @property
    def tickets(self) -> dict[bytes, TicketView]:
        return {goal: now().view(ticket) for goal, ticket in self.real.goals.items()}


class TicketView:
    """A production ticket, as the judge sees one (parts.Ticket)."""

    def __init__(self, real: Ticket, name: str, *, twin: bool) -> None:
        self.real, self.goal, self.name, self.twin = real, real.goal, name, twin
        self.ledger = Ledger(0.0, 0.0)

    def __repr__(self) -> str:
        return self.name

    @property
    def line(self) -> LineView:
        return LineView(self.real.line)

    @property
    def testimony(self) -> Any:
        return self.real.testimony


class Leaf:
    """One leaf of a tree: visited, ticked, interrupted, visited again."""

    def __init__(self, name: str, leaf_plan: LeafPlan) -> None:
        self.name, self.plan = name, leaf_plan
        self.attempts: Attempts | None = None
        self.ticket: Ticket | None = None
        self.visits = 0

    def __repr__(self) -> str:
        return self.name


class Caller:
    """Leaves, and beneath them the production traffic of two nodes."""

    def __init__(self, world: World, plans: Iterable[LeafPlan], judge: Judge) -> None:
        self.world, self.judge = world, judge
        self.leaves = [Leaf(f"leaf{number}", each) for number, each in enumerate(plans)]
        self.seen: dict[bytes, TicketView] = {}
        self.closed = False
        self.misfortunes: set[str] = set()
        self._by_goal: dict[Goal, TicketView] = {}
        self._clients: list[ModelClient] = []
        self._moments = 0
        self._next_name = ""
        self._chance = random.Random(0)
        _playing[:] = [self]
        shared._domains.clear()
        alarm._open.clear()
        alarm.standstill = Standstill()
        self._traffics = {number: self._traffic(number) for number in NODES}
        self._lines: dict[tuple[str, int], Line] = {}  # made when a leaf first wants them
        world.client = self  # type: ignore[assignment]
        judge.caller = self  # type: ignore[assignment]
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
                    lambda view: view.real.line.tell(view.real, Event.DRAINED),
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
        made = Traffic(Node(number))  # type: ignore[arg-type]
        made.clocks = SimpleNamespace(now=lambda: self.world.now)  # type: ignore[assignment]
        return made

    def come(self, action: str, node: int) -> Line:
        """Return the line of a node to an action, made when it is first wanted."""
        found = self._lines.get((action, node))
        if found is None:
            of_node = self._traffics[node]
            found = of_node._lines.get(action)
            if found is None:
                found = of_node._lines[action] = Line(of_node, "type", action)
            found.users += 1
            self._lines[action, node] = found
        return found

    def new_goal_id(self) -> bytes:
        return b"%d" % len(self.seen)

    def begun(self, ticket: Ticket) -> None:
        """Take note of a ticket that is made, but for a twin's."""
        if ticket.goal.state is State.QUEUED and ticket.goal not in self._by_goal:
            view = TicketView(ticket, self._next_name, twin=False)
            self.seen[ticket.goal.id] = self._by_goal[ticket.goal] = view
            self.judge.begins(view)  # type: ignore[arg-type]

    def view(self, ticket: Ticket) -> TicketView:
        """Return how the judge sees a ticket, a twin's included."""
        found = self._by_goal.get(ticket.goal)
        if found is None:
            found = self._by_goal[ticket.goal] = TicketView(ticket, "twin", twin=True)
        return found

    def told(self, goal: Goal, event: Event, detail: Any, step: Callable[[], Any]) -> Any:
        """Have the judge see what a goal is told, and what it says."""
        view = self._by_goal.get(goal)
        if view is None or view.twin:
            return step()
        before = self.judge.before(view)  # type: ignore[arg-type]
        commands = step()
        if event is Event.LEFT:  # the machine's own caller never leaves a goal
            view.ledger.releases += sum(each.name == "RELEASE" for each in commands)
            view.ledger.since = self.world.now.steady
        else:
            shown = None if event.name.endswith("_DUE") else event
            self.judge.after(view, before, shown, detail, commands)  # type: ignore[arg-type]
        return commands

    def put_away(self, ticket: Ticket) -> None:
        """Have the judge see that a goal is DONE, and its line has put it away."""
        if ticket.goal.state is not State.DONE:
            return
        view = self.view(ticket)
        if view.twin:
            self.judge.twin_is_done(view)  # type: ignore[arg-type]
        else:
            event = Event.CLOSED if view.ledger.closed else None
            self.judge.is_done(view, event)  # type: ignore[arg-type]

    # The leaves

    def tick(self, leaf: Leaf) -> None:
        """Visit an idle leaf, or let a running one take note and go on."""
        of_node = self._traffics[leaf.plan.node]
        to_action = self.come(leaf.plan.action, leaf.plan.node)
        if leaf.ticket is not None and leaf.attempts is not None:
            to_action.look(self.moment())
            leaf.ticket.line.poll(leaf.ticket)
            goal = leaf.ticket.goal
            if goal.outcome is not None:
                self._judge_attempt(leaf, leaf.attempts, leaf.ticket)
                return
        if leaf.attempts is None:
            leaf.attempts = Attempts(leaf.plan.retry, None, self._chance)
            leaf.visits += 1
        if leaf.ticket is None:
            if leaf.attempts.pause_left(self.world.now) > 0.0:
                return
            self._next_name = f"{leaf.name}.{leaf.visits}.{leaf.attempts.attempt}"
            wants = leaf.plan.timeouts, leaf.plan.resources, leaf.plan.busy
            leaf.ticket = of_node.begin(to_action, leaf, *wants)
        of_node.advance(leaf.ticket, self._message)

    def _message(self) -> str:
        if self.takes("builds_nonsense"):
            raise ValueError("no such variable")
        return "goal"

    def _judge_attempt(self, leaf: Leaf, attempts: Attempts, ticket: Ticket) -> None:
        goal = ticket.goal
        outcome = goal.outcome
        assert outcome is not None
        if outcome is Outcome.SUCCEEDED and self.takes("unexpected"):
            outcome = Outcome.UNEXPECTED_RESULT
        record = AttemptRecord(attempts.attempt, outcome, goal.reason, 0.0, 0.0, None, goal)
        again = attempts.again(record, self.world.now)
        self.judge.noted(leaf, self.view(ticket), record, again)  # type: ignore[arg-type]
        leaf.ticket = None
        if not again:
            leaf.attempts = None

    def interrupt(self, leaf: Leaf) -> None:
        """What py_trees' terminate(INVALID) does."""
        if leaf.ticket is not None:
            leaf.ticket.line.tell(leaf.ticket, Event.INTERRUPTED)
        leaf.ticket = leaf.attempts = None

    def run_again(self, node: int) -> None:
        """The run of one node ends, and another begins."""
        for leaf in self.leaves:
            if leaf.plan.node == node:
                self.interrupt(leaf)
        self._traffics[node].destroy()
        self._traffics[node] = self._traffic(node)
        for action in self.world.actions:
            self._lines.pop((action, node), None)

    def close(self) -> None:
        """The process ends."""
        self.closed = True
        for view in self.tickets:
            view.real.line.tell(view.real, Event.CLOSED)

    def _left_behind(self) -> list[TicketView]:
        held = {leaf.ticket for leaf in self.leaves}
        return [
            view
            for view in self.tickets
            if view.real not in held
            and view.goal.outcome is not None
            and (view.goal.end is End.UNKNOWN or view.goal.suspect)
        ]

    # What arrives, and what time does

    def receive(self, message: Message) -> None:
        """Pass on an answer to who asked, and the rest to whoever sees the server."""
        if message.number:
            client = self._clients[message.number - 1]
            client.hear(message)
            view = self.seen.get(message.goal_id)
            if message.kind == "answer" and message.detail and view and not client.closed:
                self.judge.hears_acceptance(view, message.server)  # type: ignore[arg-type]
            return
        for of_node in list(self._traffics.values()):
            for each in list(of_node._lines.values()):
                in_sight = self.world.in_sight(message.server, of_node.node.number)  # type: ignore[attr-defined]
                if each.name == message.server.action and in_sight:
                    if message.kind == "feedback":
                        each.feedback_came(message.goal_id, message.detail)
                    elif message.kind == "status":
                        each.statuses_came({message.goal_id: message.detail})

    def attend(self) -> None:
        """What the alarm does, which is late where the process was frozen."""
        alarm.standstill.rests()
        self._attend()
        if self.takes("freezes"):
            self._freeze((0.9, 2.5, 6.0)[self._moments % 3])

    def _attend(self) -> None:
        for each in list(alarm._open):
            assert isinstance(each, Line)
            each._look_at = 0.0
            each.attend(self.moment())
        self.judge.nobody_waits_in_vain()

    def _freeze(self, seconds: float) -> None:
        """This process is stopped, and runs again; what it was sent comes in a moment later.

        So do servers that it sees, beyond their lease.
        """
        alarm.standstill.lives(self.moment())
        world, hidden = self.world, set[tuple[bytes, int]]()
        if seconds > LEASE:
            hidden = {(server.gid, node) for server in world.servers for node in NODES}
            hidden -= world.overlooked
        world.overlooked |= hidden
        world.now = Now(world.now.steady + seconds, world.now.ros + seconds * world.pace)
        before = {
            view: view.goal.state
            for view in self.tickets
            if not view.ledger.crowded
            and view.goal.state in (State.WAITING_FOR_SERVER, State.SENDING, State.EXECUTING)
        }
        self._attend()
        for view, state in before.items():
            if view.goal.state is not state:
                raise Violation(f"who was frozen looks first for what came meanwhile: {view}")
        world.overlooked -= hidden
        for message in world._deliverable():
            if message in world.air:
                world.deliver(message)
        self.attend()

    def due_in(self) -> float:
        """Return the seconds until something is due (half a second where nothing is)."""
        tickets = [
            ticket
            for of_node in self._traffics.values()
            for each in of_node._lines.values()
            for ticket in each.goals.values()
        ]
        dues = [ticket.goal.due_in(self.world.now) for ticket in tickets]
        return min((due for due in dues if due is not None), default=0.5)

    # For the judge

    @property
    def tickets(self) -> list[TicketView]:
        return list(self.seen.values())

    @property
    def resources(self) -> Any:
        return shared.domain_of(DOMAIN).resources

    @property
    def lines(self) -> dict[tuple[str, int], LineView]:
        return {
            (name, number): LineView(each)
            for number, of_node in self._traffics.items()
            for name, each in of_node._lines.items()
        }

    def accepted_on_server(self, job: Any) -> None:
        self.judge.accepted_on_server(job)

    def crowded(self, action: str, *, but_lost: bool = False) -> None:
        for each in self.lines.values():
            for view in each.tickets.values() if each.action == action else ():
                view.ledger.crowded |= not (but_lost and view.goal.lost)

    def out_of_sight(self, lost: TicketView, wanted: TicketView) -> bool:
        """Whether nothing that the node of `wanted` sees shows the lost one's servers."""
        action, world = lost.line.action, self.world
        return not any(
            lost.testimony.sent_to & world.shown(action, each.node)
            and world.ready(action, each.node)
            for each in self.lines.values()
            if each.action == action and each.node == wanted.line.node
        )


class ProductionJudge(Judge):
    """The judge, who here sees views, and goals that were left."""

    def _ticket(self, job: Any) -> Any:
        return self.caller.seen[job.goal_id]  # type: ignore[attr-defined]

    def _deadlines_are_kept_in_mind(self, ticket: Any) -> None:
        if not ticket.goal.lost:  # one that was left waits for nothing, also where it is UNKNOWN
            super()._deadlines_are_kept_in_mind(ticket)


class ProductionPlay(Play):
    """A play whose caller is the production code; only within `installed`."""

    def __init__(self, plans: Iterable[int], *, aloud: bool = False) -> None:
        self.world, self.judge = World(ACTIONS), ProductionJudge()
        numbers = list(plans)
        self.world.preempts = sum(numbers) % 2 == 0
        leaf_plans = [plan(number) for number in numbers]
        self.caller = Caller(self.world, leaf_plans, self.judge)  # type: ignore[assignment]
        self.told: list[str] | None = [] if aloud else None
        self._last: dict[str, str] = {}
        for leaf in self.caller.leaves:
            self.say(leaf, leaf.plan)
        for action in ACTIONS:
            self.world.start(action)

    def settle(self, *, heals: bool, drains: bool) -> None:
        """As ever; each node comes to each action, for what was left there is only remembered."""
        for action in ACTIONS:
            for node in NODES:
                self.caller.come(action, node)  # type: ignore[attr-defined]
        super().settle(heals=heals, drains=drains)


def _drain(tickets: Iterable[Ticket], hurry: Any = None) -> None:
    """A drain whose patience is over at once."""
    wanted = [ticket for ticket in tickets if ticket.goal.state is not State.DONE]
    for ticket in wanted:
        ticket.line.tell(ticket, Event.INTERRUPTED)
    for ticket in wanted:
        if not ticket.accounted_for:
            ticket.line.tell(ticket, Event.DRAINED)


@contextmanager
def installed() -> Iterator[None]:
    """Put the model world around the production code; the one lock is ours meanwhile."""
    made, on, close_book = Ticket.__post_init__, Goal.on, Line.close_book

    def post_init(ticket: Ticket) -> None:
        made(ticket)
        now().begun(ticket)

    def told(goal: Goal, event: Event, moment: Any, detail: Any = None) -> Any:
        return now().told(goal, event, detail, lambda: on(goal, event, moment, detail))

    def put_away(of_ticket: Line, ticket: Ticket) -> None:
        close_book(of_ticket, ticket)
        now().put_away(ticket)

    patches: list[tuple[Any, str, Any]] = [
        (line, "time", ModelTime),
        (past, "time", ModelTime),
        (way, "time", ModelTime),
        (traffic, "time", ModelTime),
        (line, "ActionClient", ModelClient),
        (way, "ActionClient", ModelClient),
        (way, "servers", lambda node, name: now().world.shown(name, node.number)),
        (line, "is_valid", lambda node: True),
        (way, "is_valid", lambda node: True),
        (traffic, "is_valid", lambda node: True),
        (way, "_remapped", lambda node, name: True),  # nothing is looked for out of sight
        (Line, "_instead", lambda self, ticket: ""),
        (Line, "close_book", put_away),
        (line, "log", mock.Mock()),
        (way, "log", mock.Mock()),
        (traffic, "log", mock.Mock()),
        (traffic, "new_goal_id", lambda: now().new_goal_id()),
        (traffic, "drain", _drain),
        (alarm, "standstill", Standstill()),
        (alarm, "_open", set()),
        (alarm, "mind", lambda each: alarm._open.add(each)),
        (shared, "_domains", {}),
        (Ticket, "__post_init__", post_init),
        (Goal, "on", told),
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
