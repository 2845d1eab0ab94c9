"""Finds and cancels goals that a killed orchestrator left on servers it can no longer speak to.

A process that dies by SIGKILL cancels nothing. Its goals are found in the status topics of all
actions in sight, told by their ids (ids.py), and canceled one by one; goals of other clients,
and of orchestrators that are alive, or that cannot be looked for from here, are never touched. No
action type is needed for any of it. That a server has nothing to tell is believed when it has
answered for long enough (roll_call.py).

No status shows a goal that its server has not accepted yet. That it was sent is on its sender's
record (ledger.py), and it is awaited until a server shows it, or it is sure that none will: its
server is asked again and again to cancel it.
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
"""Seconds between two looks for what has come in, at the graph, and for who is still alive."""
LOOK_LONGEST = 30.0
"""Seconds for which servers may take to answer, in all: a dead server is shown for 20."""
AWAIT_LONGER = 2 * SETTLE
"""Seconds by which a goal is awaited longer, at most, than servers are looked for and deny it."""
LOOK_AGAIN = 10.0
"""Seconds after which, at the latest, a participant that is not answered gives way to another."""
CANCELS_A_TURN = 5
"""So many goals of an action at once: a server keeps its last ten requests only."""


@dataclass(frozen=True, slots=True)
class Swept:
    """The goals that a cleanup has seen."""

    left: list[LeftBehind]
    known: list[str]
    """The actions of which every server has told what it runs."""
    unknown: dict[str, str]
    """The others that were asked, each with the reason, in whose braces belongs its name."""
    domain: int
    """The ROS domain in force."""
    trouble: OSError | None
    """Why nobody can read what was sent and is not answered."""
    missing: list[str]
    """The goals of `unknown` that were looked for in vain."""
    elsewhere: dict[bytes, str]
    """Unfinished goals of bt_actions processes on other machines, or in other containers, of which
    nobody here can tell whether they are alive: the action of each."""


@dataclass(kw_only=True)
class Cleanup:
    """Cancels what dead orchestrators of this machine left; `run` returns it with its ends.

    Looks for servers for `look` seconds, and waits `patience` seconds more for the goals that it
    canceled to end. `found` is called with each at once, and again where it was `awaited` when it
    turns up. The actions in `wanted`, by the full names of their servers (None: all in sight), and
    those of goals that were found, are looked at until they are known, for LOOK_LONGEST seconds at
    most, or `look`, if that is more; `waits` is called with those that are not, once, when it
    begins to wait for one that is silent. Ends in the next turn when `stopped` says so. Blocks.

    A goal that was sent and not answered is awaited: until it has been denied for `accept` seconds,
    for as long as its sender gave the server to decide, and for DENIED_FOR_GOOD, whichever is most.

    Where a server in sight does not answer, or this process stands still for long meanwhile, it may
    be that it will never tell this participant anything (ros/rediscovery.py). So it looks again
    with a new one, twice at most.

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
        self._calls: dict[str, RollCall] = {}  # by action, as long as this goes on
        self._elsewhere: dict[bytes, str] = {}
        self._of_others: dict[bytes, tuple[RollCall, Author]] = {}  # whose author is alive, or was
        self._left: dict[bytes, LeftBehind] = {}
        self._sent: dict[bytes, Sent] = {}  # by the dead of here, and not answered
        self._read_before: set[Path] = set()
        self._trouble: OSError | None = None

    def run(self) -> Swept:
        """Do it. Raises CannotStart, if nothing has been looked at yet."""
        for tries_before in range(3):
            still = Stalls()
            still.lives(time.monotonic())  # it counts from when the participant is made
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
        """Go on with what is seen in this participant."""
        self._sight = sight
        self._views: dict[RollCall, ActionView] = {}
        self._questions: dict[tuple[RollCall, int], LeftBehind] = {}
        self._wanted = {self._call(name) for name in self.wanted or ()}
        for call in self._calls.values():
            call.begin()
        for left in self._left.values():
            left.denials.begin()
        self._find()  # before the first status: one that tells an end comes once

    def _call(self, action: str) -> RollCall:
        """Return what is known of an action's servers; it is looked for from now on."""
        return self._calls.setdefault(action, RollCall(action))

    def _goes_through(self, still: Stalls, *, breaks_off: bool) -> bool:
        """Look, cancel, and wait; return False where it `breaks_off`, for another participant.

        Because of a stall, or of a server in sight that does not answer.
        """
        began = looked = time.monotonic()
        until = began + self.look
        while not self.stopped():
            now = time.monotonic()
            self._deadline += still.lives(now)
            if still.long_times and breaks_off:
                return False  # what was sent meanwhile may be lost
            # What there is may not be in sight again
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
                    return False  # it may not hear this participant
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
        """Take off the record what is over, or what a status shows.

        What was looked for to no avail is to be told once; should its server only have stood still,
        and be in sight another time, it is awaited again.
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
        """Return the actions whose servers are to tell what they run; others are not asked."""
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
        """Take all that has come in, then look around, and ask."""
        for call, view in self._views.items():
            self._hear(call, view)  # first: what was told before an answer is read
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
            # of a goal that is nobody's: any answer shows that a server lives
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
        one_server = len(call.servers) <= 1  # or else another may run what has ended
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
        """See who of those that left goals is dead by now: a status comes at a change only."""
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
        """Read what those have on record that have died since."""
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
        if self._trouble is not None and self._trouble.filename:  # to be told again
            self._read_before.discard(Path(self._trouble.filename))

    def _turns_up(self, left: LeftBehind) -> None:
        """Take note that a server has a goal: the server tells the end in a status."""
        if left.awaited or left.nothing_left:
            left.awaited, left.nothing_left, left.asked_at = False, "", NEVER
            if left.end is End.UNKNOWN:
                self.found(left)

    def _cancel(self, now: float) -> None:
        """Ask the servers to cancel what has not ended, again every second."""
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
