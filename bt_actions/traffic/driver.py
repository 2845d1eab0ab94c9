"""Tells the goals of one endpoint what happens, and does what they decide.

A goal decides at once, whoever tells it something. What follows waits in one queue of its domain
(`Effects`), so nothing is done by recursion. Only a cancel looks again at what is true by then. A
goal request that does not leave is told to the goal. All under the host's lock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import Busy, End, Outcome
from bt_actions.goals.terms import STATUS_SUCCEEDED, Command, Event, Now, State
from bt_actions.servers.replies import Told
from bt_actions.traffic.admission import why_not
from bt_actions.traffic.handle import Effect, Endpoint, GoalHandle, Standing, wake
from bt_actions.traffic.host import Entry, Host
from bt_actions.traffic.watcher import LOOK_WHILE_RUNNING

_UNANSWERED = (Outcome.ACCEPT_TIMEOUT, None)


class Driver:
    """Drives the goals of one endpoint."""

    def __init__(
        self, endpoint: Endpoint, host: Host, failed: Callable[[str, Exception], None]
    ) -> None:
        """`failed` is told what could not be done, which is asked for again later."""
        self._endpoint, self._host, self._failed = endpoint, host, failed
        self._commands: dict[Command, Effect] = {
            Command.RELEASE: self._release,
            Command.SEND: self._send,
            Command.ASK_RESULT: self._ask_result,
            Command.CANCEL: self._cancel,
        }

    # What happens

    def tell(self, handle: GoalHandle, event: Event, detail: Any = None) -> None:
        """Tell a goal what happened and do what it says."""
        with self._host.lock:
            if not self._endpoint.is_parents:
                self._apply(handle, event, self._endpoint.participant.now(), detail)

    def pass_on(self, handle: GoalHandle, told: Told) -> None:
        """Tell a goal what is believed of what was said of it."""
        if told is None:
            return
        event, detail = told
        if event is Event.RESULT and detail[0] != STATUS_SUCCEEDED and self._rival_sent(handle):
            self.tell(handle, Event.REPLACED)  # this has overtaken the rival's acceptance
        self.tell(handle, event, detail)
        if event is Event.SERVER_AMBIGUOUS and detail is not None:  # both have told how it ended
            self.tell(handle, Event.RESULT, detail)

    def _rival_sent(self, handle: GoalHandle) -> bool:
        """Whether a newer goal that replaces this one is on its way, or has arrived."""
        holders = self._endpoint.domain.resources.holders(handle.goal.resources)
        newer = holders[holders.index(handle) + 1 :] if handle in holders else []
        return any(other.goal.busy is Busy.REPLACE and other.goal.sent for other in newer)

    def apply_deadlines(self, handle: GoalHandle) -> None:
        """Let the goal's deadlines take effect, unless its tree is paused before sending.

        What has arrived by now is taken in first: an answer that came in time is in time, though
        the executor was too busy to look. Where this whole process stood still, it may be about to
        arrive. One moment decides whether to do so, and what is due. What fails in it stops
        nothing.
        """
        endpoint = self._endpoint
        with self._host.lock:
            try:
                goal, now = handle.goal, endpoint.participant.now()
                if endpoint.is_parents:
                    return
                self._give_back_time(handle, now.steady)
                if handle.paused:
                    return
                due = goal.due_in(now)
                if due == 0.0:
                    endpoint.deliver_arrived()
                    now = endpoint.participant.now()
                    self._suspend_after_stall(goal, now)
                    due = goal.due_in(now)
                self._host.trace.shows_time(handle)
                for event in goal.due(now):
                    self._apply(handle, event, now)
                if due:
                    self._host.scheduler.wake_by(now.steady + due)
            except Exception as error:  # noqa: BLE001 - a mistake of ours: any
                self._failed("a deadline could not be applied", error)

    def _give_back_time(self, handle: GoalHandle, now: float) -> None:
        """See to it that no deadline counts the time in which a goal is not sent on our account."""
        if handle.held_back_since is not None and not handle.goal.sent:
            handle.goal.deadlines.postpone(now - handle.held_back_since)
        waits = handle.goal.state is State.WAITING_FOR_SERVER
        held_back = handle.paused or (waits and self._endpoint.holds_back(now))
        handle.held_back_since = now if held_back else None

    def _suspend_after_stall(self, goal: Goal, now: Now) -> None:
        """Suspend deadlines that have passed while a stall may be why nothing has come in."""
        stalls, endpoint = self._host.stalls, self._endpoint
        waits = goal.state is State.WAITING_FOR_SERVER
        open_question = endpoint.holds_back if waits else endpoint.in_doubt
        in_doubt = LOOK_WHILE_RUNNING if open_question(now.steady) else 0.0
        servers = stalls.servers_take(now.steady) if waits or goal.lost else 0.0
        goal.deadlines.suspend(max(stalls.answers_take(now.steady), servers, in_doubt), now)

    def _apply(self, handle: GoalHandle, event: Event, now: Now, detail: Any = None) -> None:
        goal, host = handle.goal, self._host
        waited = goal.state in (State.QUEUED, State.WAITING_FOR_SERVER)
        host.trace.tells(handle, event)
        commands = goal.on(event, now, detail)
        host.trace.told(handle, event, detail, commands)
        if waited and goal.outcome in (Outcome.SERVER_UNAVAILABLE, Outcome.SERVER_BUSY):
            goal.reason += why_not(handle)
        elif event is Event.ACCEPT_DUE and (goal.planned, goal.outcome) == _UNANSWERED:
            goal.reason += self._endpoint.participant.unheard()
        if (due := goal.due_in(now)) is not None:
            host.scheduler.wake_by(now.steady + due)
        self._endpoint.domain.effects.run(handle, self._what_follows(handle, commands))

    def _what_follows(self, handle: GoalHandle, commands: Iterable[Command]) -> Iterator[Effect]:
        """Yield what is to be done after a step of a goal, in order."""
        before, now = handle.standing, Standing.of(handle)
        handle.standing = now
        if now.shown != before.shown:
            yield self.note
        for command in commands:
            yield self._commands[command]
        if now.in_the_way != before.in_the_way:
            if not handle.goal.claims_resources and handle.goal.id in self._endpoint.goals:
                self._endpoint.domain.left[handle] = None
            yield self._wake_waiting
        if (now.answered, now.state is State.LOST) != (before.answered, before.state is State.LOST):
            yield self._update_record
        if now.state is not before.state:
            if now.state is State.DONE:
                yield self._endpoint.retire
            elif now.state is State.EXECUTING and handle.goal.busy is Busy.REPLACE:
                yield self._replace

    # What a goal decides

    def _send(self, handle: GoalHandle) -> None:
        """Count who gets it, have it on record, and send the request."""
        endpoint, message = self._endpoint, handle.goal.message
        try:
            handle.replies.sent(endpoint.watch)
            self._put_on_record(handle)
            endpoint.transport.send(handle.goal.id, message)
            known = handle.replies.sent_to
            endpoint.observe()
            handle.replies.sent(endpoint.watch)  # who opened since got it, too
            if handle.replies.sent_to != known:
                self._put_on_record(handle)
        except Exception as error:  # noqa: BLE001 - the handle's, or TypeError of a wrong message
            self.tell(handle, Event.SEND_FAILED, error)

    def _ask_result(self, handle: GoalHandle) -> None:
        self._ask("ASK_RESULT", self._endpoint.transport.ask_result, handle.goal.id)

    def _cancel(self, handle: GoalHandle) -> None:
        if handle.goal.state is State.DONE:  # and nothing is sent after that
            self._send_cancel(handle.goal.id)
        else:
            self.ask_to_cancel(handle.goal.id)

    def ask_to_cancel(self, goal_id: bytes) -> None:
        """Ask the server to cancel a goal, as soon as its queue has room."""
        self._endpoint.cancels.ask(goal_id, self._send_cancel, self._host.steady())

    def _send_cancel(self, goal_id: bytes) -> bool:
        """Ask now; return whether the request has left."""
        return self._ask("CANCEL", self._endpoint.transport.cancel, goal_id)

    def _ask(self, what: str, send: Callable[[bytes], None], goal_id: bytes) -> bool:
        try:
            send(goal_id)
        except Exception as error:  # noqa: BLE001 - the middleware's: any; it is asked again later
            self._failed(f"{what} could not be sent", error)
            return False
        return True

    def _release(self, handle: GoalHandle) -> None:
        for next_one in self._endpoint.domain.resources.release(handle):
            next_one.endpoint.tell(next_one, Event.GRANTED)

    # What follows from it

    def note(self, handle: GoalHandle) -> None:
        """Report a goal's change to the log, and to its run."""
        goal, log = handle.goal, self._host.log
        told, handle.told = handle.told, None if goal.outcome is None else goal.end
        if handle.told is End.UNKNOWN is not told:
            if told is End.SERVER_GONE:
                log.warning(
                    f"{goal!r}: its server is back; canceling it, should it still run there"
                )
            else:
                why = f"{goal.reason}{goal.cancel_said}"
                log.error(f"{goal!r}: not accounted for, it may still be running: {why}")
        elif told is End.UNKNOWN is not handle.told:
            log.info(f"{goal!r}: accounted for at last")
        if handle.begun_in is not None:
            handle.begun_in.tell(handle)
        self._host.notify_all()

    def _wake_waiting(self, handle: GoalHandle) -> None:
        """Wake those of all nodes whose goals may have waited for this one.

        There may be room at its server, or no conflict any more.
        """
        endpoint, resources = self._endpoint, handle.goal.resources
        unsent = endpoint.domain.unsent
        for each in [each for each in unsent if each.goal.sent or each.goal.state is State.DONE]:
            del unsent[each]
        wake(e for e in unsent if e.endpoint.name == endpoint.name or e.goal.resources & resources)

    def _replace(self, handle: GoalHandle) -> None:
        """Tell older goals on its resources that it has taken their place."""
        for older in self._endpoint.domain.resources.holders(handle.goal.resources):
            if older is handle:
                break
            older.endpoint.tell(older, Event.REPLACED, handle.goal.server)

    def _update_record(self, handle: GoalHandle) -> None:
        """Take it off the record, or put on it what more is known of it, if it is there."""
        if handle.standing.answered:
            self._host.record.strike(handle.goal.id)
        elif handle.goal.state is not State.DONE and handle.goal.id in self._host.record:
            self._put_on_record(handle)

    def _put_on_record(self, handle: GoalHandle) -> None:
        goal, endpoint = handle.goal, self._endpoint
        entry = Entry(
            endpoint.name,
            endpoint.participant.domain,
            handle.replies.sent_to,
            goal.timeouts.accept or 0.0,
            goal.lost,
        )
        self._host.record.enter(goal.id, entry)
