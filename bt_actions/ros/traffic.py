"""Carries out what goals and resources decide, for every goal of this process, until it is done.

A leaf begins a goal here and advances it at its ticks. From the moment the request is out, the
goal is driven by what arrives, whether or not anybody ticks: answers (on executor threads),
deadlines and the watch over the servers (on the alarm, a plain thread that sleeps while no goal is
open). What a leaf leaves behind is thereby drained without it.

One lock guards all of it. Under the lock nothing waits, and no code of the user's runs: observers
only take note. This file decides nothing about a goal (goals/goal.py), its tries
(goals/attempts.py), or whether a server is alive (servers/presence.py).
"""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node

from bt_actions.goals.goal import Goal
from bt_actions.goals.ids import new_goal_id
from bt_actions.goals.policy import Busy, End, Timeouts
from bt_actions.goals.resources import Answer
from bt_actions.goals.terms import Event, State
from bt_actions.ros import alarm, shared
from bt_actions.ros.alive import is_valid
from bt_actions.ros.clocks import Clocks
from bt_actions.ros.draining import drain
from bt_actions.ros.line import Line
from bt_actions.ros.log import log
from bt_actions.ros.shared import (
    Beginner,
    Change,
    Observer,
    Ticket,
    changed,
    domain_of,
    ledger,
    lock,
)
from bt_actions.ros.signals import ended_by_signals, insists
from bt_actions.servers.presence import Server
from bt_actions.utilities.plain_text import in_words, raised

IN_FLIGHT = 8
"""Goal requests of this process under way at a server; its queue holds 10, and drops what is over
silently."""
_ON_NODE = "_bt_actions_traffic"
_begins = threading.local()
_contexts: weakref.WeakKeyDictionary[Any, _Participant] = weakref.WeakKeyDictionary()
_closing = False  # the process ends: a tree that ticks on begins nothing any more


class _Participant:
    """That of a context, as long as any of its nodes is there: the next one gets a new one.

    Or the same, where the user has another node there, of which nobody tells us.
    """

    def __init__(self, before: _Participant | None) -> None:
        self.since = time.monotonic()
        """Since when it is known here; a new one is blind to nothing."""
        now = alarm.standstill.long_times
        self.long_standstills: int = now if before is None else before.long_standstills
        """How often this process had stood still for long by then: it may be deaf where a line is
        made after more of them."""
        self.nodes: weakref.WeakSet[Node] = weakref.WeakSet()


