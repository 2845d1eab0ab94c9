"""The rules that every history must keep, checked at each step from what is true in the world.

A rule is broken with `Violation`, whose text is the rule. The judge changes nothing, and looks into
no goal's private parts: what it needs of the past it writes down itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bt_actions.goals.facts import PATIENCE
from bt_actions.goals.policy import Busy, End, Outcome
from bt_actions.goals.terms import CANCEL_UNKNOWN_GOAL, ENDS, Command, Event, State
from tests.machine.parts import Before, GoalHandle, Leaf, Ledger

if TYPE_CHECKING:
    from bt_actions.goals.attempts import AttemptRecord
    from tests.machine.production import Caller
    from tests.machine.world import Job, ModelServer

JUST = 1e-6
"""Seconds by which sums of floats may differ."""
_CLAIMS = {
    Outcome.SUCCEEDED: End.SUCCEEDED,
    Outcome.ABORTED: End.ABORTED,
    Outcome.CANCELED_BY_OTHER: End.CANCELED,
}


class Violation(AssertionError):
    """A rule was broken."""


class Judge:
    """Sees every step of a caller."""

    caller: Caller

    def __init__(self) -> None:
        self._violation: Violation | None = None

    def begins(self, handle: GoalHandle) -> None:
        now = self.caller.world.now
        handle.ledger = Ledger(now.steady, now.ros, polled_at=now.steady)

    def sees_clock(self, handle: GoalHandle) -> None:
        """The goal looks at its node's clock."""
        now, ledger = self.caller.world.now, handle.ledger
        if now.ros > ledger.ros:
            ledger.forward += now.ros - ledger.ros
        ledger.ros = now.ros

    def before(self, handle: GoalHandle) -> Before:
        goal = handle.goal
        self.sees_clock(handle)
        return Before(goal.state, goal.outcome, goal.reason, goal.accepted, goal.end)

    def after(
        self,
        handle: GoalHandle,
        before: Before,
        event: Event | None,
        detail: Any,
        commands: tuple[Command, ...],
    ) -> None:
        goal, ledger = handle.goal, handle.ledger
        now = self.caller.world.now
        if goal.state is not before.state:
            if event is None:
                self._not_early(handle, before.state)
            elif event is Event.GRANTED:
                self._in_turn(handle)
            ledger.since = now.steady
        if goal.accepted and not before.accepted:
            ledger.begun_at = ledger.forward
            ledger.heard_at = None if event is Event.STATUS and detail in ENDS else ledger.forward
        if event is Event.FEEDBACK and (ledger.heard_at is not None or ledger.doubted):
            ledger.heard_at = ledger.forward
        if event is Event.STATUS and detail in ENDS:
            ledger.doubted &= ledger.heard_at is None
            ledger.heard_at = None  # a goal that has ended is silent
        elif event is Event.STATUS or (event is None and Command.ASK_RESULT in commands):
            ledger.doubted = True
        if before.outcome is None:
            if event is Event.INTERRUPTED and before.state is not State.DONE:
                ledger.unwanted = True
            if event is Event.REPLACED and before.state is not State.QUEUED:
                ledger.unwanted = True
        if event is Event.REJECTED:
            ledger.refused = True
        ledger.left |= event is Event.PARKED
        if event is Event.ABANDONED and before.state is not State.DONE:
            ledger.closed = True
            ledger.excuse = ledger.excuse or "its run, or the process, ended"
        if event is Event.DRAIN_GAVE_UP and goal.end is End.UNKNOWN and not goal.accepted:
            ledger.excuse = ledger.excuse or "its run ended, and has reported it as UNKNOWN"
        if event is Event.CANCEL_ANSWERED:
            ledger.denied = detail == CANCEL_UNKNOWN_GOAL
        if goal.end is End.NEVER_STARTED is not before.end and event is None:
            self._hold(
                ledger.denied, "it is presumed not received when its server denies it, not sooner"
            )
            ledger.excuse = ledger.excuse or "it was judged never to have started"
        self._commands(handle, before, commands)
        self._outcome(handle, before)
        self._deadlines_are_kept_in_mind(handle)
        if goal.accepted and not before.accepted and before.state is not State.SENDING:
            self._hold(Command.CANCEL in commands, "what turns up unwanted is canceled at once")
        if before.state is State.LOST is not goal.state and goal.state is not State.DONE:
            self._hold(Command.CANCEL in commands, "a lost goal that is back is canceled at once")

    def _commands(self, handle: GoalHandle, before: Before, commands: tuple[Command, ...]) -> None:
        goal, ledger = handle.goal, handle.ledger
        if before.state is State.DONE:
            self._hold(not commands and goal.state is State.DONE, "nothing is sent after DONE")
        for command in commands:
            if command is Command.SEND:
                ledger.sends += 1
                waited = before.state is State.WAITING_FOR_SERVER
                self._hold(
                    waited and goal.claims_resources, "a goal is sent only while it holds resources"
                )
            elif command is Command.RELEASE:
                ledger.releases += 1
                known = goal.end is not End.UNKNOWN or goal.state is State.DONE
                self._hold(known or ledger.left, "the resource is kept until the end is known")
            else:
                self._hold(ledger.sends == 1, "only a goal that was sent is asked about")
                ledger.cancels += command is Command.CANCEL
        self._hold(ledger.sends <= 1, "a goal is sent once")
        self._hold(ledger.releases <= 1, "resources are given back once")
        if goal.state is State.DONE:
            self._hold(ledger.releases == 1, "a goal that is DONE has given its resources back")
            self._hold(goal.outcome is not None, "a goal that is DONE has an outcome")
            self._hold(goal.due_in(self.caller.world.now) is None, "DONE waits for nothing")

    def _outcome(self, handle: GoalHandle, before: Before) -> None:
        goal, ledger = handle.goal, handle.ledger
        if before.outcome is not None:
            same = goal.outcome is before.outcome and goal.reason == before.reason
            self._hold(same, "an outcome is decided once")
            return
        if goal.outcome is None:
            return
        if ledger.unwanted:
            self._hold(goal.outcome is Outcome.CANCELED, "what was given up ends as CANCELED")
        if goal.outcome in (Outcome.ABORTED, Outcome.CANCELED_BY_OTHER):
            self._hold(not self._preempted(handle), "what a newer goal replaced ends as CANCELED")
        if goal.outcome in _CLAIMS:
            true = {job.status for job in ledger.jobs}
            claimed = [status for status, end in ENDS.items() if end is _CLAIMS[goal.outcome]]
            self._hold(claimed[0] in true, f"{goal.outcome} is what the server said")
        if goal.outcome is Outcome.SERVER_LOST and goal.lost:
            in_reach = [
                job
                for job in ledger.jobs
                if job.live and job.server.matched and not job.server.cut
                if self.caller.world.in_sight(job.server, handle.node)
            ]
            self._hold(ledger.crowded or not in_reach, "SERVER_LOST: the server is out of reach")
        if goal.outcome is Outcome.CANCELED_BY_OTHER:
            self._hold(not ledger.cancels, "CANCELED_BY_OTHER is what we did not ask for")
        if goal.outcome is Outcome.REJECTED:
            refused = ledger.refused and not before.accepted
            self._hold(refused, "REJECTED is what the server said, and it had not accepted")

    def _preempted(self, handle: GoalHandle) -> bool:
        """Whether a server has accepted a newer goal in place of this one, in truth."""
        return any(
            newer.goal.busy is Busy.REPLACE
            and int(newer.goal.id) > int(handle.goal.id)
            and newer.goal.state in (State.SENDING, State.EXECUTING, State.REPLACED)
            and newer.goal.resources & handle.goal.resources
            and newer.ledger.jobs
            for newer in self.caller.handles
        )

    def _deadlines_are_kept_in_mind(self, handle: GoalHandle) -> None:
        goal, limits, ledger = handle.goal, handle.goal.timeouts, handle.ledger
        if goal.state is State.DONE or goal.due_in(self.caller.world.now) is not None:
            return
        if goal.lost and ledger.left:
            return  # it waits for nothing, also where it is UNKNOWN
        state = goal.state
        if state is State.QUEUED:
            excused = limits.queue is None
        elif state is State.WAITING_FOR_SERVER:
            excused = limits.server is None
        elif state is State.SENDING:
            excused = limits.accept is None
        elif state is State.REPLACED:
            excused = limits.cancel is None
        elif state is State.EXECUTING:
            excused = limits.result is None and limits.feedback is None
        else:
            settled = goal.outcome is not None and goal.end is not End.UNKNOWN
            excused = settled or (
                goal.may_still_be_accepted and goal.asking.in_vain and not goal.claims_resources
            )
        self._hold(excused, f"no deadline is forgotten ({state.name})")

    def polled(self, handle: GoalHandle) -> None:
        """Check that no deadline has passed without effect."""
        goal, limits, ledger = handle.goal, handle.goal.timeouts, handle.ledger
        now = self.caller.world.now.steady
        ledger.slow = max(ledger.slow, now - ledger.polled_at)
        ledger.polled_at = now
        if goal.outcome is not None:
            return
        here = now - ledger.since
        state = goal.state
        if state is State.QUEUED:
            self._within(here, limits.queue, "queue")
        elif state is State.WAITING_FOR_SERVER:
            self._within(here, limits.server, "server")
        elif state is State.SENDING:
            self._within(here, limits.accept, "accept")
        elif state is State.EXECUTING:
            self._within(ledger.forward - ledger.begun_at, limits.result, "result")
            if ledger.heard_at is not None:
                self._within(ledger.forward - ledger.heard_at, limits.feedback, "feedback")
        elif state in (State.UNWANTED, State.UNCONFIRMED):
            accept = limits.accept or limits.cancel or PATIENCE
            self._within(here - 2 * ledger.slow, accept, "accept")
        elif state is State.CANCELING and limits.cancel is not None:
            accept = limits.accept or limits.cancel or PATIENCE
            self._within(here - 2 * ledger.slow, 2 * accept + limits.cancel, "cancel")

    def _not_early(self, handle: GoalHandle, state: State) -> None:
        """Check that a deadline that took effect had passed."""
        limits, ledger = handle.goal.timeouts, handle.ledger
        here = self.caller.world.now.steady - ledger.since
        if state is State.EXECUTING:
            if handle.goal.state is not State.DONE:
                running = ledger.forward - ledger.begun_at + JUST
                silent = 0.0 if ledger.heard_at is None else ledger.forward - ledger.heard_at + JUST
                passed = (limits.result is not None and running >= limits.result) or (
                    limits.feedback is not None and silent >= limits.feedback
                )
                self._hold(passed, "a running goal is stopped only after its time")
        elif state in (State.QUEUED, State.WAITING_FOR_SERVER, State.SENDING):
            limit = {
                State.QUEUED: limits.queue,
                State.WAITING_FOR_SERVER: limits.server,
                State.SENDING: limits.accept,
            }[state]
            in_time = limit is not None and here + JUST >= limit
            self._hold(in_time, f"no deadline strikes early ({state.name})")

    def _in_turn(self, handle: GoalHandle) -> None:
        """Check that nobody is overtaken in the queue."""
        if handle.goal.busy is not Busy.WAIT:
            return
        for other in self.caller.handles:
            if other is handle:
                return
            if other.goal.state is State.QUEUED:
                overlap = other.goal.resources & handle.goal.resources
                self._hold(not overlap, "first come, first served")

    def nobody_waits_in_vain(self) -> None:
        """Check that who queues has somebody who holds, or waits longer, for the same."""
        wanted: set[str] = set()
        for handle in self.caller.handles:
            if handle.goal.state is not State.QUEUED:
                continue
            names = handle.goal.resources
            why = names & wanted or self.caller.resources.holders(names)
            self._hold(why, f"what is free goes to who waits longest: {handle}")
            wanted |= names
        domain = self.caller.host.domain(0)
        here = [handle for each in domain.open for handle in each.goals.values()]
        left = {handle for handle in here if not handle.goal.claims_resources}
        self._hold(domain.left.keys() == left, "who has given up its resources is known")

    def _within(self, passed: float, limit: float | None, name: str) -> None:
        self._hold(limit is None or passed < limit + JUST, f"timeout.{name} takes effect")

    def interrupted_again(self, handle: GoalHandle) -> None:
        """Interrupt once more and see that nothing changes."""
        goal, now = handle.goal, self.caller.world.now
        before = (self.before(handle), goal.due_in(now))
        commands = goal.on(Event.INTERRUPTED, now)
        same = before == (self.before(handle), goal.due_in(now))
        self._hold(same and not commands, "interrupting twice is interrupting once")

    # Leaves and servers

    def noted(self, leaf: Leaf, handle: GoalHandle, record: AttemptRecord, again: bool) -> None:
        """A leaf has taken note of an outcome."""
        if again and leaf.attempts is not None:
            self._hold(record.end is not End.UNKNOWN, "a retry waits until the end is known")
            self._hold(not handle.ledger.unwanted, "what was given up is not tried again")
            outcomes = leaf.plan.retry.outcomes
            gone = record.end is End.SERVER_GONE and Outcome.SERVER_LOST not in outcomes
            self._hold(not gone, "a goal whose server is gone is tried again only if asked for")
            done = record.end is End.SUCCEEDED and record.outcome is not Outcome.UNEXPECTED_RESULT
            self._hold(not done, "what has succeeded is not done twice")
            in_bounds = len(leaf.attempts.history) < leaf.plan.retry.attempts
            self._hold(in_bounds, "attempts counts all tries")

    def sent(self, handle: GoalHandle, reached: int) -> None:
        """A goal request has left for so many live servers."""
        for other in self.caller.handles:
            if other.goal.lost and self.caller.out_of_sight(other, handle):
                handle.ledger.beside += (other,)
            elif other.endpoint.name == handle.endpoint.name and other.goal.outcome is not None:
                taken_for_dead = other.goal.end is End.SERVER_GONE  # as they answer nothing
                runs = not other.goal.claims_resources and any(
                    job.live
                    and self.caller.world.in_sight(job.server, handle.node)
                    and not (taken_for_dead and job.server.cut)
                    for job in other.ledger.jobs
                )
                excused: str | bool = other.ledger.excuse
                excused = excused or (other.ledger.crowded and len(other.ledger.heard) < 2)
                excused = excused or (other.goal.asking.in_vain and not other.goal.accepted)
                rule = f"{other} was given up, and is canceled before {handle} is sent there"
                self._hold(not runs or excused, rule)
            elif other is not handle and other.endpoint.name == handle.endpoint.name:
                _, newer = sorted((other.goal, handle.goal), key=lambda goal: int(goal.id))
                crosses = other.goal.request_pending and newer.busy is Busy.REPLACE
                crosses = crosses and bool(other.goal.resources & handle.goal.resources)
                self._hold(not crosses, f"{other} is answered before {handle} is sent")
        if reached > 1:
            handle.ledger.crowded = True

    def is_done(self, handle: GoalHandle) -> None:
        """A goal is DONE."""
        world, several = self.caller.world, self._may_be_several(handle)
        if self.caller.closed or len(handle.ledger.heard) < 2 or not several:
            return
        known = [job for job in handle.ledger.jobs if job.server.gid in handle.ledger.heard]
        runs = any(job.live and world.in_sight(job.server, handle.node) for job in known)
        self._hold(not runs, "an end is known when it has ended at all in sight that took it")

    def hears_acceptance(self, handle: GoalHandle, server: ModelServer) -> None:
        """A server's acceptance has been taken in, the first or one more."""
        news, ledger = server.gid not in handle.ledger.heard, handle.ledger
        ledger.heard |= {server.gid}
        runs = any(job.live and job.server is server for job in ledger.jobs)
        several = self._may_be_several(handle)
        if news and runs and handle.goal.state is State.DONE and several:
            minded = ledger.closed or self._is_minded(handle)
            self._hold(minded, "what a second server accepts of a goal that has ended is minded")

    def _is_minded(self, handle: GoalHandle) -> bool:
        """Whether the goal, or its duplicate, has an endpoint, be it that of another node."""
        return any(handle.goal.id in endpoint.goals for endpoint in self.caller.endpoints)

    @staticmethod
    def _may_be_several(handle: GoalHandle) -> bool:
        """Whether more than one is shown: else two acceptances may be those of one."""
        return len(handle.replies.sent_to | handle.endpoint.watch.gids) > 1

    def accepted_on_server(self, job: Job) -> None:
        """A server begins to execute a goal: is it alone on its resources?"""
        handle = self._handle(job)
        handle.ledger.jobs += (job,)
        for other in self.caller.world.jobs:
            if other is job or not other.live or other.goal_id == job.goal_id:
                continue
            rival = self._handle(other)
            if rival.goal.resources & handle.goal.resources:
                older, newer = sorted((rival, handle), key=lambda t: int(t.goal.id))
                asked_for = newer.goal.busy in (Busy.REPLACE, Busy.SHARE) or (
                    older.goal.busy in (Busy.REPLACE, Busy.SHARE)
                )
                excused = any(t.ledger.excuse or t.ledger.crowded for t in (rival, handle))
                excused |= rival in handle.ledger.beside or handle in rival.ledger.beside
                self._hold(asked_for or excused, f"{rival} and {handle} are never live together")

    def _handle(self, job: Job) -> GoalHandle:
        return self.caller.seen[job.goal_id]

    # The end

    def settled(self) -> bool:
        """Whether every goal is DONE, or given up with its end known."""
        open_ones = [each for at in self.caller.endpoints for each in at.goals.values()]
        if any(each.goal.state is State.CANCELING for each in open_ones):
            return False  # also what has turned up at a second server
        return all(
            handle.goal.state is State.DONE
            or (handle.goal.outcome is not None and handle.goal.end is not End.UNKNOWN)
            or (
                handle.goal.may_still_be_accepted
                and handle.goal.asking.in_vain
                and not handle.goal.claims_resources
            )
            for handle in self.caller.handles
        )

    def at_the_end(self) -> None:
        """Compare what is reported with what is true, after every server had its chance."""
        self.insist()
        caller = self.caller
        for handle in caller.handles:
            goal = handle.goal
            done = goal.state is State.DONE or goal.end is not End.UNKNOWN
            done |= (
                goal.may_still_be_accepted and goal.asking.in_vain and not goal.claims_resources
            )  # and reported so
            self._hold(goal.outcome is not None and done, f"every goal ends: {handle} {goal!r}")
            self._hold(
                not goal.claims_resources, f"every resource is given back: {handle} {goal!r}"
            )
            self._the_end_is_true(handle)
        self._hold(len(caller.resources) == 0, "no resource is leaked")

    def _the_end_is_true(self, handle: GoalHandle) -> None:
        goal, ledger = handle.goal, handle.ledger
        closed, jobs = self.caller.closed or ledger.closed, ledger.jobs
        if not closed and not ledger.crowded:
            running = [job for job in jobs if job.live]
            self._hold(not running, f"no goal is left running: {handle} {goal!r}")
        said = f"the end is what the server says: {handle} {goal!r}, {[j.status for j in jobs]}"
        if goal.end in ENDS.values():
            self._hold(any(ENDS.get(job.status) is goal.end for job in jobs), said)
        elif goal.end is End.NEVER_STARTED:
            # Forgotten, or out of reach for good since it turned up: nobody can know better.
            unknowable = all(
                job.goal_id not in job.server.jobs or not job.server.alive for job in jobs
            )
            self._hold(closed or ledger.crowded or unknowable, said)
        elif goal.end is End.SERVER_GONE:
            # Where the answer to the request was lost, too, nothing more can be known.
            unreachable = [not j.server.alive or j.goal_id not in j.server.jobs for j in jobs]
            self._hold(closed or ledger.crowded or all(unreachable), said)
        else:
            forgot = any(job.goal_id not in job.server.jobs for job in jobs)
            dead = any(not job.server.alive for job in jobs)
            asked = goal.may_still_be_accepted and goal.asking.in_vain  # it was never answered
            another = len(handle.replies.sent_to) > 1  # as far as is known, and it denied the goal
            cause = closed or ledger.crowded or forgot or dead or asked or another
            self._hold(cause, f"UNKNOWN with a cause: {said}")

    def insist(self) -> None:
        """Raise what was raised before: traffic/endpoint.py may have caught it, like any error."""
        if self._violation is not None:
            raise self._violation

    def found(self, mistake: str) -> None:
        """Raise what production itself calls a mistake."""
        self._hold(False, mistake)

    def _hold(self, kept: Any, rule: str) -> None:
        if not kept:
            self._violation = self._violation or Violation(rule)
            raise self._violation
