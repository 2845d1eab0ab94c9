"""Leaves and traffic as ros/traffic.py drives them, in a model world.

It carries out what goals and resources decide, and reports each step to a judge. For who is in the
way, takes over, or replaces it is a copy of ros/line.py and ros/traffic.py, kept by hand, which is
fast and can be broken in many ways; production.py plays the same histories with those themselves.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from bt_actions.attempts import AttemptRecord, Attempts
from bt_actions.goal import Goal
from bt_actions.goal_terms import STATUS_SUCCEEDED, Command, Event, State
from bt_actions.policy import Busy, End, Outcome
from bt_actions.resources import Answer, Resources
from bt_actions.server import Server
from bt_actions.testimony import Told
from bt_actions.twin import TwinTestimony
from tests.machine.judge import Judge
from tests.machine.parts import Before, Leaf, LeafPlan, Ledger, Line, Ticket
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
        self.opens_meanwhile = False
        self.builds_nonsense = False
        self.unexpected = False
        self._askers: dict[int, Line] = {}
        self._answers: dict[int, dict[bytes, Any]] = {}
        self._asked: dict[int, float] = {}
        self._moments = 0
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
                        "opens_meanwhile",
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
                    ticket.line = line
                    ticket.testimony.taken_over()
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
            lost.testimony.sent_to & world.shown(action, line.node)
            and world.ready(action, line.node)
            for line in [wanted.line, *self._looks_at(wanted)]
            if line.action == action
        )

    def tell(self, ticket: Ticket, event: Event, detail: Any = None) -> None:
        """Tell a goal what happened and do what it says."""
        if ticket.twin:
            self._follow_twin(ticket, ticket.goal.on(event, self.world.now, detail))
            return
        before = self.judge.before(ticket)
        commands = ticket.goal.on(event, self.world.now, detail)
        self._follow(ticket, before, event, detail, commands)

    def poll(self, ticket: Ticket) -> None:
        """Let the goal's deadlines take effect."""
        if ticket.twin:
            self._follow_twin(ticket, ticket.goal.poll(self.world.now))
            return
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
        if goal.state is State.DONE and ticket.line.tickets.get(goal.id) is ticket:
            del ticket.line.tickets[goal.id]
            self._keep_in_mind(ticket)
            self.judge.is_done(ticket, event)
        for command in commands:
            self._carry_out(ticket, command)
        if goal.accepted and not was_accepted and goal.busy is Busy.REPLACE:
            for older in self.resources.holders(goal.resources):
                if older is ticket:
                    break
                self.tell(older, Event.REPLACED, goal.server)

    def _follow_twin(self, twin: Ticket, commands: tuple[Command, ...]) -> None:
        if twin.goal.state is State.DONE and twin.line.tickets.get(twin.goal.id) is twin:
            del twin.line.tickets[twin.goal.id]
            self.judge.twin_is_done(twin)
        for command in commands:
            self._carry_out(twin, command)

    def _carry_out(self, ticket: Ticket, command: Command) -> None:
        if command is Command.RELEASE:
            for next_one in self.resources.release(ticket):
                self.tell(next_one, Event.GRANTED)
        elif command is Command.SEND:
            ticket.testimony.sent(ticket.line.watch)
            if self.fails_to_send:
                self.fails_to_send = False
                self.tell(ticket, Event.SEND_FAILED, "no space left")
                return
            if self.restarts_meanwhile:
                self.restarts_meanwhile = False
                self.world.restart(ticket.line.action)
            if self.opens_meanwhile:
                self.opens_meanwhile = False
                self.world.start(ticket.line.action)
            self.judge.sent(ticket, self._request("goal", ticket))
            self._observe(ticket.line)
            ticket.testimony.sent(ticket.line.watch)  # it may have reached these, too
        elif command is Command.CANCEL:
            self._request("cancel", ticket)
        else:
            self._request("result", ticket)

    def _request(self, kind: str, ticket: Ticket) -> int:
        return self._ask(kind, ticket.line, ticket.goal.id, ticket.name)

    def _ask(self, kind: str, line: Line, goal: bytes, name: str) -> int:
        number = len(self._askers) + 1
        self._askers[number], self._answers[number] = line, {}
        self._asked[number] = self._moment()
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
            if ticket is None and message.kind == "answer" and message.detail:
                self._found_twice(line, message)
            elif ticket is not None:
                self._take(ticket, message)
        if message.kind == "answer" and message.detail and asker in self.lines.values():
            self.judge.hears_acceptance(self.tickets[int(message.goal_id)], message.server)

    def _take(self, ticket: Ticket, message: Message) -> None:
        if message.kind == "feedback":
            self._pass_on(ticket, ticket.testimony.lives(ticket.line.watch, self._moment()))
            self.tell(ticket, Event.FEEDBACK, message.detail)
        elif message.kind == "status":
            said, now = ticket.testimony, self._moment()
            self._pass_on(ticket, said.shown(ticket.line.watch, now, message.detail))
        else:
            self._answered(ticket, message)

    def _answered(self, ticket: Ticket, message: Message) -> None:
        """Pass on an answer with those before it; one that comes twice is the same answer."""
        if ticket.twin:
            self._observe(ticket.line)
        testimony, watch, now = ticket.testimony, ticket.line.watch, self._moment()
        by_server = self._answers.setdefault(message.number, {})
        by_server.pop(message.server.gid, None)
        by_server[message.server.gid] = message.detail
        answers = list(by_server.values())
        asked = self._asked.get(message.number, now)
        if message.kind == "answer":
            self._pass_on(ticket, testimony.answered(watch, now, answers))
        elif message.kind == "cancel answer":
            self._pass_on(ticket, testimony.canceled(watch, now, asked, answers))
        else:
            results = [(status, None) for status in answers]
            self._pass_on(ticket, testimony.finished(watch, now, asked, results))

    def _found_twice(self, line: Line, message: Message) -> None:
        """One more acceptance of a goal that has ended: by a second server, which cancels it."""
        known = self._answers.setdefault(message.number, {})
        past = self.tickets[int(message.goal_id)]
        if message.server.gid in known or past.line is not line or not past.goal.sent:
            return  # the same one again; or its run is over
        if past.goal.state is State.DONE and line in self.lines.values():
            known[message.server.gid] = True
            self._observe(line)
            if len(past.testimony.sent_to | line.watch.gids) == 1 and past.goal.accepted:
                return
            twin = self._twin(past)
            line.watch.two_answered()
            said = TwinTestimony(twin.goal, past.testimony, past.testimony.sent_to)
            said.is_at_another(line.watch, self._moment())
            twin.testimony = said
            self.tell(twin, Event.SERVER_RETURNED)

    def _twin(self, past: Ticket) -> Ticket:
        twin = Ticket(past.goal.twin(self.world.now), f"{past.name}'", past.line, twin=True)
        twin.ledger = Ledger(0.0, 0.0)
        past.line.tickets[twin.goal.id] = twin
        return twin

    def _keep_in_mind(self, ticket: Ticket) -> None:
        """A second server may have taken it, and has gone."""
        self._observe(ticket.line)
        elsewhere = ticket.testimony.may_run_at(ticket.line.watch)
        if elsewhere and ticket.goal.sent and not ticket.goal.lost:
            twin = self._twin(ticket)
            twin.testimony = TwinTestimony(twin.goal, ticket.testimony, elsewhere)
            twin.testimony.taken_over()

    def _pass_on(self, ticket: Ticket, told: Told) -> None:
        for event, detail in told:
            if event is Event.RESULT and detail[0] != STATUS_SUCCEEDED and self._rival_sent(ticket):
                self.tell(ticket, Event.REPLACED)  # its result has overtaken the rival's acceptance
            self.tell(ticket, event, detail)

    def addressee(self, line: Line, message: Message) -> Ticket | None:
        """Return whose answer this is, unless the goal is DONE."""
        return line.tickets.get(message.goal_id)

    def _rival_sent(self, ticket: Ticket) -> bool:
        """Whether a newer goal that replaces this one is on its way."""
        holders = self.resources.holders(ticket.goal.resources)
        newer = holders[holders.index(ticket) + 1 :] if ticket in holders else []
        return any(t.goal.busy is Busy.REPLACE and t.goal.state is State.SENDING for t in newer)

    # What goes on by itself

    def look(self, line: Line) -> Server:
        """Observe a server and tell its goals what that means for them."""
        now, watch = self.world.now.steady, line.watch
        self._observe(line)
        self._take_over(line)
        if watch.wants_probe(now):
            watch.probe_sent(now, len(self._askers) + 1)
            self._ask("probe", line, b"", "")
        for ticket in list(line.tickets.values()):
            if ticket.goal.sent:
                self._pass_on(ticket, ticket.testimony.looked(watch, self._moment()))
        return watch.state(now)

    def _moment(self) -> float:
        """The time, a little later each time: what is asked next is asked later."""
        self._moments += 1
        return self.world.now.steady + self._moments * 1e-9

    def _observe(self, line: Line) -> None:
        shown = self.world.shown(line.action, line.node)
        line.watch.observe(self.world.now.steady, self.world.ready(line.action, line.node), shown)

    def _take_over(self, line: Line) -> None:
        """Take lost goals of the other node whose server is in sight here."""
        for other in self.lines.values():
            if other is line or other.action != line.action:
                continue
            for ticket in list(other.tickets.values()):
                sent_to = ticket.testimony.sent_to
                now = self.world.now.steady
                there = sent_to & line.watch.gids and line.watch.state(now) is not Server.ABSENT
                ghost_there = line.watch.all_live(now) and not other.watch.all_live(now)
                more = other.watch.gone(now, sent_to) or ghost_there
                if ticket.goal.lost and there and more:
                    del other.tickets[ticket.goal.id]
                    ticket.line = line
                    ticket.testimony.taken_over()
                    line.tickets[ticket.goal.id] = ticket

    def attend(self) -> None:
        """What the alarm of ros/traffic.py does."""
        for line in self.lines.values():
            if line.tickets or line.watch.gids:
                self.look(line)
            for ticket in list(line.tickets.values()):
                self.poll(ticket)
                if not ticket.twin:
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
