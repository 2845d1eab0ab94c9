"""The calls from outside to an endpoint: answers come, and time passes.

servers/replies.py weighs the answer of a server, and driver.py tells the answer to the goal. This
file decides nothing: goals/goal.py decides about goals, servers/presence.py about living servers,
admission.py about sending. The caller holds the host's lock.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from bt_actions.goals.asking import ASK_AGAIN
from bt_actions.goals.goal import Goal
from bt_actions.goals.terms import CANCEL_ACCEPTED, CANCEL_REJECTED, STATUS_SUCCEEDED, Event
from bt_actions.servers.replies import DENIALS
from bt_actions.traffic import cancel_queue, route, watcher
from bt_actions.traffic.driver import apply_deadlines, close_if_unused, take_in, tell, tell_believed
from bt_actions.traffic.state import Ended, Endpoint, GoalHandle, Log, wake
from bt_actions.traffic.transport import Request
from bt_actions.utilities.ids import author_of

DELIVER_EVERY = 0.01
"""Seconds between two takes of answers, where nobody spins."""
TOLD_AT_MOST = 10
"""Goals of one action that the log names; a sender of more left them in the same way."""


class ActionEndpoint(Endpoint):
    """An endpoint with the methods that its transport and the scheduler call."""

    def __repr__(self) -> str:
        return f"<ActionEndpoint {self.name}, {len(self.goals)} goals>"

    # Words of the server, for the transport

    def answer_came(
        self, request: Request, goal_id: bytes, asked: float, answers: tuple[Any, ...]
    ) -> None:
        """Weigh an answer and tell the goal; answers for other ids are a probe's, or late."""
        if self.is_parents:
            return
        now = self.watch.heard_at = self.host.steady()
        if request == "cancel":
            cancel_queue.make_room(self, goal_id, now)
        handle = self._heard_of(goal_id, denies=answers[-1] in DENIALS)
        if handle is not None:
            told = handle.replies.weigh_answer(request, self.watch, now, asked, answers)
            tell_believed(handle, told)
        elif self.watch.probe_answered(now, goal_id):
            wake(self.handles)
        else:
            _ended_answered(self, request, goal_id, asked, answers)

    def feedback_came(self, goal_id: bytes, feedback: Any) -> None:
        """Tell a goal of ours its feedback, and keep that for the leaf."""
        handle = self.goals.get(goal_id)
        if handle is None:
            _ended_runs(self, goal_id)
            return
        now = self.heard_at = self.watch.heard_at = self.host.steady()
        handle.replies.spoke(self.watch, now)
        tell(handle, Event.FEEDBACK, feedback)
        if handle.run is not None:
            handle.run.feedback(handle, feedback)
        if handle.keeps_feedback and handle.goal.outcome is None:
            handle.feedback.append(feedback)
            wake([handle])

    def statuses_came(self, statuses: dict[bytes, int]) -> None:
        """Tell our goals their statuses: each proves that the server has accepted the goal."""
        running = []
        for goal_id, status in statuses.items():
            if goal_id not in self.goals:  # nearly all, at a server that keeps ended goals
                if 0 < status < STATUS_SUCCEEDED:
                    _ended_runs(self, goal_id)
                    running.append(goal_id)
            elif status > 0 and (handle := self._heard_of(goal_id)) is not None:
                now = self.watch.heard_at = self.host.steady()
                tell_believed(handle, handle.replies.weigh_status(self.watch, now, status))
        warn_of_dead(self.name, running, self.left_by_dead, self.host.log)

    def all_delivered(self) -> None:
        """Close the transport, if a delivery that is over now was all that kept it."""
        close_if_unused(self)

    def _heard_of(self, goal_id: bytes, *, denies: bool = False) -> GoalHandle | None:
        """Return the goal of an answer, and look who is in sight where several servers may have it.

        A denial may be the word of another server than the goal's, and is then no sign of life.
        """
        handle = self.goals.get(goal_id)
        if handle is not None:
            if not (denies and self.watch.changed(handle.replies.sent_to)):
                self.heard_at = self.host.steady()
            if len(handle.replies.sent_to) > 1:
                route.glance(self)
        return handle

    # Passing time, for the scheduler

    def run_due(self, now: float) -> float:
        """Look, send and apply deadlines as far as due; return the seconds until more is due."""
        if not self.goals:
            return watcher.look_early(self, now)
        wait = watcher.look_if_due(self, now)
        cancel_queue.send_more(self, now)
        if self.orphaned or self.elsewhere:
            route.deliver_arrived(self)
            if not all(handle.accounted_for for handle in self.handles):
                wait = min(wait, DELIVER_EVERY)
        for handle in self.handles:
            apply_deadlines(handle)
        return wait


