"""One action server as one node sees it: the shared client, the watch, and the goals on it.

Takes what the server says and what discovery shows, tells the goals, and does what they say. It
decides nothing about a goal (goals/goal.py), about who is alive (servers/presence.py), about what
is believed (servers/replies.py), or about goals that have ended (past.py). All under the one lock.
"""

from __future__ import annotations

import contextlib
import itertools
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bt_actions.goals.policy import Busy, End, Outcome
from bt_actions.goals.terms import (
    CANCEL_UNKNOWN_GOAL,
    STATUS_SUCCEEDED,
    Command,
    Event,
    Now,
    State,
)
from bt_actions.messages.interfaces import interface_name
from bt_actions.ros.action_client import ActionClient
from bt_actions.ros.alive import is_valid
from bt_actions.ros.in_sight import elsewhere
from bt_actions.ros.log import log
from bt_actions.servers.presence import LEASE, PROBES_KEPT, Server, ServerWatch
from bt_actions.servers.replies import Told
from bt_actions.traffic import alarm, shared
from bt_actions.traffic.ended import Past
from bt_actions.traffic.predecessors import Predecessors
from bt_actions.traffic.route import TOO_NEW, Route, ask
from bt_actions.traffic.shared import LOOKED_OUT_FOR, LOST_KEPT, NEVER, GoalHandle, ledger, lock
from bt_actions.utilities.plain_text import raised
from bt_actions.utilities.suggest import did_you_mean, listing

if TYPE_CHECKING:
    from bt_actions.goals.goal import Goal
    from bt_actions.traffic.traffic import Traffic

LOOK_WHILE_WAITING = 0.05
LOOK_WHILE_RUNNING = 0.2
LOOK_WHILE_LOST = 1.0
PUMP_EVERY = 0.01
"""Seconds between two looks of the alarm at a server: somebody waits for it; goals run on it; only
its return would matter. The last: between two takes of answers by the alarm, where nobody spins."""
LATE = 0.5
"""Seconds by which a look is so late that answers may have come in between, unseen."""
SILENT_FOR = 40.0
"""Seconds without a word of their server until goals whose node is gone are left to whoever can see
whether it is there: longer than a ghost is shown, or a question waits (asking.DENIED_FOR_GOOD)."""
BESIDE = 1.0
"""Seconds for which a server may be in sight before another one that was there all the time, or
that came back with it; 0.5 measured."""
FEEDBACK = "/_action/feedback"

_probes = itertools.count(1)


