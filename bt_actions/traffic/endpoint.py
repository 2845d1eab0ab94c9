"""One action as one node sees it: the shared transport, and the goals on it.

Takes what the servers say, tells the goals, and does what they say. It decides nothing about a goal
(goals/goal.py), about who is alive (servers/presence.py), about what is believed
(servers/replies.py), about goals that have ended (ended.py), nor whether one may be sent
(admission.py). All under the host's lock.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable
from typing import Any

from bt_actions.goals.policy import End
from bt_actions.goals.terms import STATUS_SUCCEEDED, Event, State
from bt_actions.servers.presence import PROBES_KEPT, ServerWatch
from bt_actions.servers.replies import DENIALS
from bt_actions.traffic.driver import Driver
from bt_actions.traffic.ended import EndedGoals
from bt_actions.traffic.handle import Action, GoalHandle, wake
from bt_actions.traffic.host import Host
from bt_actions.traffic.predecessors import warn_of_dead
from bt_actions.traffic.route import Route
from bt_actions.traffic.transport import ActionTransport, Participant, Request, nobodys, probe
from bt_actions.traffic.watcher import Watcher
from bt_actions.utilities.plain_text import raised


class ActionEndpoint:
    """One action as one node sees it: the shared transport, and the goals on it.

    `tell` tells one goal what happened; `apply_deadlines` what time it is. `observe` reads
    discovery, `observe_and_tell` tells the goals what that means. `deliver_arrived` takes messages
    though nobody spins, `probe` asks a server for a sign of life. `run_due` does all of that, as
    far as it is due, where nobody ticks.
    """

    def __init__(
        self,
        host: Host,
        participant: Participant,
        unused: Callable[[ActionEndpoint], None],
        action: Action,
    ) -> None:
        """`unused` is told when there may be neither a user nor an open goal any more."""
        self._host = host
        self.participant, self._unused = participant, unused
        self.domain = host.domain(participant.domain)
        self.action, self.name = action, action[1]
        self.users = 0
        self._forks = host.forks
        self.goals: dict[bytes, GoalHandle] = {}
        self.watch = ServerWatch()
        self.cancels = self.domain.cancels[action]
        self.orphaned = False
        self.heard_at = host.steady()
        self._probes = itertools.count(PROBES_KEPT)
        self._warned_of: set[str] = set()
        self._left_by_dead: set[bytes] = set()
        self._ended = EndedGoals(self, host)
        self.transport = participant.open_transport(*action, self)
        self._former: dict[ActionTransport, list[GoalHandle]] = {}
        """Transports that were replaced, and the goals whose request was under way there."""
        route = Route(self, host)
        self.in_doubt, self.holds_back = route.in_doubt, route.holds_back
        self.watcher = watcher = Watcher(self, host, route)
        self.observe, self.observe_and_tell = watcher.observe, watcher.observe_and_tell
        self.recent_state, self.run_due = watcher.recent_state, watcher.run_due
        self.driver = driver = Driver(self, host, self._warn_once)
        self.tell, self.pass_on = driver.tell, driver.pass_on
        self.apply_deadlines, self.ask_to_cancel = driver.apply_deadlines, driver.ask_to_cancel

    def __repr__(self) -> str:
        return f"<ActionEndpoint {self.name}, {len(self.goals)} goals>"

    # What the server says (transport.Listener)

    def answered(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        """Pass on an answer about a goal; see to one that has ended, and may run again."""
        if self.is_parents:
            return
        now = self.watch.heard_at = self._host.steady()
        if request == "cancel":
            self.cancels.answered(goal_id, now)
        handle = self._heard_of(goal_id, denies=answers[-1] in DENIALS)
        if handle is not None:
            self.pass_on(handle, handle.replies.answered(request, self.watch, now, asked, answers))
        elif self.watch.probe_answered(now, goal_id):
            wake(self.handles)
        else:
            self._ended.answered(request, goal_id, asked, answers)

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        """Pass on feedback of a goal of ours."""
        handle = self.goals.get(goal_id)
        if handle is None:
            self._ended.runs(goal_id)
            return
        now = self.heard_at = self.watch.heard_at = self._host.steady()
        handle.replies.spoke(self.watch, now)
        self.tell(handle, Event.FEEDBACK, feedback)
        if handle.keeps_feedback and handle.goal.outcome is None:
            handle.feedback.append(feedback)
            wake([handle])

    def statuses_came(self, statuses: dict[bytes, int]) -> None:
        """Pass on the statuses of our goals: each proves that the server has accepted the goal."""
        running = []
        for goal_id, status in statuses.items():
            if goal_id not in self.goals:  # nearly all, of a server that keeps what has ended
                if 0 < status < STATUS_SUCCEEDED:
                    self._ended.runs(goal_id)
                    running.append(goal_id)
            elif status > 0 and (handle := self._heard_of(goal_id)) is not None:
                now = self.watch.heard_at = self._host.steady()
                self.pass_on(handle, handle.replies.shown(self.watch, now, status))
        warn_of_dead(self.name, running, self._left_by_dead, self._host.log)

    def all_delivered(self) -> None:
        """Let go of the transport, if it was kept for what has just been delivered."""
        self._unused(self)

    def _heard_of(self, goal_id: bytes, *, denies: bool = False) -> GoalHandle | None:
        """Return the goal that an answer is about; of one of several it counts who is in sight.

        One that denies it may be the word of another server than the goal's.
        """
        handle = self.goals.get(goal_id)
        if handle is not None:
            if not (denies and self.watch.changed(handle.replies.sent_to)):
                self.heard_at = self._host.steady()
            if len(handle.replies.sent_to) > 1:
                self.observe()
        return handle

    # What the goals want

    @property
    def is_parents(self) -> bool:
        """Whether this was made before a fork, and we are the child: the goals are not ours."""
        return self._forks != self._host.forks

    @property
    def handles(self) -> list[GoalHandle]:
        """Those of the goals that are here now."""
        return list(self.goals.values())

    @property
    def has_unsent(self) -> bool:
        """Whether a goal is still to be sent."""
        return any(not handle.goal.sent for handle in self.handles)

    def probe(self) -> None:
        """Ask the server just in order to be answered."""
        number, now = next(self._probes), self._host.steady()
        self.watch.probe_sent(now, nobodys(number))
        self.transport.forget(nobodys(number - PROBES_KEPT))
        with contextlib.suppress(Exception):  # the next look finds out why it cannot be sent
            probe(self.transport, number, now)

    def deliver_arrived(self) -> None:
        """Take what has arrived, whether or not somebody spins; what fails in it stops nothing."""
        if self.is_parents:
            return
        try:
            for transport in (self.transport, *self._former):
                transport.deliver_arrived()
        except Exception as error:  # noqa: BLE001 - the middleware's: any
            self._warn_once("something that arrived could not be taken", error)
        self.cancels.send_more(self._host.steady())

    def _warn_once(self, what: str, error: Exception) -> None:
        if what not in self._warned_of:
            self._warned_of.add(what)
            self._host.log.error(f"{self.name}: {what}: {raised(error)}")

    # Which goals are here, and how the server is reached

    def take_in(self, handle: GoalHandle) -> None:
        """See to this goal from now on; it may have been another's."""
        if handle.endpoint is not self:
            handle.endpoint = self
            handle.replies.taken_over()
        self.goals[handle.goal.id] = handle
        if not handle.goal.claims_resources:
            self.domain.left[handle] = None
        self.domain.open[self] = None
        if not handle.goal.sent:
            self.domain.unsent[handle] = None
        self._host.scheduler.add(self)

    def retire(self, handle: GoalHandle) -> None:
        """See to this goal no more; without any goal, to the server neither."""
        goal = handle.goal
        if self.goals.get(goal.id) is handle:  # and not what has turned up again
            del self.goals[goal.id]
            if handle.endpoint is self:  # and not another's by now
                self.domain.left.pop(handle, None)
            self.transport.forget(goal.id)
            if goal.end is End.UNKNOWN:
                self.cancels.send_now(goal.id)  # nobody will ask again
            self.cancels.forget(goal.id)
            if goal.sent and goal.state is State.DONE:
                self._ended.keep(handle)
        self._close_former()
        if not self.goals:
            self.domain.open.pop(self, None)
            self._host.scheduler.remove(self)
            self.watcher.rest()
            self._unused(self)

    def replace_transport(self, transport: ActionTransport) -> None:
        """Use another transport, of which nothing is known yet.

        The old one stays open for the goal requests that are under way: on a link that loses them
        the middleware sends them again, as long as their sender is there.
        """
        self.transport.beside_another = True
        self._former[self.transport] = [each for each in self.handles if each.goal.request_pending]
        self._close_former()
        self.transport, self.watch = transport, ServerWatch()
        self.watcher.begin_anew()
        self._host.scheduler.wake_by(self._host.steady())

    def _close_former(self) -> None:
        for transport, sent in list(self._former.items()):
            if not any(handle.goal.request_pending for handle in sent):
                del self._former[transport]
                transport.close()
