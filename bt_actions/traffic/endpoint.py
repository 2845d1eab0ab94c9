"""What the world calls of an endpoint: answers come, time passes, another participant looks.

It takes what servers say, has it weighed (servers/replies.py) and tells the goal (driver.py). It
decides nothing about a goal, about who is alive (servers/presence.py), nor whether a goal may be
sent (admission.py). All under the host's lock.
"""

from __future__ import annotations

import contextlib
from typing import Any

from bt_actions.goals.terms import NEVER, STATUS_SUCCEEDED, Event
from bt_actions.servers.presence import LEASE
from bt_actions.servers.reachability import TWICE
from bt_actions.servers.replies import DENIALS
from bt_actions.servers.stalls import ANSWERS_TAKE
from bt_actions.traffic import cancel_queue, ended, route, watcher
from bt_actions.traffic.driver import close_if_unused, tell, tell_believed
from bt_actions.traffic.predecessors import warn_of_dead
from bt_actions.traffic.state import Endpoint, GoalHandle, wake
from bt_actions.traffic.transport import ActionTransport, Opener, Request, send_probe

LAST_WORD = 0.5
"""Seconds within which a server that is not busy answers."""
ON_TRIAL = 0
"""The number of a trial's probe, of which nobody is told."""


class ActionEndpoint(Endpoint):
    """An endpoint, with what its transport, the scheduler and rediscovery call."""

    def __repr__(self) -> str:
        return f"<ActionEndpoint {self.name}, {len(self.goals)} goals>"

    # What the server says (transport.Listener)

    def answered(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        """Pass on an answer about a goal; see to one that has ended, and may run again."""
        if self.is_parents:
            return
        now = self.watch.heard_at = self.host.steady()
        if request == "cancel":
            cancel_queue.make_room(self.cancels, goal_id, now)
        handle = self._heard_of(goal_id, denies=answers[-1] in DENIALS)
        if handle is not None:
            told = handle.replies.answered(request, self.watch, now, asked, answers)
            tell_believed(handle, told)
        elif self.watch.probe_answered(now, goal_id):
            wake(self.handles)
        else:
            ended.take_answer(self, request, goal_id, asked, answers)

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        """Pass on feedback of a goal of ours."""
        handle = self.goals.get(goal_id)
        if handle is None:
            ended.take_sign_of_life(self, goal_id)
            return
        now = self.heard_at = self.watch.heard_at = self.host.steady()
        handle.replies.spoke(self.watch, now)
        tell(handle, Event.FEEDBACK, feedback)
        if handle.keeps_feedback and handle.goal.outcome is None:
            handle.feedback.append(feedback)
            wake([handle])

    def statuses_came(self, statuses: dict[bytes, int]) -> None:
        """Pass on the statuses of our goals: each proves that the server has accepted the goal."""
        running = []
        for goal_id, status in statuses.items():
            if goal_id not in self.goals:  # nearly all, of a server that keeps what has ended
                if 0 < status < STATUS_SUCCEEDED:
                    ended.take_sign_of_life(self, goal_id)
                    running.append(goal_id)
            elif status > 0 and (handle := self._heard_of(goal_id)) is not None:
                now = self.watch.heard_at = self.host.steady()
                tell_believed(handle, handle.replies.shown(self.watch, now, status))
        warn_of_dead(self.name, running, self.left_by_dead, self.host.log)

    def all_delivered(self) -> None:
        """Let go of the transport, if it was kept for what has just been delivered."""
        close_if_unused(self)

    def _heard_of(self, goal_id: bytes, *, denies: bool = False) -> GoalHandle | None:
        """Return the goal that an answer is about; of one of several it counts who is in sight.

        One that denies it may be the word of another server than the goal's.
        """
        handle = self.goals.get(goal_id)
        if handle is not None:
            if not (denies and self.watch.changed(handle.replies.sent_to)):
                self.heard_at = self.host.steady()
            if len(handle.replies.sent_to) > 1:
                route.glance(self)
        return handle

    # Time passes (scheduler.Scheduled)

    def run_due(self, now: float) -> float:
        """Look, send and apply deadlines as far as due; return the seconds until there is more."""
        return watcher.run_due(self, now)

    # Another participant looks (transport.Seeker)

    def misses(self) -> bool:
        """Whether a server is wanted, and is not in sight, or does not answer, by now."""
        return route.misses(self)

    def try_in(self, participant: Opener) -> ActionTransport:
        """Return a transport like our own in another participant, on trial."""
        now = self.host.steady()
        transport = participant.open_transport(*self.action, self)
        transport.on_trial = True
        if not route.is_absent(self, now):
            self.transport.reachability.tried(now)
            transport.reachability.doubt(now, TWICE)
            self.compared_at = NEVER
        return transport

    def try_and_compare(self, transport: ActionTransport) -> bool:
        """Ask in this one, which is ready; whether it is heard where our own is not, or sees more.

        A server that answers nobody is busy; one that has just answered this one would answer our
        own as well, if it heard it.
        """
        now = self.host.steady()
        if route.is_absent(self, now):
            return True
        if not route.is_unresponsive(self, now):
            return False
        transport.deliver_arrived()
        if not transport.reachability.heard:
            if transport.reachability.take_question(now):
                with contextlib.suppress(Exception):
                    send_probe(transport, ON_TRIAL, now)
            return False
        if self.compared_at == NEVER:
            self.compared_at = now
            route.probe(self)
        return now - self.compared_at >= LAST_WORD

    def move_to(self, transport: ActionTransport) -> None:
        """Use a transport in a participant that sees the server; nobody spins that.

        What is under way in the old one is not heard there. A question for a result, or a cancel,
        is asked anew; of a goal request nobody knows whether it has arrived.
        """
        now, log = self.host.steady(), self.host.log
        blind, seen = route.is_absent(self, now), self.watch.gids
        route.deliver_arrived(self)
        if self.transport.closed:  # by what came, and nobody used the endpoint
            transport.close()
            return
        transport.on_trial = False
        self.elsewhere = True
        route.replace_transport(self, transport)
        if blind:
            log.info(f"{self.name}: out of sight of this node though it runs; a new one sees it")
            return
        log.info(f"{self.name}: does not hear this node any more; a new one is heard")
        for handle in self.handles:
            if handle.replies.sent_to & seen:  # it may be shown later than another of its name
                handle.not_gone_before = max(handle.not_gone_before, now + LEASE)
            handle.goal.deadlines.suspend(ANSWERS_TAKE, self.participant.now())
            tell(handle, Event.SERVER_CHANGED)