# An ended goal may turn up at a second server of the name, which took the request, too, and is
# canceled there. But an answer may also be older than the goal's end. A cancel request tells the
# two cases apart: a server that has ended a goal neither agrees to cancel it nor refuses.


def _ended_answered(
    endpoint: Endpoint, request: Request, goal_id: bytes, asked: float, answers: Sequence[Any]
) -> None:
    """Take an answer for an ended goal: a late acceptance, a doubled one, or a second server's."""
    ended = endpoint.ended.get(goal_id)
    if ended is None:
        return
    if request == "cancel":
        if asked > ended.since and answers[-1] in (CANCEL_ACCEPTED, CANCEL_REJECTED):
            _turns_up(endpoint, goal_id, ended)
    elif request == "goal" and answers[-1]:
        is_news = not ended.accepted and sum(answers) == 1
        if is_news or _may_be_several(endpoint, ended):
            _turns_up(endpoint, goal_id, ended)
        elif sum(answers) > 1:  # one server accepted twice, or the second is not shown yet
            _try_to_cancel(endpoint, goal_id, ended)


def _ended_runs(endpoint: Endpoint, goal_id: bytes) -> None:
    """Take feedback, or a status, that shows an ended goal running: ask by canceling."""
    ended = endpoint.ended.get(goal_id)
    if ended is not None and _may_be_several(endpoint, ended):
        _try_to_cancel(endpoint, goal_id, ended)


def _try_to_cancel(endpoint: Endpoint, goal_id: bytes, ended: Ended) -> None:
    now = endpoint.host.steady()
    if now - ended.asked_at >= ASK_AGAIN:
        ended.asked_at = now
        cancel_queue.ask_to_cancel(endpoint, goal_id)


def _may_be_several(endpoint: Endpoint, ended: Ended) -> bool:
    route.glance(endpoint)
    return len(ended.servers | endpoint.watch.gids) > 1


def _turns_up(endpoint: Endpoint, goal_id: bytes, ended: Ended) -> None:
    """Cancel an ended goal that a second server runs, and account for it like for any goal."""
    del endpoint.ended[goal_id]
    goal = Goal(
        goal_id, endpoint.name, ended.timeouts, endpoint.participant.now(),
        resources=ended.resources, busy=ended.busy,
    )  # fmt: skip
    goal.turns_up_again()
    owner = None if ended.owner is None else ended.owner()
    handle = GoalHandle(goal, endpoint, owner, ended.name, ended.run, ended.attempt)
    endpoint.watch.two_answered()
    handle.replies.taken_by_two(ended.servers | endpoint.watch.gids, endpoint.host.steady())
    take_in(endpoint, handle)
    tell(handle, Event.SERVER_RETURNED)


def warn_of_dead(action: str, running: Collection[bytes], told: set[bytes], log: Log) -> None:
    """Name the goals of dead processes among the ids that a status shows as running.

    A process that is killed cancels nothing. This warning cancels nothing either: `bt-actions
    cleanup` does that (recovery/sweep.py), when a user wants it. `told` are the goals that were
    named before.
    """
    if len(told) >= TOLD_AT_MOST:
        return
    authors = {each: author_of(each) for each in running if each not in told}
    dead = {each for each in {*authors.values()} if each and not each.alive}  # reads a file
    for goal_id, author in authors.items():
        if author in dead and len(told) < TOLD_AT_MOST:
            told.add(goal_id)
            log.warning(
                f"{action}: a goal of process {author.pid}, which is dead, still runs "
                f"there; `bt-actions cleanup` cancels it: {goal_id.hex()}"
            )