class Traffic:
    """All action traffic of one node."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.clocks = Clocks(node)
        self.domain = domain_of(node.context.get_domain_id())
        seen = _contexts.get(node.context)
        if seen is None or not any(is_valid(each) for each in seen.nodes):
            alarm.appears()
            seen = _contexts[node.context] = _Participant(seen)
        seen.nodes.add(node)
        self.seen_since, self.long_standstills = seen.since, seen.long_standstills
        self.made_at = time.monotonic()
        self._namespace = node.get_namespace().rstrip("/")
        self._name = node.get_name()
        self._lines: dict[str, Line] = {}
        self._warned_of: set[str] = set()
        self._observers: list[Observer] = []

    @classmethod
    def of(cls, node: Node) -> Traffic:
        """Return the one Traffic of `node`."""
        with lock:
            traffic: Traffic | None = getattr(node, _ON_NODE, None)
            if traffic is None:
                traffic = cls(node)
                setattr(node, _ON_NODE, traffic)  # lives as long as the node does
            return traffic

    def line(self, action_type: Any, action_name: str) -> Line:
        """Return the shared line to an action, and count its user.

        A remapping rule for the action's name has no effect, and is warned of. Raises ValueError
        for a name that ROS refuses, and TypeError when it is in use with another type.
        """
        name = expand_topic_name(action_name, self.node.get_name(), self.node.get_namespace())
        with lock:
            line = self._lines.get(name)
            if line is None:
                self._warn_of_remapping(name)
                line = self._lines[name] = Line(self, action_type, name)
            elif line.action_type is not action_type:
                raise TypeError(
                    f"{name} is used with two types: {line.action_type.__module__}."
                    f"{line.action_type.__name__} and {action_type.__module__}."
                    f"{action_type.__name__}"
                )
            line.users += 1
            return line

    def _warn_of_remapping(self, name: str) -> None:
        """Say it, once for a name, where a rule would have it another: ROS remaps no action."""
        other, part = self.node.resolve_service_name(name), f"{name}/_action/send_goal"
        remapped = self.node.resolve_service_name(part) != part
        if other != name and not remapped and name not in self._warned_of:
            self._warned_of.add(name)
            log.warning(
                f"a rule remaps {name} to {other}, and has no effect: ROS does not remap actions. "
                f"Name {other} where the action is used, set the namespace of the node, or remap "
                f"its parts: {part}, cancel_goal, get_result, feedback and status"
            )

    def leave(self, line: Line) -> None:
        """Count a user of `line` off; with the last one, and no goal open, its client goes too."""
        with lock:
            line.users -= 1
            if line.users <= 0:
                line.put_away()
            self.drop_if_unused(line)

    def drop_if_unused(self, line: Line) -> None:
        """Destroy the client of a line that has no user and no open goal.

        Not before it has delivered all: a second server may have taken the last goal, too.
        """
        unused = line.users <= 0 and not line.goals and not line.client.has_more
        if unused and self._lines.get(line.name) is line:
            del self._lines[line.name]
            line.close()

    # A leaf's calls

    @staticmethod
    @contextlib.contextmanager
    def begun_by(who: Beginner) -> Iterator[None]:
        """Have what this thread begins meanwhile known as begun by `who` (Ticket.begun_by)."""
        before = _who_begins()
        _begins.who = who
        try:
            yield
        finally:
            _begins.who = before

    def begin(
        self,
        line: Line,
        owner: Any,
        timeouts: Timeouts,
        resources: frozenset[str],
        busy: Busy,
        *,
        attempt: int = 1,
        keeps_feedback: bool = False,
        settles: Callable[[Any], bool] = lambda result: True,
    ) -> Ticket:
        """Begin a goal: it queues for its resources. It is sent by `advance`.

        A resource is named as an action is: what is relative is in the node's namespace. `settles`
        is asked with the result, under the lock: where it says no, the goal's end is UNKNOWN.
        """
        with lock:
            now = self.clocks.now()
            held = frozenset(self._full_name(each) for each in resources)
            goal = Goal(
                new_goal_id(), line.name, timeouts, now,
                resources=held, busy=busy, settles=settles,
            )  # fmt: skip
            who = _who_begins()
            ticket = Ticket(goal, line, self, owner, owner.name, who, attempt, keeps_feedback)
            ticket.begun_at = time.monotonic()
            line.goals[goal.id] = ticket
            alarm.mind(line)
            answer = self.domain.resources.request(ticket, goal.resources, busy)
            if answer is Answer.GRANTED:
                line.tell(ticket, Event.GRANTED)
            elif answer is Answer.TAKEN:
                line.tell(ticket, Event.TAKEN)
            else:
                self.note(ticket)
            return ticket

    def _full_name(self, name: str) -> str:
        """Expand the name of a resource, which may be what ROS would refuse as a name."""
        name = name.rstrip("/")
        if name.startswith("/"):
            return name
        if name.startswith("~"):
            return f"{self._namespace}/{self._name}{name[1:]}"
        return f"{self._namespace}/{name}"

    def advance(self, ticket: Ticket, make_message: Callable[[], Any]) -> None:
        """Take a goal as far as it goes now: send it, where its server is ready. Never waits.

        `make_message` is called without the lock, on the caller's thread, at most once a call (the
        server may go meanwhile); what it raises makes the goal INVALID_GOAL.
        """
        line = ticket.line
        with lock:
            if ticket.goal.state is State.DONE:
                return
            line.poll(ticket)
            if _closing or line.given_up(ticket):
                line.tell(ticket, Event.INTERRUPTED)
            if ticket.goal.state is not State.WAITING_FOR_SERVER:
                return
            if line.look(time.monotonic()) is Server.AMBIGUOUS:
                line.tell(ticket, Event.SERVER_AMBIGUOUS)
            if not self._may_send(ticket):
                return
        try:
            message = make_message()
        except Exception as error:  # noqa: BLE001 - the user's: any
            line.tell(ticket, Event.INVALID, in_words(error))  # which may run code of the user's
            return
        with lock:
            if self._may_send(ticket):
                line.tell(ticket, Event.SERVER_READY, message=message)

    @staticmethod
    def is_settled(ticket: Ticket) -> bool:
        """Whether its outcome is decided, and what is known of its end then is, too."""
        with lock:  # a goal takes one step at a time
            return ticket.goal.outcome is not None

    def _may_send(self, ticket: Ticket) -> bool:
        line = ticket.line
        return (
            ticket.goal.state is State.WAITING_FOR_SERVER
            and not (_closing or line.given_up(ticket))
            and not line.way.keeps(time.monotonic())
            and not line.orphaned
            and is_valid(self.node)
            and line.watch.state(time.monotonic()) is Server.READY
            and not line.may_overtake(ticket)
            and not self._in_the_way_of(ticket)
            and line.in_flight() < IN_FLIGHT
        )

    def _in_the_way_of(self, ticket: Ticket) -> bool:
        """Whether a goal that any node of this process gave up must be canceled first.

        One that was lost holds nothing any more; should its server be back, it is canceled first.
        """
        lines = ticket.line.neighbors()
        left = {(line.name, line.action_type) for line in lines if line.has_lost(ticket)}
        if ticket.goal.busy in (Busy.WAIT, Busy.FAIL):
            remembered = self.domain.lost_with(ticket.goal.resources)
            left.update(remembered)
            for action, action_type in remembered:
                if action not in self._lines:  # another's server, which nobody speaks to any more
                    self._lines[action] = Line(self, action_type, action)
        now = time.monotonic()
        ours = [line for line in self._lines.values() if (line.name, line.action_type) in left]
        for line in {*lines, *ours}:  # all of them first: one may see what another has lost
            if line.has_lost(ticket) or line in ours:
                line.look(now)
        return any(
            line.in_the_way_of(ticket) or line.may_come_back_for(ticket, now)
            for line in ticket.line.neighbors()
        )

    def interrupt(self, ticket: Ticket) -> None:
        """The tree no longer wants it. Returns at once; the goal is drained."""
        ticket.line.tell(ticket, Event.INTERRUPTED)

    def pause(self, tickets: Iterable[Ticket]) -> None:
        """Stop the deadlines of goals that were not sent yet."""
        with lock:
            for ticket in tickets:
                if not ticket.goal.sent and ticket.paused_at is None:
                    ticket.paused_at = time.monotonic()

    def resume(self, tickets: Iterable[Ticket]) -> None:
        """Let the deadlines run on, with what remained of them."""
        with lock:
            for ticket in tickets:
                if ticket.paused_at is not None:
                    ticket.goal.postpone(time.monotonic() - ticket.paused_at)
                    ticket.paused_at = None

    # Who watches

    def observe(self, observer: Observer) -> None:
        """Call `observer` at every change, under the lock: it must only take note."""
        with lock:
            self._observers.append(observer)

    def unobserve(self, observer: Observer) -> None:
        """Stop calling `observer`."""
        with lock, contextlib.suppress(ValueError):
            self._observers.remove(observer)

    def note(self, ticket: Ticket) -> None:
        """Report a goal's change to the log and the observers."""
        goal = ticket.goal
        unknown = goal.outcome is not None and goal.end is End.UNKNOWN
        if unknown and not ticket.told_unknown:
            if ticket.told_gone:
                log.warning(
                    f"{goal!r}: its server is back; canceling it, should it still run there"
                )
            else:
                why = f"{goal.reason}{goal.cancel_said}"
                log.error(f"{goal!r}: not accounted for, it may still be running: {why}")
        elif not unknown and ticket.told_unknown:
            log.info(f"{goal!r}: accounted for at last")
        ticket.told_unknown, ticket.told_gone = unknown, goal.end is End.SERVER_GONE
        now = self.clocks.now().ros
        self.notify(Change(now, ticket, goal.state, goal.outcome, goal.end, goal.reason))

    def notify(self, change: Change | None) -> None:
        """Tell the observers, and whoever waits."""
        for observer in list(self._observers):
            try:
                observer(change)
            except Exception as error:  # noqa: BLE001 - the run goes on without it
                self._observers.remove(observer)
                log.error(f"an observer of goals raised and was removed: {raised(error)}")
        changed.notify_all()

    def destroy(self) -> None:
        """Drain what is still open and destroy the clients; nobody may spin the node any more."""
        with lock:
            left = [ticket for line in self._lines.values() for ticket in line.goals.values()]
        drain(left)
        with lock:
            lines, self._lines = list(self._lines.values()), {}
            for line in lines:
                line.put_away(all_of_them=True)
                for ticket in list(line.goals.values()):
                    line.tell(ticket, Event.CLOSED)
                line.close()
                alarm.forget(line)
            setattr(self.node, _ON_NODE, None)
            ledger.close()


