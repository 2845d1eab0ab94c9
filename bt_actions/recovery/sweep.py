"""The sweep finds the goals that killed bt_actions processes left on servers, and cancels them.

A process that dies by SIGKILL cancels no goal. The sweep reads the status topics of all actions in
sight, knows the goals of dead processes by their ids (ids.py), and cancels them one by one. The
sweep never touches goals of other clients, of living processes, or of processes that this machine
cannot see. The sweep needs no action type. A server that has answered for long enough has no
further goal to tell (roll_call.py).

No status shows a goal that its server has not accepted yet. Such a goal is on its sender's record
(ledger.py). The sweep waits until a server shows the goal, or until no server can have it any more,
and asks the server again and again to cancel the goal.
"""

from __future__ import annotations

import time
import uuid
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bt_actions.goals.asking import DENIED_FOR_GOOD
from bt_actions.goals.policy import End
from bt_actions.goals.terms import CANCEL_TERMINATED, CANCEL_UNKNOWN_GOAL, ENDS, NEVER
from bt_actions.recovery.ledger import Sent, left_behind
from bt_actions.recovery.roll_call import ASK_AGAIN, GONE, SETTLE, LeftBehind, RollCall
from bt_actions.ros.onlooker import ActionView, CannotStart, Onlooker, onlooker
from bt_actions.traffic.stalls import Stalls
from bt_actions.utilities.ids import Author, author_of

TURN = 0.1
"""Seconds between two turns: arrived messages, the graph, and the authors' lives are looked at."""
LOOK_LONGEST = 30.0
"""Seconds for which servers may take to answer, in all: a dead server is shown for 20."""
AWAIT_LONGER = 2 * SETTLE
"""Seconds, at most, by which a goal is awaited longer than servers are looked for and deny it."""
LOOK_AGAIN = 10.0
"""Seconds, at most, after which a participant without answers gives way to another."""
CANCELS_A_TURN = 5
"""Cancels of one action in a turn: a server keeps its last ten requests only."""


@dataclass(frozen=True, slots=True)
class Swept:
    """The goals that a cleanup has seen."""

    left: list[LeftBehind]
    known: list[str]
    """The actions whose servers have all told their goals."""
    unknown: dict[str, str]
    """The other actions that were asked, each with the reason; its name belongs in the braces."""
    domain: int
    """The ROS domain in force."""
    trouble: OSError | None
    """The reason why the records cannot be read."""
    missing: list[str]
    """The goals of `unknown` that were looked for in vain."""
    elsewhere: dict[bytes, str]
    """Unfinished goals of bt_actions processes on other machines, or in other containers, whose
    life this machine cannot see: the action of each."""


