"""The words of servers on one goal, and the belief in them.

The problem: an answer does not say which server it is from. Where a second server of the name
opened, or woke up, while the request was on its way, both may have the goal. One server denies,
refuses or ends the goal, and the other may run it. A tree that believed the first word would start
the next motion beside a robot that still moves.

The rule: news that a goal runs is believed at once, because any server can prove it. News that the
goal is over (an end, a refusal, a denial) is believed at once where the request went to one server
alone. Where several receivers may live, such news is withheld until one of three things is true: as
many answers to one question have come as servers are in sight; probes have shown that one server
lives beside dead ones that discovery still shows; or a server has left, and the rest have answered
a question asked after that (`_fresh_since`). Two acceptances, or two ends, mean two servers:
SERVER_AMBIGUOUS.

A server that came after the request can only deny the goal. Such a denial counts for nothing until
probes show that the newcomer is alone; then the goal's own server was restarted (`_denied_at`). A
newcomer that was in sight when the goal's server last spoke has not taken its place (`_beside`).

Why that is enough: each live server answers each question once, and discovery shows every
server that could have received the request, so a full count of answers leaves no server out.

`weigh_...` takes an answer or a look at the server, and returns the event for the goal.
goals/goal.py decides what follows, and presence.py knows who lives. No ROS, no thread, no clock of
its own; nothing is sent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import End
from bt_actions.goals.terms import (
    CANCEL_UNKNOWN_GOAL,
    ENDS,
    NEVER,
    STATUS_EXECUTING,
    STATUS_SUCCEEDED,
    Event,
)
from bt_actions.servers.presence import GID, Server, ServerWatch

Told = tuple[Event, Any] | None
"""The event for the goal, with its detail; None: no event."""
ASK_EVERY = 0.5
"""Seconds between two questions for a goal while another server is in sight."""
DENIALS = (CANCEL_UNKNOWN_GOAL, (0, None))
"""Answers to a cancel request, and to a question for the result, of a server without the goal."""
OVERTAKEN = 1.0
"""Seconds after a newcomer is shown within which an older server's word may be from before."""