def _who_begins() -> Beginner | None:
    return getattr(_begins, "who", None)


@atexit.register
def close_process() -> None:
    """Close what a loop that crashed, or never called shutdown, has left; send nothing more.

    For a process that ends: this cannot be undone. A first signal meanwhile waits, and a second one
    ends the wait.
    """
    global _closing
    hurried = False

    def hurry(again: bool, _ends_process: bool) -> None:
        nonlocal hurried
        hurried = hurried or again

    with contextlib.suppress(KeyboardInterrupt), ended_by_signals(hurry):
        with lock:
            _closing = True
            lines = [line for line in alarm.minded() if isinstance(line, Line)]
            tickets = [ticket for line in lines for ticket in line.goals.values()]
        left = [ticket for ticket in tickets if not ticket.goal.lost or ticket.looked_out_for]
        try:
            drain(left, lambda: hurried or insists())
        finally:
            for ticket in left:
                if not ticket.is_over:
                    log.error(f"{ticket.goal!r}: the process ends and cannot account for it")
            with lock:
                ledger.close()
            log.flush()


def _disown() -> None:
    """In the child of a fork: the goals are the parent's, and so is what guards them."""
    atexit.unregister(close_process)
    alarm.disown()
    shared.disown()


os.register_at_fork(after_in_child=_disown)
