"""Leaves and traffic as ros/traffic.py drives them, in a model world.

It carries out what goals and resources decide. It reports each step to a judge, and decides
nothing that traffic does not.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from bt_actions.attempts import AttemptRecord, Attempts
from bt_actions.goal import Goal
from bt_actions.goal_terms import ENDS, STATUS_SUCCEEDED, Command, Event, State
from bt_actions.policy import Busy, End, Outcome
from bt_actions.resources import Answer, Resources
from bt_actions.server import Server, ServerWatch
from tests.machine.judge import Judge
from tests.machine.parts import Before, Leaf, LeafPlan, Line, Ticket
from tests.machine.world import NODES, Job, Message, World


class Caller:
    """The leaves, and the traffic beneath them."""

    def __init__(self, world: World, plans: Sequence[LeafPlan], judge: Judge) -> None:
        self.world = world
        self.judge = judge
        self.resources: Resources[Ticket] = Resources()
        self.lines = {(a, node): Line(a, node) for a in world.actions for node in NODES}
        self.leaves = [
            Leaf(f"leaf{number}", plan, self.lines[plan.action, plan.node])
            for number, plan in enumerate(plans)
        ]
        self.tickets: list[Ticket] = []
        self.closed = False
        self.fails_to_send = False
        self.restarts_meanwhile = False
        self.builds_nonsense = False
        self.unexpected = False
        self._requests: dict[int, Ticket | None] = {}
        self._askers: dict[int, Line] = {}
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
        for key, before in self.lines.items():
            line = self.lines[key] = Line(*key)
            for ticket in list(before.tickets.values()):
                if ticket.goal.lost:
                    ticket.line, ticket.was_gone = line, True
                    line.tickets[ticket.goal.id] = ticket
                else:
                    self.tell(ticket, Event.CLOSED)
        for leaf in self.leaves:
            leaf.line = self.lines[leaf.plan.action, leaf.plan.node]

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
        for line in self._looks_at(ticket):
            self.look(line)
        return any(
            other.goal.bars(ticket.goal, same_server=line.action == ticket.line.action)
            for line in self.lines.values()
            for other in line.tickets.values()
        )

    def _looks_at(self, ticket: Ticket) -> list[Line]:
        """The lines with lost goals: is one of them back?"""
        lines = self.lines.values()
        return [line for line in lines if any(t.goal.lost for t in line.tickets.values())]

    def out_of_sight(self, lost: Ticket, wanted: Ticket) -> bool:
        """Whether nothing shows any of the servers that a lost goal was sent to.

        Told by who looks before `wanted` is sent.
        """
        action, world = lost.line.action, self.world
        return not any(
            lost.sent_to & world.shown(action, line.node) and world.ready(action, line.node)
            for line in [wanted.line, *self._looks_at(wanted)]
            if line.action == action
        )

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
            line = ticket.line  # it may have reached these, too
            ticket.sent_to |= self.world.shown(line.action, line.node)
        elif command is Command.CANCEL:
            self._request("cancel", ticket)
        else:
            self._request("result", ticket)

    def _request(self, kind: str, ticket: Ticket) -> int:
        return self._ask(kind, ticket.line, ticket.goal.id, ticket.name, ticket)

    def _ask(self, kind: str, line: Line, goal: bytes, name: str, ticket: Ticket | None) -> int:
        number = len(self._requests) + 1
        self._requests[number], self._askers[number] = ticket, line
        nobody = self.world.servers[0]
        message = Message(kind, nobody, goal, name, number=number, to_server=True)
        return self.world.send(message, line.action, line.node)

    # What arrives

    def receive(self, message: Message) -> None:
        """Pass an answer on, as often as it comes."""
        asker = self._askers.get(message.number)
        if message.kind == "probe answer" and asker is not None:
            asker.watch.probe_answered(self.world.now.steady, message.number)
            return
        if asker is not None:
            hearing = [asker]
        else:
            hearing = [
                line
                for line in self.lines.values()
                if line.action == message.server.action
                and self.world.in_sight(message.server, line.node)
            ]
        for line in hearing:
            ticket = self.addressee(line, message)
            if ticket is not None:
                self._pass_on(ticket, message)

    def _pass_on(self, ticket: Ticket, message: Message) -> None:
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
        gids = self.world.shown(line.action, line.node)
        watch.observe(now, self.world.ready(line.action, line.node), gids)
        self._take_over(line)
        if watch.wants_probe(now):
            watch.probe_sent(now, len(self._requests) + 1)
            self._ask("probe", line, b"", "", None)
        for ticket in list(line.tickets.values()):
            if ticket.goal.sent:
                self._compare(ticket, watch, now)
        return watch.state(now)

    def _take_over(self, line: Line) -> None:
        """Take lost goals of the other node whose server is in sight here."""
        for other in self.lines.values():
            if other is line or other.action != line.action:
                continue
            for ticket in list(other.tickets.values()):
                if ticket.goal.lost and ticket.sent_to & line.watch.gids:
                    del other.tickets[ticket.goal.id]
                    ticket.line, ticket.was_gone = line, True
                    line.tickets[ticket.goal.id] = ticket

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
        for line in self.lines.values():
            for ticket in line.tickets.values() if line.action == action else ():
                ticket.ledger.crowded |= not (but_lost and ticket.goal.lost)