@dataclass(kw_only=True)
class Cleanup:
    """The cancel of goals that dead bt_actions processes of this machine left.

    `run` returns them with ends.

    The cleanup looks for servers for `look` seconds, and waits `patience` seconds more for its
    canceled goals to end. `found` gets each goal at once, and again where it was `awaited` and
    turns up. The actions in `wanted`, by the full names of their servers (None: all in sight), and
    those of found goals, are looked at until they are known, for LOOK_LONGEST seconds at most, or
    `look`, if that is more. `waits` gets the silent ones, once, when the wait for them begins. The
    cleanup ends in the turn after `stopped` returns True. Blocks.

    A goal that was sent and not answered is awaited until it has been denied for `accept` seconds,
    for as long as its sender gave the server to decide, and for DENIED_FOR_GOOD, whichever is most.

    A server in sight that does not answer may never tell this participant anything
    (ros/rediscovery.py), and neither may one after a long stall of this process. The cleanup looks
    again with a new participant, twice at most.

    Raises ValueError for seconds that are negative or no number.
    """

    look: float = 5.0
    patience: float = 5.0
    accept: float = 0.0
    found: Callable[[LeftBehind], None] = lambda left: None
    wanted: Collection[str] | None = None
    waits: Callable[[list[str]], None] = lambda actions: None
    stopped: Callable[[], bool] = lambda: False

    def __post_init__(self) -> None:
        seconds = self.look, self.patience, self.accept
        if not all(each >= 0.0 for each in seconds):
            raise ValueError(f"look, patience, accept: seconds are 0 or more, not {seconds}")
        self._deadline = time.monotonic() + max(self.look, LOOK_LONGEST)
        self._has_waited = False
        self._calls: dict[str, RollCall] = {}  # by action
        self._elsewhere: dict[bytes, str] = {}
        self._of_others: dict[bytes, tuple[RollCall, Author]] = {}  # goals of living authors
        self._left: dict[bytes, LeftBehind] = {}
        self._sent: dict[bytes, Sent] = {}  # requests of dead authors here, without an answer
        self._read_before: set[Path] = set()
        self._trouble: OSError | None = None

    def run(self) -> Swept:
        """Find and cancel the goals, and return what was seen.

        Raises CannotStart, if nothing has been looked at yet.
        """
        for tries_before in range(3):
            still = Stalls()
            still.lives(time.monotonic())  # stalls count from the making of the participant
            try:
                with onlooker() as sight:
                    self._begin(sight)
                    if self._goes_through(still, breaks_off=tries_before < 2):
                        break
            except CannotStart:
                if not tries_before:
                    raise
                break
        return self._ends()

    def _begin(self, sight: Onlooker) -> None:
        """Go on with the sight of this participant."""
        self._sight = sight
        self._views: dict[RollCall, ActionView] = {}
        self._questions: dict[tuple[RollCall, int], LeftBehind] = {}
        self._wanted = {self._call(name) for name in self.wanted or ()}
        for call in self._calls.values():
            call.begin()
        for left in self._left.values():
            left.denials.begin()
        self._find()  # before the first status: the status of an end comes once

    def _call(self, action: str) -> RollCall:
        """Return the roll call of an action's servers, which are looked for from now on."""
        return self._calls.setdefault(action, RollCall(action))

    def _goes_through(self, still: Stalls, *, breaks_off: bool) -> bool:
        """Look, cancel, and wait; return False where it `breaks_off`, for another participant.

        A stall breaks off, and so does a server in sight that does not answer.
        """
        began = looked = time.monotonic()
        until = began + self.look
        while not self.stopped():
            now = time.monotonic()
            self._deadline += still.lives(now)
            if still.long_times and breaks_off:
                return False  # messages of that time may be lost
            # A living server may not be in sight again yet
            until = max(until, now + still.answers_take(now), now + still.servers_take(now))
            self._turn(still)
            lacks = self._lacks()
            looking = now < self._deadline and (now < until or bool(lacks))
            if looking or self._awaits(now):
                looked = now
            elif now >= looked + self.patience or all(left.is_over for left in self._left.values()):
                break
            overdue = [call for call in lacks if looking and call.overdue(now)]
            if overdue and now >= min(until, began + LOOK_AGAIN):
                if not self._has_waited:
                    self._has_waited = True
                    self.waits(sorted(call.action for call in overdue))
                if breaks_off and any(call.servers for call in overdue):
                    return False  # the server may not hear this participant
            time.sleep(TURN)
        return True

    def _ends(self) -> Swept:
        """Return all that was seen, and put it on record."""
        self._keep_record()
        lacks, required = self._lacks(), self._required()
        calls = self._calls.values()
        return Swept(
            left=list(self._left.values()),
            known=[call.action for call in calls if call.known],
            unknown={
                call.action: call.trouble
                for call in calls
                if not call.known and call in required and (call.servers or call in lacks)
            },
            domain=self._sight.domain,
            trouble=self._trouble,
            missing=sorted(call.action for call in lacks),
            elsewhere=self._elsewhere,
        )

    def _keep_record(self) -> None:
        """Take goals off the record that are over, or that a status shows.

        A goal that was looked for in vain is told once. Should its server only have stood still,
        and be in sight another time, the goal is awaited again.
        """
        was_looked_for = time.monotonic() >= self._deadline
        for goal_id, sent in self._sent.items():
            left = self._left.get(goal_id)
            if left is None:
                continue
            if left.awaited:
                if was_looked_for and not left.call.servers:
                    sent.mark_lost()
            elif left.nothing_left == GONE:
                sent.mark_lost()
            elif len(sent.servers) <= 1 or left.nothing_left:  # another may not have decided
                sent.strike()

    def _lacks(self) -> list[RollCall]:
        """Return the actions that are looked for, and not known."""
        named = {left.call for left in self._left.values()} | self._wanted
        return [
            call for call in self._required() if not call.known and (call in named or call.servers)
        ]

    def _required(self) -> set[RollCall]:
        """Return the actions whose servers are to tell their goals.

        The servers of others are not asked.
        """
        if self.wanted is None:
            return set(self._calls.values())
        return {left.call for left in self._left.values()} | self._wanted

    def _awaits(self, now: float) -> bool:
        """Return whether a goal may turn up yet at a server in sight."""
        return any(
            left.awaited and left.call.servers and now < self._deadline + left.takes + AWAIT_LONGER
            for left in self._left.values()
        )

    def _turn(self, still: Stalls) -> None:
        """Take arrived messages, then look around, and ask."""
        for call, view in self._views.items():
            self._hear(call, view)  # first: a status from before an answer is read after it
            for message in view.statuses():
                self._read(call, message)
                still.lives(time.monotonic())  # there may be many, each of thousands of goals
        now = time.monotonic()
        for call in map(self._call, self._sight.actions()):
            if call not in self._views:
                self._views[call] = ActionView(self._sight.node, call.action)
        for call, view in self._views.items():
            call.sees(view.servers(), now)
        self._find()
        for call in self._required() & self._views.keys():
            # about a goal that nobody has: any answer shows that a server lives
            view, due = self._views[call], not call.known and call.due(now)
            if due and (question := view.cancel(uuid.uuid4().bytes)) is not None:
                call.asked(question, now)
        self._cancel(now)

    def _hear(self, call: RollCall, view: ActionView) -> None:
        for number, code in view.answers():
            call.answer_came(number, time.monotonic())
            left = self._questions.get((call, number))
            if left is None:
                continue
            if code in (CANCEL_UNKNOWN_GOAL, CANCEL_TERMINATED):
                left.denials.answer_came(number)
            else:
                self._turns_up(left)

    def _read(self, call: RollCall, message: Any) -> None:
        call.tells()
        one_server = len(call.servers) <= 1  # a second server may run an ended goal
        for entry in message.status_list:
            goal_id, ended = bytes(entry.goal_info.goal_id.uuid), entry.status in ENDS
            left = self._left.get(goal_id)
            if left is not None:
                left.shown = ENDS.get(entry.status, End.UNKNOWN)
                self._turns_up(left)
            elif ended:
                if one_server:
                    self._of_others.pop(goal_id, None)
            elif (author := author_of(goal_id)) is not None:
                if author.here:
                    self._of_others[goal_id] = call, author
                else:
                    self._elsewhere[goal_id] = call.action

    def _find(self) -> None:
        """Find the goals of authors that are dead by now: a status comes at a change only."""
        alive = {author: author.alive for author in {by for _, by in self._of_others.values()}}
        for goal_id, (call, author) in list(self._of_others.items()):
            if not alive[author]:
                del self._of_others[goal_id]
                self._is_left(LeftBehind(call, goal_id, author.pid))
        self._read_records()
        for goal_id, sent in self._sent.items():
            call = self._call(sent.action)
            gone = bool(sent.servers) and not sent.servers & call.servers
            if goal_id in self._left:
                self._left[goal_id].judge(known=call.known, gone=gone)
            elif not (sent.lost and gone):
                takes = max(DENIED_FOR_GOOD, self.accept, sent.accept)
                self._is_left(LeftBehind(call, goal_id, sent.author.pid, takes=takes, awaited=True))

    def _is_left(self, left: LeftBehind) -> None:
        self._left[left.goal_id] = left
        self.found(left)

    def _read_records(self) -> None:
        """Read the records of processes that have died since the last turn."""
        self._trouble = None
        for sent in left_behind(self._read_before):
            if isinstance(sent, OSError):
                self._trouble = sent
                continue
            self._read_before.add(sent.path)
            if sent.domain != self._sight.domain:
                continue
            if sent.author.here:
                self._sent[sent.goal_id] = sent
            else:
                self._elsewhere[sent.goal_id] = sent.action
        if self._trouble is not None and self._trouble.filename:  # to be read and told again
            self._read_before.discard(Path(self._trouble.filename))

    def _turns_up(self, left: LeftBehind) -> None:
        """Take note that a server has a goal: the server tells the end in a status."""
        if left.awaited or left.nothing_left:
            left.awaited, left.nothing_left, left.asked_at = False, "", NEVER
            if left.end is End.UNKNOWN:
                self.found(left)

    def _cancel(self, now: float) -> None:
        """Ask the servers to cancel goals that have not ended, again every second."""
        asked = Counter[RollCall]()
        for left in sorted(self._left.values(), key=lambda goal: goal.asked_at):
            call = left.call
            view = self._views.get(call)
            if view is None or left.is_over or now - left.asked_at < ASK_AGAIN:
                continue
            asked[call] += 1
            if asked[call] > CANCELS_A_TURN or (question := view.cancel(left.goal_id)) is None:
                continue
            left.asked_at = now
            if left.awaited:
                self._questions[call, question] = left
                left.denials.asked(question, call.servers, now)