class Replies:
    """The belief in the words of servers on one goal.

    `answers` are all answers to one question by now, the newest last, and `asked` is the moment of
    the question (seconds, steady clock).
    """

    def __init__(self, goal: Goal) -> None:
        self.sent_to: frozenset[GID] = frozenset()
        """The servers that were shown when the request went out, and may have taken it."""
        self._goal = goal
        self._was_gone = False
        """Whether none of these was there at the last look."""
        self._refused = False
        self._ended: tuple[int, Any] | None = None
        self._denied_at = math.inf  # the first denial that may be a newcomer's
        self._beside: frozenset[GID] = frozenset()  # newcomers when the goal's server last spoke
        self._asked_at = NEVER
        self._in_sight: frozenset[GID] = frozenset()  # just now
        self._crowd: frozenset[GID] = frozenset()  # just now, while some of them may be dead
        self._one_left_or_came = False  # since the last look
        self._told_of_two = self._runs_anew = False
        self._fresh_since = NEVER
        """An answer to an older question may be from a server that has gone, or that had no goal
        yet."""

    def count_receivers(self, watch: ServerWatch) -> None:
        """Take note of the servers that are shown just before the request goes out, and after."""
        self.sent_to |= watch.gids
        self._in_sight = watch.gids
        if _is_crowded(watch):
            self._crowd = watch.gids

    def taken_over(self) -> None:
        """Take note that another node has the goal now, and has not seen its server yet."""
        self._was_gone = True
        self._one_left_or_came = False
        self._crowd = self._in_sight = frozenset()

    def taken_by_two(self, servers: frozenset[GID], now: float) -> None:
        """Take note that the goal has ended at one of these servers, and runs at another.

        The server at which the goal has ended tells the end again.
        """
        self.sent_to, self._fresh_since = servers, now
        self._told_of_two = self._runs_anew = True

    # The words of the servers

    def weigh_answer(
        self, request: str, watch: ServerWatch, now: float, asked: float, answers: Sequence[Any]
    ) -> Told:
        """Take an answer to a request: "goal", "cancel" or "result"."""
        self._note_changes(watch, now)
        if request == "goal":
            return self._weigh_acceptance(watch, now, answers)
        take = self._weigh_cancel_answer if request == "cancel" else self._weigh_result
        return take(watch, now, asked, answers)

    def _weigh_acceptance(self, watch: ServerWatch, now: float, answers: Sequence[bool]) -> Told:
        """Take an answer to the goal request: accepted or not."""
        accepted = sum(answers)
        if accepted > 1 and len(self.sent_to | watch.gids) == 1:
            return None  # one server accepted twice
        if accepted:
            self._refused = False
            self.spoke(watch, now)
        if accepted > 1:
            self.sent_to |= watch.gids
            watch.two_answered()
            self._fresh_since, self._told_of_two = now, True
            return Event.SERVER_AMBIGUOUS, None
        if answers[-1]:
            if not self._goal.accepted or len(self.sent_to) == 1:
                return Event.ACCEPTED, None
            self._fresh_since = now  # one server runs the goal; this may be the other
            return Event.SERVER_CHANGED, None
        if accepted:
            return None  # one server refuses the goal, and another runs it
        by_some = len(answers) < len(self.sent_to)
        if by_some and self._may_be_at_two(watch):
            self._refused = True
            return None
        if by_some and self._fresh_since > NEVER:
            return Event.SERVER_AMBIGUOUS, None  # the refusal may be that of a server that has gone
        return Event.REJECTED, None

    def _weigh_cancel_answer(
        self, watch: ServerWatch, now: float, asked: float, answers: Sequence[int]
    ) -> Told:
        """Take an answer to a cancel request, a code of action_msgs/srv/CancelGoal."""
        if answers[-1] != CANCEL_UNKNOWN_GOAL:
            self.spoke(watch, now)
            return Event.CANCEL_ANSWERED, answers[-1]
        if any(code != CANCEL_UNKNOWN_GOAL for code in answers):
            return None
        if len(answers) < _answers_wanted(watch):  # a server has not answered yet
            if self._may_be_at_two(watch):
                return None
            if len(self.sent_to) > 1 and asked < self._fresh_since:
                return None
            if watch.changed(self.sent_to) and not watch.gone(now, self.sent_to):
                return self._denied(now)  # the denial may be a newcomer's
        return Event.CANCEL_ANSWERED, CANCEL_UNKNOWN_GOAL

    def _weigh_result(
        self, watch: ServerWatch, now: float, asked: float, answers: Sequence[tuple[int, Any]]
    ) -> Told:
        """Take an answer to a question for the result: status and result; status 0 is a denial."""
        if runs := [answer[0] for answer in answers if answer[0] not in (0, *ENDS)]:
            return Event.STATUS, runs[-1]  # a server not of rclpy answers before the end
        by_each = len(answers) >= _answers_wanted(watch)
        is_fresh = asked >= self._fresh_since
        ended = [answer for answer in answers if answer[0] in ENDS]
        if ended:
            done = ended[-1]
            if not self._runs_anew:  # else the last is most likely that of the second run
                done = next((each for each in ended if each[0] == STATUS_SUCCEEDED), done)
            if len(self.sent_to) > 1:
                if not is_fresh:
                    return None
                if not by_each and self._may_be_at_two(watch):
                    self._ended = done
                    return None
            if len(ended) > 1 and not self._told_of_two:  # both servers ran the goal
                watch.two_answered()
                return Event.SERVER_AMBIGUOUS, done
            return Event.RESULT, done
        if watch.changed(self.sent_to) and not (by_each and is_fresh):
            return self._denied(now)
        by_all = by_each or watch.state(now) is Server.READY
        return (Event.RESULT_UNKNOWN, None) if by_all and is_fresh else None

    def weigh_status(self, watch: ServerWatch, now: float, status: int) -> Told:
        """Take the status that one server publishes of the goal."""
        self.spoke(watch, now)
        self._note_changes(watch, now)
        doubtful = self._may_be_at_two(watch) or self._fresh_since > NEVER
        if status in ENDS and len(self.sent_to) > 1 and doubtful:
            status = STATUS_EXECUTING  # one server ended the goal; only the acceptance is sure
        return Event.STATUS, status

    # Discovery

    def weigh_sight(self, watch: ServerWatch, now: float) -> Told:
        """Take what discovery shows now."""
        goal, name = self._goal, self._goal.server
        gone = watch.gone(now, self.sent_to)
        is_there = not gone and watch.state(now) is not Server.ABSENT
        returned = self._was_gone and is_there
        self._was_gone = gone or (self._was_gone and not is_there)
        self._note_changes(watch, now)
        others_now, self._one_left_or_came = self._one_left_or_came, False
        if goal.lost:
            none_dead = watch.all_live(now) or not watch.changed(self.sent_to)
            if returned or (is_there and none_dead and goal.end is not End.UNKNOWN):
                self._forget(now)
                return Event.SERVER_RETURNED, None
            if gone and goal.end is End.UNKNOWN:  # the goal was left, not lost
                return Event.SERVER_LOST, f"{name} is gone"
            return None
        if gone:
            how = "was restarted" if watch.gids else "went away"
            return Event.SERVER_LOST, f"{name} {how} under the goal"
        if others_now:  # an earlier word may be that of a server that left: ask anew
            refused = self._refused
            self._forget(now)
            return Event.SERVER_AMBIGUOUS if refused else Event.SERVER_CHANGED, None
        if self._may_be_at_two(watch):
            if not watch.both_live or self._told_of_two:
                return None
            self._told_of_two = True
            return Event.SERVER_AMBIGUOUS, None
        if self._ended is not None:
            return Event.RESULT, self._ended
        if self._refused:
            return Event.REJECTED, None
        if not watch.changed(self.sent_to | self._beside):
            self._denied_at = math.inf
        elif watch.state(now) is Server.AMBIGUOUS:
            pass
        elif watch.alone_since(now, self._denied_at):
            return Event.SERVER_LOST, f"{name} was restarted under the goal"
        elif goal.accepted and now - self._asked_at > ASK_EVERY:
            self._asked_at = now
            return Event.SERVER_CHANGED, None
        return None

    def _note_changes(self, watch: ServerWatch, now: float) -> None:
        """Note which servers left, so that their words are old, and which came back unasked."""
        crowd = watch.gids if _is_crowded(watch) else frozenset[GID]()
        left, came = self._crowd - watch.gids, (watch.gids - self._in_sight) & self.sent_to
        if left or (came and len(self.sent_to) > 1):
            self._fresh_since, self._one_left_or_came = now, True
        self._crowd, self._in_sight = crowd, watch.gids

    def spoke(self, watch: ServerWatch, now: float) -> None:
        """Take note that one receiver of the request lives: no newcomer has taken its place.

        A word from just after a newcomer came may be older than the newcomer, and proves nothing.
        """
        if now - watch.crowded_since >= OVERTAKEN:
            self._beside = watch.gids - self.sent_to
        if len(self.sent_to) == 1:
            self._denied_at = math.inf

    def _denied(self, now: float) -> Told:
        """Take note of a denial by one of several servers; `weigh_sight` finds out its meaning."""
        self._denied_at = min(now, self._denied_at)
        return None

    def _forget(self, now: float) -> None:
        self._fresh_since = now
        self._ended, self._refused, self._denied_at = None, False, math.inf

    def _may_be_at_two(self, watch: ServerWatch) -> bool:
        """Return whether two receivers of the request are there, as far as is known."""
        return _is_crowded(watch) and len(self.sent_to & watch.gids) > 1


def _answers_wanted(watch: ServerWatch) -> int:
    """Return the number of answers with which all servers in sight have answered, newcomers, too.

    Two where one is in sight: of two that were asked, one has gone since.
    """
    return max(2, len(watch.gids))


def _is_crowded(watch: ServerWatch) -> bool:
    return watch.is_crowded and not watch.alone