class ActionEndpoint:
    """One action as one node sees it: the shared client, the watch, and the goals on it."""

    def __init__(self, traffic: Traffic, action_type: Any, name: str) -> None:
        self.traffic = traffic
        self.action_type = action_type
        self.name = name
        self.users = 0
        self._generation = shared.generation
        self.goals: dict[bytes, GoalHandle] = {}
        self.watch = ServerWatch()
        self.client = ActionClient(traffic.node, action_type, name, self)
        self.cancels = traffic.domain.cancels_at(name, action_type)
        self.orphaned = False
        self._heard_at = time.monotonic()  # of an orphan: when its servers were last heard of
        self.route = Route(self)
        self._look_at = 0.0
        self._looked_like = Server.ABSENT  # at the last look
        self._was_away = False  # seen between two looks
        self.in_sight_since = time.monotonic()
        """Since when a server of this name has been shown without a break that was seen."""
        self._held_up = (True, True)  # by a server that has just come; by `Route.holds_back`
        self._looked_out_at = time.monotonic()
        self._last_probes: deque[int] = deque()
        self.past = Past(self)
        self.predecessors = Predecessors(name)
        self._warned_crowd = False
        self._warned_of: set[str] = set()
        self._adopt()

    def __repr__(self) -> str:
        return f"<Line {self.name}, {len(self.goals)} goals>"

    # What the server says (ActionClient's Listener)

    def goal_answered(self, goal_id: bytes, answers: tuple[bool, ...]) -> None:
        """Pass on an answer to a goal request; see to one that has ended and is accepted again."""
        with lock:
            handle = self._heard_of(goal_id)
            if handle is not None:
                now, said = time.monotonic(), handle.replies
                self._pass_on(handle, said.answered(self.watch, now, answers))
            elif answers[-1]:
                self.past.accepted(goal_id, answers)

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        """Pass on feedback of a goal of ours."""
        with lock:
            handle = self.goals.get(goal_id)
            if handle is None:
                self.past.runs(goal_id)
                return
            now = self._heard_at = time.monotonic()
            self.watch.heard(now)
            self._pass_on(handle, handle.replies.lives(self.watch, now))
            self.tell(handle, Event.FEEDBACK, feedback)
            if handle.keeps_feedback and handle.goal.outcome is None:
                handle.feedback.append(feedback)
                self.traffic.notify(None)

    def cancel_answered(self, goal_id: bytes, asked: float, answers: tuple[int, ...]) -> None:
        """Pass on an answer to a cancel request."""
        with lock:
            if self.is_parents:
                return
            self.cancels.answered(goal_id, time.monotonic())
            handle = self._heard_of(goal_id, denies=answers[-1] == CANCEL_UNKNOWN_GOAL)
            if handle is not None:
                now, said = time.monotonic(), handle.replies
                self._pass_on(handle, said.canceled(self.watch, now, asked, answers))
            else:
                self.past.cancel_answered(goal_id, asked, answers[-1])

    def result_came(
        self, goal_id: bytes, asked: float, answers: tuple[tuple[int, Any], ...]
    ) -> None:
        """Pass on a result."""
        with lock:
            handle = self._heard_of(goal_id, denies=answers[-1][0] == 0)
            if handle is not None:
                now, said = time.monotonic(), handle.replies
                self._pass_on(handle, said.finished(self.watch, now, asked, answers))

    def _heard_of(self, goal_id: bytes, *, denies: bool = False) -> GoalHandle | None:
        """Return the goal that an answer is about; of one of several it counts who is in sight.

        One that denies it may be the word of another server than the goal's.
        """
        handle = self.goals.get(goal_id)
        if handle is not None:
            self.watch.heard(time.monotonic())
            if not (denies and self.watch.changed(handle.replies.sent_to)):
                self._heard_at = time.monotonic()
            if len(handle.replies.servers) > 1:
                self.see()
        return handle

    def see(self) -> None:
        """Observe now who is in sight; what follows for the server is for the next look to say."""
        with contextlib.suppress(Exception):
            now = time.monotonic()
            self._observe(now, concludes=False)
            self._was_away |= self.watch.state(now) is Server.ABSENT

    def _pass_on(self, handle: GoalHandle, told: Told) -> None:
        for event, detail in told:
            if event is Event.RESULT and detail[0] != STATUS_SUCCEEDED and self._rival_sent(handle):
                self.tell(handle, Event.REPLACED)  # this has overtaken the rival's acceptance
            self.tell(handle, event, detail)

    def _rival_sent(self, handle: GoalHandle) -> bool:
        """Whether a newer goal that replaces this one is on its way, or has arrived."""
        holders = self.traffic.domain.resources.holders(handle.goal.resources)
        newer = holders[holders.index(handle) + 1 :] if handle in holders else []
        return any(other.goal.busy is Busy.REPLACE and other.goal.sent for other in newer)

    def statuses_came(self, statuses: dict[bytes, int]) -> None:
        """Pass on the statuses of our goals: each proves that the server has accepted the goal."""
        with lock:
            others = statuses.keys() - self.goals.keys()
            running = {each for each in others if 0 < statuses[each] < STATUS_SUCCEEDED}
            for goal_id in running:
                self.past.runs(goal_id)
            self.predecessors.see(running)
            for goal_id in self.goals.keys() & statuses.keys():
                status = statuses[goal_id]
                handle = self._heard_of(goal_id) if status > 0 else None
                if handle is not None:
                    now, said = time.monotonic(), handle.replies
                    self._pass_on(handle, said.shown(self.watch, now, status))

    def probe_answered(self, probe: int) -> None:
        """Pass on the answer to a probe."""
        with lock:
            self.watch.probe_answered(time.monotonic(), probe)
            self.traffic.notify(None)

    def all_delivered(self) -> None:
        """Let go of the client, if it was kept for what has just been delivered."""
        with lock:
            self.traffic.drop_if_unused(self)

    # What the goals want

    @property
    def is_parents(self) -> bool:
        """Whether this was made before a fork, and we are the child: the goals are not ours."""
        return self._generation != shared.generation

    def tell(
        self, handle: GoalHandle, event: Event, detail: Any = None, message: Any = None
    ) -> None:
        """Tell a goal what happened and do what it says; `message` is the goal to be sent."""
        with lock:
            if self.is_parents:
                return
            if event is Event.GRANTED and handle.paused_at is not None:
                handle.paused_at = time.monotonic()  # its next deadline begins in the pause
            self._apply(handle, lambda now: handle.goal.on(event, now, detail), message)

    def poll(self, handle: GoalHandle) -> None:
        """Let the goal's deadlines take effect, unless its tree is paused before sending.

        What has arrived by now is taken in first: an answer that came in time is in time, though
        the executor was too busy to look. Where this whole process stood still, it may be about to
        arrive. One moment decides whether to do so, and what is due.
        """
        with lock:
            goal, now = handle.goal, self.traffic.clocks.now()
            if self.is_parents:
                return
            if handle.paused_at is not None and not goal.sent:
                handle.kept_since = None
            else:
                self._give_back_time(handle, now.steady)
                if goal.due_in(now) == 0.0:
                    self.pump()
                    now = self.traffic.clocks.now()
                    self._bear_with(goal, now)
                self._apply(handle, lambda _: goal.poll(now), None)

    def _give_back_time(self, handle: GoalHandle, now: float) -> None:
        """See to it that no deadline counts the time in which a goal is not sent on our account."""
        waits = handle.goal.state is State.WAITING_FOR_SERVER
        if waits and handle.kept_since is not None:
            handle.goal.postpone(now - handle.kept_since)
        handle.kept_since = now if waits and self.route.holds_back(now) else None

    def _bear_with(self, goal: Goal, now: Now) -> None:
        """Hold deadlines that have passed while a stall may be why nothing has come in."""
        waits = goal.state is State.WAITING_FOR_SERVER
        open_question = self.route.holds_back if waits else self.route.in_doubt
        in_doubt = LOOK_WHILE_RUNNING if open_question(now.steady) else 0.0
        servers = alarm.stalls.servers_take(now.steady) if waits else 0.0
        goal.hold(max(alarm.stalls.answers_take(now.steady), servers, in_doubt), now)

    def mind(self, handle: GoalHandle) -> None:
        """Poll a goal on nobody's tick; what fails in that keeps no other goal from its turn."""
        try:
            self.poll(handle)
        except Exception as error:  # noqa: BLE001 - a mistake of ours: any
            self._warn_once("a goal could not be minded", error)

    def _apply(
        self, handle: GoalHandle, step: Callable[[Any], tuple[Command, ...]], message: Any
    ) -> None:
        goal = handle.goal
        before, shown = goal.state, (goal.state.shown, goal.outcome, goal.end)
        was_accepted, was_in_the_way, was_lost = goal.accepted, _in_the_way(goal), goal.lost
        now = self.traffic.clocks.now()
        commands = step(now)
        if goal.outcome is Outcome.SERVER_UNAVAILABLE and before is State.WAITING_FOR_SERVER:
            goal.reason += self._instead(handle)
        elif goal.outcome is Outcome.SERVER_BUSY and before is State.QUEUED:
            goal.reason += self._in_use(handle)
        newly_gone = goal.lost and not was_lost and goal.end is End.SERVER_GONE
        if newly_gone and handle.look_out_left is None:
            handle.look_out_left = LOOKED_OUT_FOR
        if shown != (goal.state.shown, goal.outcome, goal.end):
            handle.traffic.note(handle)
        if _in_the_way(goal) != was_in_the_way:
            self._tell_who_waits()
        for command in commands:
            self._carry_out(handle, command, message)
        if _is_answered(handle):
            ledger.strike(goal.id)
        elif goal.lost != was_lost and goal.state is not State.DONE and goal.id in ledger:
            self._put_on_record(handle)
        if goal.state is State.DONE:
            self.retire(handle)
        due = goal.due_in(now)
        if due is not None:
            alarm.wake_by(now.steady + due)
        newly = goal.accepted and not was_accepted and goal.state is State.EXECUTING
        if newly and goal.busy is Busy.REPLACE:
            for older in self.traffic.domain.resources.holders(goal.resources):
                if older is handle:
                    break
                older.endpoint.tell(older, Event.REPLACED, goal.server)

    def _carry_out(self, handle: GoalHandle, command: Command, message: Any) -> None:
        goal = handle.goal
        if command is Command.RELEASE:
            for next_one in self.traffic.domain.resources.release(handle):
                next_one.endpoint.tell(next_one, Event.GRANTED)
            return
        try:
            if command is Command.SEND:
                handle.replies.sent(self.watch)
                self._put_on_record(handle)
                self.client.send(goal.id, message)
                known = handle.replies.sent_to
                self.see()
                handle.replies.sent(self.watch)  # who opened since got it, too
                if handle.replies.sent_to != known:
                    self._put_on_record(handle)
            elif command is Command.ASK_RESULT:
                self.client.ask_result(goal.id)
            elif goal.state is State.DONE:  # and nothing is sent after that
                self._send_cancel(goal.id)
            else:
                self.ask_to_cancel(goal.id)
        except Exception as error:  # noqa: BLE001 - the handle's, or TypeError of a wrong message
            if command is Command.SEND:
                self.tell(handle, Event.SEND_FAILED, error)
            else:
                self._warn_once(f"{command.name} could not be sent", error)

    def _put_on_record(self, handle: GoalHandle) -> None:
        goal, sent_to = handle.goal, handle.replies.sent_to
        domain = self.traffic.domain.number
        accept = goal.timeouts.accept
        ledger.enter(goal.id, self.name, domain, sent_to, accept=accept, lost=goal.lost)

    def _tell_who_waits(self) -> None:
        """Wake those of all nodes whose goals a change here may have let go on."""
        for traffic in {
            endpoint.traffic for endpoint in self.neighbors() if endpoint.route.is_waited_for()
        }:
            traffic.notify(None)

    def ask_to_cancel(self, goal_id: bytes) -> None:
        """Ask the server to cancel a goal, as soon as its queue has room."""
        self.cancels.ask(goal_id, self._send_cancel, time.monotonic())

    def _send_cancel(self, goal_id: bytes) -> bool:
        try:
            self.client.cancel(goal_id)
        except Exception as error:  # noqa: BLE001 - the middleware's: any; it is asked again later
            self._warn_once("CANCEL could not be sent", error)
            return False
        return True

    def pump(self) -> None:
        """Take what has arrived, whether or not somebody spins; what fails in it stops nothing."""
        if self.is_parents:
            return
        try:
            self.client.pump()
        except Exception as error:  # noqa: BLE001 - the middleware's: any
            self._warn_once("something that arrived could not be taken", error)
        self.cancels.go_on(time.monotonic())

    def _warn_once(self, what: str, error: Exception) -> None:
        if what not in self._warned_of:
            self._warned_of.add(what)
            log.error(f"{self.name}: {what}: {raised(error)}")

    def retire(self, handle: GoalHandle) -> None:
        """Know nothing of this goal any more, and mind only what is left."""
        goal = handle.goal
        if self.goals.get(goal.id) is handle:  # and not its duplicate
            del self.goals[goal.id]
            self.client.forget(goal.id)
            if goal.end is End.UNKNOWN:
                self.cancels.send_now(goal.id)  # nobody will ask again
            self.cancels.forget(goal.id)
            if goal.sent and goal.state is State.DONE:
                self.past.keep(handle)
        if not self.goals:
            alarm.forget(self)
            self._look_at = 0.0  # no look is due any more, and none will be late
            self.traffic.drop_if_unused(self)

    def _in_use(self, handle: GoalHandle) -> str:
        """Say who has what the goal waited for, where that is not a goal that just runs."""
        for other in self.traffic.domain.resources.holders(handle.goal.resources):
            if other.paused_at is not None and not other.goal.sent:
                return f": it is the turn of {other.name}, whose tree is paused"
            if other.goal.outcome is not None and not other.accounted_for:
                told = other.goal.cancel_said
                return f": goal {other.goal.id.hex()} of {other.name} has not ended there{told}"
        return ""

    def _instead(self, handle: GoalHandle) -> str:
        """Say what is in sight where the action is not: another type, or a name like it."""
        if any(endpoint.conflicts_with(handle) for endpoint in self.neighbors()):
            return ": what it would use still has a goal that was given up, and would run both"
        if self.may_overtake(handle):
            return ": it has not answered another goal's request, and might run that one last"
        node, actions = self.traffic.node, dict[str, str]()
        try:
            for topic, _ in node.get_topic_names_and_types():
                if topic.endswith(FEEDBACK):
                    for info in node.get_publishers_info_by_topic(topic):
                        kind = info.topic_type.removesuffix("_FeedbackMessage")
                        actions[topic.removesuffix(FEEDBACK)] = kind
        except Exception:  # noqa: BLE001 - our node was destroyed
            return ""
        ours, kind = interface_name(self.action_type), actions.get(self.name)
        if kind == ours:
            return ": it is in sight, but was not ready, or has requests enough to answer"
        if kind is not None:
            return f"; there is one of another type or version, {kind}"
        if not actions:
            return "; no action server at all is in sight in this ROS domain"
        if found := elsewhere(self.name, ours, {name: (its,) for name, its in actions.items()}):
            return found
        if of_its_type := sorted(name for name in actions if actions[name] == ours):
            return f"; of its type there is {listing(of_its_type)}"
        return did_you_mean(self.name, actions)

    # The watch over the server

    def open(self, client: ActionClient) -> None:
        """Go on with another client, of which nothing is known yet."""
        self.cancels.forget_answers(self.goals)
        self.client, self.watch = client, ServerWatch()
        self._looked_like = Server.ABSENT
        self._look_at = 0.0
        alarm.wake_by(time.monotonic())

    def close(self) -> None:
        """Let go of the client; answers that are still under way are lost."""
        self.client.destroy()
        self.route.leave()

    def neighbors(self) -> list[ActionEndpoint]:
        """Return the endpoints with goals in our ROS domain, of all nodes of this process."""
        domain = self.traffic.domain
        endpoints = [
            endpoint for endpoint in alarm.minded() if isinstance(endpoint, ActionEndpoint)
        ]
        return [endpoint for endpoint in endpoints if endpoint.traffic.domain is domain]

    def has_lost(self, handle: GoalHandle) -> bool:
        """Whether goals were lost here that `ticket` might run beside."""
        return any(other.goal.lost for other in self._near(handle))

    def conflicts_with(self, handle: GoalHandle) -> bool:
        """Whether a goal that was given up here may still run where `ticket` wants to."""
        same = self.shares_server_with(handle.endpoint)
        return any(other.goal.blocks(handle.goal, same_server=same) for other in self._near(handle))

    def may_overtake(self, handle: GoalHandle) -> bool:
        """Whether the request of a goal that `ticket` replaces, or that replaces it, is under way.

        From two nodes they arrive in any order, and the server runs the last one.
        """
        holders = self.traffic.domain.resources.holders(handle.goal.resources)
        at = holders.index(handle)
        rivals = holders[:at] if handle.goal.busy is Busy.REPLACE else []
        rivals += [other for other in holders[at + 1 :] if other.goal.busy is Busy.REPLACE]
        return any(
            other.goal.unanswered and other.endpoint.shares_server_with(self) for other in rivals
        )

    def may_come_back_for(self, handle: GoalHandle, now: float) -> bool:
        """Whether a goal was lost here whose server may only be shown later than that of `ticket`.

        It shares a resource with `ticket`, and is canceled first where its server is seen in time.
        """
        if handle.goal.busy not in (Busy.WAIT, Busy.FAIL) or self.shares_server_with(
            handle.endpoint
        ):
            return False
        return self.has_lost(handle) and now - handle.endpoint.in_sight_since < BESIDE

    def _near(self, handle: GoalHandle) -> list[GoalHandle]:
        same, wanted = self.shares_server_with(handle.endpoint), handle.goal.resources
        return [t for t in self.goals.values() if same or t.goal.resources & wanted]

    def in_flight(self) -> int:
        """Count the goal requests at the server that wait for their answer, of all nodes."""
        endpoints = [endpoint for endpoint in self.neighbors() if endpoint.shares_server_with(self)]
        return sum(
            handle.goal.in_flight for endpoint in endpoints for handle in endpoint.goals.values()
        )

    def goals_of(self, owner: Any) -> list[GoalHandle]:
        """Return the goals of a leaf that are open here, also what a second server took."""
        with lock:
            return [handle for handle in self.goals.values() if handle.owner is owner]

    def _take_over(self, now: float) -> None:
        """Take lost goals of other nodes whose server is in sight here: it is to cancel them first.

        Each node discovers for itself; theirs may see the server later, or in part, or never again.
        """
        for endpoint in alarm.minded():
            if (
                not isinstance(endpoint, ActionEndpoint)
                or endpoint is self
                or not endpoint.shares_server_with(self)
            ):
                continue
            for handle in list(endpoint.goals.values()):
                if handle.goal.lost and self._sees_more_than(endpoint, handle.replies.sent_to, now):
                    handle.endpoint = self
                    handle.replies.taken_over()
                    self.goals[handle.goal.id] = handle
                    endpoint.retire(handle)
                    alarm.mind(self)

    def _sees_more_than(
        self, endpoint: ActionEndpoint, servers: frozenset[bytes], now: float
    ) -> bool:
        """Whether one of `servers` is here that has gone for `line`, or that it takes for a ghost.

        What both see is left where it is: a ghost would be handed to and fro.
        """
        if not servers & self.watch.gids or self.watch.state(now) is Server.ABSENT:
            return False
        ghost_there = self.watch.all_live(now) and not endpoint.watch.all_live(now)
        return endpoint.orphaned or endpoint.watch.gone(now, servers) or ghost_there

    def shares_server_with(self, other: ActionEndpoint) -> bool:
        """Whether both, which belong to two nodes, mean the same action."""
        same_domain = self.traffic.domain is other.traffic.domain
        return same_domain and self.name == other.name and self.action_type is other.action_type

    def park(self, *, all_of_them: bool = False) -> None:
        """Leave goals that are lost, or hold nothing any more, or all, to whoever comes next."""
        for handle in list(self.goals.values()):
            goal = handle.goal
            if all_of_them or (goal.outcome is not None and not goal.holding):
                self.tell(handle, Event.NODE_CLOSED)
            if goal.lost:
                handle.look_out_left = 0.0  # nobody does from now on
                self.traffic.domain.keep_lost(self.name, self.action_type, handle)
                self.retire(handle)

    def _adopt(self) -> None:
        """Take over what was lost, or left, at this action before, to cancel it first."""
        for handle in self.traffic.domain.take_lost(self.name, self.action_type):
            saw_it = self.traffic.made_at + TOO_NEW < handle.begun_at
            if handle.traffic is not self.traffic and not saw_it:
                first = handle.not_gone_before == NEVER  # a later node need only have discovered
                until = time.monotonic() + (LEASE if first else TOO_NEW)
                handle.not_gone_before = max(handle.not_gone_before, until)
            handle.endpoint, handle.traffic = self, self.traffic
            handle.replies.taken_over()
            self.goals[handle.goal.id] = handle
            alarm.mind(self)

    def _bound_the_lost(self) -> None:
        settled = [
            handle
            for handle in self.goals.values()
            if handle.goal.end in (End.SERVER_GONE, End.NEVER_STARTED)
            and handle.goal.outcome is not None
            and not handle.goal.unconfirmed
        ]
        for handle in settled[:-LOST_KEPT]:
            self.tell(handle, Event.PROCESS_EXITING)
            ledger.strike(handle.goal.id)

    def _observe(self, now: float, *, concludes: bool = True) -> None:
        """Let the watch see what discovery shows; raises where our node is gone."""
        self.watch.observe(
            now, self.client.server_is_ready(), self.route.shown(), concludes=concludes
        )

    def look(self, now: float) -> Server:
        """Observe the server, tell the goals what that means for them, and return its state."""
        if not is_valid(self.traffic.node):
            self._orphan()
            self._look_blindly(now)
            return Server.ABSENT
        self._take_in(now)
        if self.client.closed:  # by what came, and nobody used the endpoint
            return Server.ABSENT
        before = self._looked_like
        try:
            self._observe(now)
        except Exception:  # noqa: BLE001 - InvalidHandle: it was destroyed since
            if not self.route.fall_back():
                self._orphan()
            return Server.ABSENT
        self._adopt()
        self._take_over(now)
        runs = any(handle.goal.sent and not handle.goal.lost for handle in self.goals.values())
        if self.route.wants_question(now) or self.watch.wants_probe(now, runs=runs):
            self.probe()
        for handle in list(self.goals.values()):
            gone = self.watch.gone(now, handle.replies.sent_to)
            if not gone:
                handle.not_gone_before = NEVER  # it has been discovered
            if (gone and now < handle.not_gone_before) or self._is_hidden(handle):
                continue  # it has not been discovered yet, though its status may have come already
            if handle.goal.sent:
                if gone and not handle.goal.lost:
                    self.pump()  # its last words
                self._pass_on(handle, handle.replies.looked(self.watch, now))
        state = self._looked_like = self.watch.state(now)
        if before is Server.ABSENT or self._was_away:
            self.in_sight_since = now
        self._was_away = False
        held_up = (now - self.in_sight_since < BESIDE, self.route.holds_back(now))
        if any(was and not still for was, still in zip(self._held_up, held_up, strict=True)):
            self.traffic.notify(None)  # what was held up for it may be sent
        self._held_up = held_up
        if state is not before:
            self.traffic.notify(None)
            self.traffic.domain.lost_sight |= state is Server.ABSENT
            self.traffic.domain.known.add((self.name, self.action_type))
        self.route.seek(now)
        if state is Server.AMBIGUOUS and not self._warned_crowd:
            self._warned_crowd = True
            log.warning(f"{self.name}: two action servers answer to this name; no more is sent")
        elif state is Server.READY:
            self._warned_crowd = False
        return state

    def _look_out(self, now: float) -> None:
        """Count the time for which servers are looked out for; not that of a stall.

        Nor that after one, in which a server that is there may be out of sight.
        """
        passed = min(now - self._looked_out_at, 2 * LOOK_WHILE_RUNNING)
        self._looked_out_at = now
        if alarm.stalls.servers_take(now) > 0.0:
            return
        for handle in self.goals.values():
            if handle.goal.lost and handle.look_out_left:
                handle.look_out_left = max(0.0, handle.look_out_left - passed)

    def _take_in(self, now: float) -> None:
        """What answers of several came in time count, though nobody spun the node."""
        if self.watch.is_crowded:
            late = self._look_at and now - self._look_at > LATE
            if late or alarm.stalls.answers_take(time.monotonic()):
                self.watch.stood_still(now)
            self.pump()

    def _look_blindly(self, now: float) -> None:
        """Of the servers that were shown when the node went, find out by asking who lives."""
        self._take_in(now)
        if not self.watch.is_crowded or self.client.closed:
            return
        self.watch.observe(now, True, self.watch.gids)
        if self.watch.wants_probe(now):
            self.probe()
        for handle in list(self.goals.values()):
            if handle.goal.sent:
                self._pass_on(handle, handle.replies.looked(self.watch, now))

    def _is_hidden(self, handle: GoalHandle) -> bool:
        """Whether a server of this goal may be out of sight because this process stood still."""
        sent_to, now = handle.replies.sent_to, time.monotonic()
        in_sight = sent_to <= self.watch.gids and not self.watch.gone(now, sent_to)
        return not in_sight and alarm.stalls.servers_take(now) > 0.0

    def probe(self) -> None:
        """Ask the server just in order to be answered."""
        probe = next(_probes)
        self.watch.probe_sent(time.monotonic(), probe)
        self._last_probes.append(probe)
        if len(self._last_probes) > PROBES_KEPT:
            self.client.forget(self._last_probes.popleft())
        ask(self.client, probe)

    def _orphan(self) -> None:
        """Our node is gone, or its context: nobody can want these goals any more."""
        if not self.orphaned:
            self.orphaned, self._heard_at = True, time.monotonic()
            if any(not handle.accounted_for for handle in self.goals.values()):
                log.warning(f"{self.name}: the node is gone; canceling what it left")
        for handle in list(self.goals.values()):  # also one that was begun since
            handle.look_out_left = 0.0  # from here nobody sees it come back
            if handle.goal.outcome is None:
                self.tell(handle, Event.INTERRUPTED)
        patience = max((each.goal.drains_within for each in self.goals.values()), default=0.0)
        silent = time.monotonic() - self._heard_at > max(SILENT_FOR, patience)
        if silent and not alarm.stalls.answers_take(time.monotonic()):
            self.park(all_of_them=True)  # from here nobody can see whether the server is gone

    def attend(self, now: float) -> float:
        """Do what is due here, on the alarm; return the seconds until it wants to again."""
        self._look_out(now)
        if now >= self._look_at:
            self.look(now)
            settling = self.watch.state(now) is Server.SETTLING
            if settling or self.route.is_waited_for():
                self._look_at = now + LOOK_WHILE_WAITING
            elif any(not handle.is_over for handle in self.goals.values()):
                self._look_at = now + LOOK_WHILE_RUNNING
            else:
                self._look_at = now + LOOK_WHILE_LOST
        wait = self._look_at - now
        self.cancels.go_on(now)
        if self.orphaned or self.route.second is not None:
            self.pump()
            if not all(handle.accounted_for for handle in self.goals.values()):
                wait = min(wait, PUMP_EVERY)
        for handle in list(self.goals.values()):
            self.mind(handle)
            due = handle.goal.due_in(self.traffic.clocks.now())
            if due is not None and handle.paused_at is None:
                wait = min(wait, due)
        self._bound_the_lost()
        return max(wait, 0.001)


def _is_answered(handle: GoalHandle) -> bool:
    """Whether it need not be on record any more: whoever got it shows it, or will not run it.

    One that two servers got is accepted by one of them first. And a server that has gone may only
    stand still, for longer than this process is there.
    """
    goal = handle.goal
    shown = goal.accepted and len(handle.replies.sent_to) <= 1
    return shown or (handle.accounted_for and goal.end is not End.SERVER_GONE)


def _in_the_way(goal: Goal) -> tuple[bool, ...]:
    """What of a goal others may wait for: room at its server, or its end."""
    return goal.in_flight, goal.unanswered, goal.outstanding, goal.lost, goal.holding
