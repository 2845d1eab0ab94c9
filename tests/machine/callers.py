"""Leaves and traffic as ros/traffic.py drives them, in a model world.

It carries out what goals and resources decide. It reports each step to a judge, and decides
nothing that traffic does not.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from bt_actions.attempts import AttemptRecord, Attempts
from bt_actions.goal import Goal
from bt_actions.goal_terms import ENDS, STATUS_SUCCEEDED, Command, Event, State
from bt_actions.policy import Busy, End, Outcome, Retry, Timeouts
from bt_actions.resources import Answer, Resources
from bt_actions.server import Server, ServerWatch
from tests.machine.judge import Before, Judge, Ledger
from tests.machine.world import Job, Message, World


@dataclass(eq=False, slots=True)
class Ticket:
    """A goal on its way, with what the caller and the judge keep of it."""

    goal: Goal
    name: str
    line: Line
    sent_to: frozenset[bytes] = frozenset()
    was_gone: bool = False
    asked_at: float = float("-inf")
    denied_at: float | None = None
    ledger: Ledger = field(init=False)

    def __repr__(self) -> str:
        return self.name


@dataclass(eq=False, slots=True)
class Line:
    """One action: its watch, and the goals on it."""

    action: str
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

    def __repr__(self) -> str:
        limits = ", ".join(f"{f} {getattr(self.timeouts, f)}" for f in Timeouts.__slots__)
        named = "everything" if Outcome.SERVER_LOST in self.retry.outcomes else "the default"
        tries = f"{self.retry.attempts} tries, on {named}"
        return f"{self.action}, {self.busy.value}, {set(self.resources)}; {limits}; {tries}"


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


class Caller:
    """The leaves, and the traffic beneath them."""

    def __init__(self, world: World, plans: Sequence[LeafPlan], judge: Judge) -> None:
        self.world = world
        self.judge = judge
        self.resources: Resources[Ticket] = Resources()
        self.lines = {action: Line(action) for action in world.actions}
        self.leaves = [Leaf(f"leaf{i}", p, self.lines[p.action]) for i, p in enumerate(plans)]
        self.tickets: list[Ticket] = []
        self.closed = False
        self.fails_to_send = False
        self.restarts_meanwhile = False
        self.builds_nonsense = False
        self.unexpected = False
        self._requests: dict[int, Ticket | None] = {}
        self._chance = random.Random(0)
        world.client = self
        judge.caller = self
        world.kinds.update(
            {
                "tick": (lambda: () if self.closed else self.leaves, self.tick),
                "interrupt": (self._wanted, self.interrupt),
                "misfortune": (
                    lambda: (
                        "fails_to_send",
                        "builds_nonsense",
                        "unexpected",
                        "restarts_meanwhile",
                    ),
                    lambda what: setattr(self, what, True),
                ),
                "look": (lambda: (None,), lambda _: self.attend()),
                "drained": (self._left_behind, lambda ticket: self.tell(ticket, Event.DRAINED)),
                "rerun": (lambda: () if self.closed else (None,), lambda _: self.run_again()),
            }
        )

    # The leaves

    def tick(self, leaf: Leaf) -> None:
        """Visit an idle leaf, or let a running one take note and go on. Never waits."""
        now = self.world.now
        if leaf.ticket is not None and leaf.attempts is not None:
            self.look(leaf.line)
            self.poll(leaf.ticket)
            goal = leaf.ticket.goal
            if goal.outcome is not None:
                outcome = goal.outcome
                if outcome is Outcome.SUCCEEDED and self.unexpected:
                    outcome, self.unexpected = Outcome.UNEXPECTED_RESULT, False
                record = AttemptRecord(
                    leaf.attempts.attempt, outcome, goal.reason, 0.0, 0.0, None, goal
                )
                again = leaf.attempts.again(record, now)
                self.judge.noted(leaf, leaf.ticket, record, again)
                leaf.ticket = None
                if not again:
                    leaf.attempts = None
                return
        if leaf.attempts is None:
            leaf.attempts = Attempts(leaf.plan.retry, None, self._chance)
            leaf.visits += 1
        if leaf.ticket is None:
            if leaf.attempts.pause_left(now) > 0.0:
                return
            leaf.ticket = self.begin(leaf)
        self.advance(leaf.ticket)

    def _wanted(self) -> Sequence[Leaf]:
        return [leaf for leaf in self.leaves if leaf.attempts is not None]

    def _left_behind(self) -> Sequence[Ticket]:
        """Goals that are still waited for, though no leaf has them any more."""
        held = {leaf.ticket for leaf in self.leaves}
        return [t for t in self.tickets if t not in held and self._waits(t.goal)]

    @staticmethod
    def _waits(goal: Goal) -> bool:
        """Whether a tree that ends now waits for this goal, which it has given up."""
        return goal.outcome is not None and (goal.end is End.UNKNOWN or goal.suspect)

    def interrupt(self, leaf: Leaf) -> None:
        """What py_trees' terminate(INVALID) does; twice, because it may come twice."""
        if leaf.ticket is not None:
            self.tell(leaf.ticket, Event.INTERRUPTED)
            self.judge.interrupted_again(leaf.ticket)
        leaf.ticket = leaf.attempts = None

    def run_again(self) -> None:
        """The run ends, waits in vain for what is open, and another begins.

        That sees nothing of the servers yet, and knows only the lost ones of the first one's goals.
        """
        for leaf in self.leaves:
            self.interrupt(leaf)
        for ticket in self.tickets:
            if self._waits(ticket.goal):
                self.tell(ticket, Event.DRAINED)
        for action, before in self.lines.items():
            line = self.lines[action] = Line(action)
            for ticket in list(before.tickets.values()):
                if ticket.goal.lost:
                    ticket.line, ticket.was_gone = line, True
                    line.tickets[ticket.goal.id] = ticket
                else:
                    self.tell(ticket, Event.CLOSED)
        for leaf in self.leaves:
            leaf.line = self.lines[leaf.plan.action]

    # What traffic does

    def begin(self, leaf: Leaf) -> Ticket:
        """Begin a goal: it queues for its resources."""
        plan = leaf.plan
        attempt = leaf.attempts.attempt if leaf.attempts else 1
        name = f"{leaf.name}.{leaf.visits}.{attempt}"
        goal = Goal(
            b"%d" % len(self.tickets),
            plan.action,
            plan.timeouts,
            self.world.now,
            resources=plan.resources,
            busy=plan.busy,
        )
        ticket = Ticket(goal, name, leaf.line)
        self.tickets.append(ticket)
        leaf.line.tickets[goal.id] = ticket
        self.judge.begins(ticket)
        answer = self.resources.request(ticket, goal.resources, plan.busy)
        if answer is Answer.GRANTED:
            self.tell(ticket, Event.GRANTED)
        elif answer is Answer.TAKEN:
            self.tell(ticket, Event.TAKEN)
        return ticket

    def advance(self, ticket: Ticket) -> None:
        """Send the goal, where its server is ready."""
        line = ticket.line
        if ticket.goal.state is not State.WAITING_FOR_SERVER:
            return
        state = self.look(line)
        if self.builds_nonsense:
            self.builds_nonsense = False
            self.tell(ticket, Event.INVALID, "no such variable")
        elif state is Server.AMBIGUOUS:
            self.tell(ticket, Event.SERVER_AMBIGUOUS)
        elif state is Server.READY and not self._in_the_way_of(ticket):
            self.tell(ticket, Event.SERVER_READY)

    def _in_the_way_of(self, ticket: Ticket) -> bool:
        """Whether a goal that was given up must be canceled first."""
        for line in self.lines.values():
            if any(other.goal.lost for other in line.tickets.values()):
                self.look(line)
            same = line is ticket.line
            if any(t.goal.bars(ticket.goal, same_server=same) for t in line.tickets.values()):
                return True
        return False

    def out_of_sight(self, ticket: Ticket) -> bool:
        """Whether nothing shows any of the servers that a goal was sent to."""
        action = ticket.line.action
        return not (ticket.sent_to & self.world.shown(action) and self.world.ready(action))

    def tell(self, ticket: Ticket, event: Event, detail: Any = None) -> None:
        """Tell a goal what happened and do what it says."""
        before = self.judge.before(ticket)
        commands = ticket.goal.on(event, self.world.now, detail)
        self._follow(ticket, before, event, detail, commands)

    def poll(self, ticket: Ticket) -> None:
        """Let the goal's deadlines take effect."""
        before = self.judge.before(ticket)
        commands = ticket.goal.poll(self.world.now)
        self._follow(ticket, before, None, None, commands)

    def _follow(
        self,
        ticket: Ticket,
        before: Before,
        event: Event | None,
        detail: Any,
        commands: tuple[Command, ...],
    ) -> None:
        goal = ticket.goal
        was_accepted = before.accepted
        self.judge.after(ticket, before, event, detail, commands)
        if goal.state is State.DONE:
            ticket.line.tickets.pop(goal.id, None)
        for command in commands:
            self._carry_out(ticket, command)
        if goal.accepted and not was_accepted and goal.busy is Busy.REPLACE:
            for older in self.resources.holders(goal.resources):
                if older is ticket:
                    break
                self.tell(older, Event.REPLACED)

    def _carry_out(self, ticket: Ticket, command: Command) -> None:
        if command is Command.RELEASE:
            for next_one in self.resources.release(ticket):
                self.tell(next_one, Event.GRANTED)
        elif command is Command.SEND:
            ticket.sent_to = ticket.line.watch.gids
            if self.fails_to_send:
                self.fails_to_send = False
                self.tell(ticket, Event.SEND_FAILED, "no space left")
                return
            if self.restarts_meanwhile:
                self.restarts_meanwhile = False
                self.world.restart(ticket.line.action)
            self.judge.sent(ticket, self._request("goal", ticket))
            ticket.sent_to |= self.world.shown(ticket.line.action)  # it may have reached these, too
        elif command is Command.CANCEL:
            self._request("cancel", ticket)
        else:
            self._request("result", ticket)

    def _request(self, kind: str, ticket: Ticket) -> int:
        number = len(self._requests) + 1
        self._requests[number] = ticket
        return self.world.send(kind, ticket.line.action, ticket.goal.id, ticket.name, number)

    # What arrives

    def receive(self, message: Message) -> None:
        """Pass an answer on, as often as it comes."""
        line = self.lines[message.server.action]
        if message.kind == "probe answer":
            line.watch.probe_answered(self.world.now.steady, message.number)
            return
        ticket = self.addressee(line, message)
        if ticket is None:
            return
        if message.kind == "answer":
            self._goal_answered(ticket, message)
        elif message.kind == "feedback":
            self.tell(ticket, Event.FEEDBACK, message.detail)
        elif message.kind == "status":
            if message.detail in ENDS or not ticket.goal.accepted:
                self.tell(ticket, Event.STATUS, message.detail)
        elif message.kind == "cancel answer":
            self.tell(ticket, Event.CANCEL_ANSWERED, message.detail)
        elif message.detail in ENDS:
            if message.detail != STATUS_SUCCEEDED and self._rival_sent(ticket):
                self.tell(ticket, Event.REPLACED)  # its result has overtaken the rival's acceptance
            self.tell(ticket, Event.RESULT, (message.detail, None))
        else:
            self._denied(ticket)

    def addressee(self, line: Line, message: Message) -> Ticket | None:
        """Return whose answer this is, unless the goal is DONE."""
        return line.tickets.get(message.goal_id)

    def _goal_answered(self, ticket: Ticket, message: Message) -> None:
        """With two servers the first answer counts, as in rclpy."""
        if self._requests.get(message.number, ticket) is None and not message.detail:
            return
        self._requests[message.number] = None
        self.tell(ticket, Event.ACCEPTED if message.detail else Event.REJECTED)

    def _rival_sent(self, ticket: Ticket) -> bool:
        """Whether a newer goal that replaces this one is on its way."""
        holders = self.resources.holders(ticket.goal.resources)
        newer = holders[holders.index(ticket) + 1 :] if ticket in holders else []
        return any(t.goal.busy is Busy.REPLACE and t.goal.state is State.SENDING for t in newer)

    def _denied(self, ticket: Ticket) -> None:
        watch = ticket.line.watch
        if not watch.changed(ticket.sent_to):
            if watch.state(self.world.now.steady) is Server.READY:
                self.tell(ticket, Event.RESULT_UNKNOWN)
        elif ticket.denied_at is None:
            ticket.denied_at = self.world.now.steady

    # What goes on by itself

    def look(self, line: Line) -> Server:
        """Observe a server and tell its goals what that means for them."""
        now, watch = self.world.now.steady, line.watch
        gids = self.world.shown(line.action)
        watch.observe(now, self.world.ready(line.action), gids)
        if watch.wants_probe(now):
            number = len(self._requests) + 1
            self._requests[number] = None
            watch.probe_sent(now, number)
            self.world.send("probe", line.action, b"", "", number)
        for ticket in list(line.tickets.values()):
            if ticket.goal.sent:
                self._compare(ticket, watch, now)
        return watch.state(now)

    def _compare(self, ticket: Ticket, watch: ServerWatch, now: float) -> None:
        goal = ticket.goal
        gone = watch.gone(now, ticket.sent_to)
        was_gone, ticket.was_gone = ticket.was_gone, gone
        if goal.lost:
            if was_gone and not gone:
                self.tell(ticket, Event.SERVER_RETURNED)
        elif gone:
            self.tell(ticket, Event.SERVER_LOST, "went away under the goal")
        elif not watch.changed(ticket.sent_to):
            ticket.denied_at = None
        elif not ticket.goal.accepted or watch.state(now) is Server.AMBIGUOUS:
            pass
        elif ticket.denied_at is not None and watch.alone_since(now, ticket.denied_at):
            self.tell(ticket, Event.SERVER_LOST, "restarted under the goal")
            self.tell(ticket, Event.SERVER_RESTARTED)
        elif now - ticket.asked_at > 0.5:
            ticket.asked_at = now
            self.tell(ticket, Event.SERVER_CHANGED)

    def attend(self) -> None:
        """What the alarm of ros/traffic.py does."""
        for line in self.lines.values():
            if line.tickets or line.watch.gids:
                self.look(line)
            for ticket in list(line.tickets.values()):
                self.poll(ticket)
                self.judge.polled(ticket)
        self.judge.nobody_waits_in_vain()

    def due_in(self) -> float:
        """Return the seconds until something is due (half a second where nothing is)."""
        now = self.world.now
        dues = [t.goal.due_in(now) for line in self.lines.values() for t in line.tickets.values()]
        return min((due for due in dues if due is not None), default=0.5)

    def close(self) -> None:
        """The process ends."""
        self.closed = True
        for ticket in self.tickets:
            self.tell(ticket, Event.CLOSED)

    def accepted_on_server(self, job: Job) -> None:
        """Not seen by any real caller: for the judge."""
        self.judge.accepted_on_server(job)

    def crowded(self, action: str, *, but_lost: bool = False) -> None:
        """Not seen either: there are two live servers under the name.

        Not an excuse for goals that are lost already, where one comes back.
        """
        for ticket in self.lines[action].tickets.values():
            ticket.ledger.crowded |= not (but_lost and ticket.goal.lost)
