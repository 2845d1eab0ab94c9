"""Finds and cancels goals that a killed orchestrator left on servers it can no longer speak to.

A process that dies by SIGKILL cancels nothing. Its goals are found in the status topics of all
actions in sight, told by their ids (goals/ids.py), and canceled one by one; goals of other clients,
and of orchestrators that are alive, or that cannot be looked for from here, are never touched. No
action type is needed for any of it. That a server has nothing to tell is believed when it has
answered for long enough (roll_call.py).

No status shows a goal that its server has not accepted yet. That it was sent is on its sender's
record, and it is awaited (unanswered.py): its server is asked again and again to cancel it.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from bt_actions.goals.asking import DENIED_FOR_GOOD
from bt_actions.goals.ids import Author, author_of
from bt_actions.goals.policy import End
from bt_actions.goals.terms import CANCEL_TERMINATED, CANCEL_UNKNOWN_GOAL, ENDS
from bt_actions.recovery.left_behind import LeftBehind
from bt_actions.recovery.roll_call import ASK_AGAIN, SETTLE, RollCall
from bt_actions.recovery.unanswered import Unanswered
from bt_actions.ros.onlooker import ActionView, CannotStart, Onlooker, onlooker
from bt_actions.servers.stalls import Stalls

TURN = 0.05
"""Seconds between two looks for what has come in;"""
GLANCE = 0.1
"""and, at least, between two looks at the graph, and for who is still alive."""
LOOK_LONGEST = 30.0
"""Seconds for which servers may take to answer, in all: a dead server is shown for 20."""
AWAIT_LONGER = LOOK_LONGEST + 2 * SETTLE
"""Seconds by which a goal is awaited longer, at most, than it has to be denied."""
LOOK_AGAIN = 10.0
"""Seconds after which, at the latest, a participant that is not answered gives way to another."""
CANCELS_A_TURN = 5
"""So many goals of an action at once: a server keeps its last ten requests only."""


@dataclass(frozen=True, slots=True)
class Swept:
    """What a cleanup has seen."""

    left: list[LeftBehind]
    known: list[str]
    """The actions of which every server has told what it runs."""
    unknown: dict[str, str]
    """The others in sight, or wanted, each with the reason, in whose braces belongs its name."""
    domain: int
    """The ROS domain in force."""
    trouble: OSError | None = None
    """Why nobody can read what was sent and is not answered."""


def cleanup(
    *,
    look: float = 5.0,
    patience: float = 5.0,
    accept: float = 0.0,
    found: Callable[[LeftBehind], None] = lambda left: None,
    sighted: Callable[[str], None] = lambda action: None,
    elsewhere: Callable[[str, bytes], None] = lambda action, goal_id: None,
    wanted: Collection[str] | None = None,
    namespace: str = "",
    missing: Callable[[list[str], bool], None] = lambda actions, in_vain: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Swept:
    """Cancel what dead orchestrators of this machine left; return it with its ends.

    Looks for servers for `look` seconds, and waits `patience` seconds more for the goals that it
    canceled to end. `found` is called with each at once, and again where it was `awaited` when it
    turns up; `sighted` with the name of each action of which a server is in sight, and `elsewhere`
    with the action and the id of each unfinished goal of a bt_actions process on another machine,
    or in another container, of which nobody here can tell whether it is alive. The actions in
    `wanted`, whose relative names belong to `namespace` (None: all in sight), and those of goals
    that were found, are looked at until they are known, for LOOK_LONGEST seconds at most, or
    `look`, if that is more; `missing` is called with those that are not, in the beginning of
    waiting for one that is silent, and in the end if it was in vain, as it is told. Ends in the
    next turn when `stopped` says so. Blocks.

    A goal that was sent and not answered is awaited: until it has been denied for `accept` seconds,
    for as long as its sender gave the server to decide, and for DENIED_FOR_GOOD, whichever is most.

    Where a server in sight does not answer, or this process stands still for long meanwhile, it may
    be that it will never tell this participant anything (ros/rediscovery.py). So it looks again
    with a new one, twice at most.

    Raises CannotStart, if nothing has been looked at yet; ValueError for a `look`, a `patience` or
    an `accept` that is negative or no number, and for a name in `wanted` that is none.
    """
    if not (look >= 0.0 and patience >= 0.0 and accept >= 0.0):
        given = f"look {look}, patience {patience}, accept {accept}"
        raise ValueError(f"{given}: seconds are 0 or more")
    sweep = _Sweep(look, patience, accept, found, sighted, elsewhere, missing, stopped)
    for tries_left in (2, 1, 0):
        still = Stalls()
        still.lives(time.monotonic())  # it counts from when the participant is made
        try:
            with onlooker(namespace) as sight:
                sweep.begin(sight, wanted)
                if sweep.goes_through(still, breaks_off=tries_left > 0):
                    break
        except CannotStart:
            if not sweep.has_begun:
                raise
            break
    return sweep.ends()


@dataclass
class _Sweep:
    """What was found, in one participant after another."""

    _look: float
    _patience: float
    _accept: float
    _found: Callable[[LeftBehind], None]
    _sighted: Callable[[str], None]
    _elsewhere: Callable[[str, bytes], None]
    _missing: Callable[[list[str], bool], None]
    _stopped: Callable[[], bool]

    def __post_init__(self) -> None:
        self._deadline = 0.0
        self.has_begun = False
        self._waits = False
        self._wanted: frozenset[str] | None = None
        self._calls: dict[str, RollCall] = {}
        self._foreign: set[bytes] = set()
        self._of_others: dict[bytes, tuple[str, Author]] = {}  # whose author is alive, or was
        self._left: dict[bytes, LeftBehind] = {}
        self._unanswered = Unanswered()
        self._awaits_until = 0.0
        self._domain = 0
        self._looked_out = False  # for as long as for what is wanted

    def begin(self, sight: Onlooker, wanted: Collection[str] | None) -> None:
        """Go on with what is seen here. Raises ValueError for a name that is none."""
        names = [sight.full_name(name) for name in wanted or ()]
        now = time.monotonic()
        if not self.has_begun:
            self._deadline = now + max(self._look, LOOK_LONGEST)
        self.has_begun = True
        self._sight = sight
        self._domain = sight.domain
        self._wanted = None if wanted is None else frozenset(names)
        self._views: dict[str, ActionView] = {}
        self._glanced_at = float("-inf")
        self._questions: dict[tuple[str, int], LeftBehind] = {}
        for call in self._calls.values():
            call.begin(now)
        for left in self._left.values():
            left.denial.begin()
            self._prolong(left)
        for name in names:
            self._calls.setdefault(name, RollCall(now))
        self._find()  # before the first status: one that tells an end comes once

    def goes_through(self, still: Stalls, *, breaks_off: bool) -> bool:
        """Look, cancel, and wait; return False where it `breaks_off`, for another participant.

        Because of a stall, or of a server in sight that does not answer.
        """
        began = looked = time.monotonic()
        until = began + self._look
        while not self._stopped():
            now = time.monotonic()
            stood_still = still.lives(now)
            held = max(still.answers_take(now), still.servers_take(now))
            if still.long_times and breaks_off:
                return False  # what was sent meanwhile may be lost
            if held > 0.0:  # what there is may not be in sight again
                until = max(until, now + held)
            self._deadline += stood_still
            self._awaits_until += stood_still
            self._turn(still)
            lacks = self._lacks()
            self._looked_out |= now >= self._deadline
            looking = now < self._deadline and (now < until or bool(lacks))
            awaiting = now < self._awaits_until and self._awaits
            if not (looking or awaiting) and (self._over or now >= looked + self._patience):
                break
            if looking or awaiting:
                looked = now
            if looking:
                overdue = [name for name in lacks if self._calls[name].overdue(now)]
                if overdue and now >= until and not self._waits:
                    self._waits = True
                    self._missing(overdue, False)
                silent = any(self._calls[name].sighted for name in overdue)
                if silent and breaks_off and now >= min(until, began + LOOK_AGAIN):
                    return False  # it may not hear this participant
            time.sleep(TURN)
        return True

    def ends(self) -> Swept:
        """Return all that was seen; what is still looked for is missing, in vain."""
        if (lacks := self._lacks()) and not self._stopped():
            self._missing(lacks, True)
        calls = sorted(self._calls.items())
        self._unanswered.strike(self._left, self._calls, was_looked_for=self._looked_out)
        return Swept(
            left=list(self._left.values()),
            known=[name for name, call in calls if call.known],
            unknown={
                name: call.trouble
                for name, call in calls
                if not call.known and (call.sighted or self._requires(name))
            },
            trouble=self._unanswered.trouble,
            domain=self._domain,
        )

    def _requires(self, action: str) -> bool:
        if any(left.action == action for left in self._left.values()):
            return True
        return self._calls[action].sighted if self._wanted is None else action in self._wanted

    def _lacks(self) -> list[str]:
        """Return the actions that are looked for, and not known."""
        unknown = [action for action, call in sorted(self._calls.items()) if not call.known]
        return [action for action in unknown if self._requires(action)]

    @property
    def _over(self) -> bool:
        """Whether every goal that was found has ended."""
        return all(goal.is_over for goal in self._left.values())

    @property
    def _awaits(self) -> bool:
        """Whether a goal may turn up yet at a server in sight."""
        return any(
            left.awaited and self._calls[left.action].sighted for left in self._left.values()
        )

    def _turn(self, still: Stalls) -> None:
        """Take all that has come in, then look around, and ask."""
        for action, view in self._views.items():
            self._hear(action, view)
            for message in view.statuses():  # there may be many, each of thousands of goals
                self._read(action, message)
                self._hear(action, view)
                still.lives(time.monotonic())
                if self._stopped():
                    return
        now = time.monotonic()
        if now - self._glanced_at >= GLANCE:
            self._glanced_at = now
            self._glance(now)
            self._find()
        for action, view in self._views.items():
            call = self._calls[action]
            # of a goal that is nobody's: any answer shows that a server lives
            if call.due(now) and (question := view.cancel(uuid.uuid4().bytes)) is not None:
                call.asked(question, now)
        self._cancel(now)

    def _hear(self, action: str, view: ActionView) -> None:
        for number, code in view.answers():
            now = time.monotonic()
            self._calls[action].answered(number, now)
            left = self._questions.get((action, number))
            if left is None:
                continue
            if code not in (CANCEL_UNKNOWN_GOAL, CANCEL_TERMINATED):
                self._turns_up(left)
            elif code == CANCEL_TERMINATED and len(self._calls[action].servers) <= 1:
                left.is_nowhere("has ended")
            else:
                left.denial.denied(number)

    def _glance(self, now: float) -> None:
        """See which actions are in sight, and how many servers each has."""
        for action in self._sight.actions():
            if action not in self._views:
                self._views[action] = self._sight.view(action)
                self._calls.setdefault(action, RollCall(now))
        for action, view in self._views.items():
            call = self._calls[action]
            first = not call.sighted
            call.sees(view.servers(), now, published=view.is_published())
            if first and call.sighted:
                self._sighted(action)

    def _read(self, action: str, message: Any) -> None:
        one_server = len(self._calls[action].servers) <= 1  # or else another may run what has ended
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
                    self._of_others[goal_id] = action, author
                else:
                    self._meet_elsewhere(action, goal_id)

    def _meet_elsewhere(self, action: str, goal_id: bytes) -> None:
        if goal_id not in self._foreign:
            self._foreign.add(goal_id)
            self._elsewhere(action, goal_id)

    def _find(self) -> None:
        """See who of those that left goals is dead by now: a status comes at a change only."""
        dead = {author for author in {by for _, by in self._of_others.values()} if not author.alive}
        for goal_id, (action, author) in list(self._of_others.items()) if dead else ():
            if author in dead:
                del self._of_others[goal_id]
                left = self._left[goal_id] = LeftBehind(action, goal_id, author.pid)
                self._found(left)
        for sent in self._unanswered.read(self._domain):
            self._meet_elsewhere(sent.action, sent.goal_id)
        for sent in list(self._unanswered.new(self._left, self._calls)):
            self._calls.setdefault(sent.action, RollCall(time.monotonic()))
            takes = max(DENIED_FOR_GOOD, self._accept, sent.accept)
            left = LeftBehind(sent.action, sent.goal_id, sent.author.pid, takes=takes, awaited=True)
            self._left[sent.goal_id] = left
            self._prolong(left)
            self._found(left)
        for left in self._unanswered.judge(self._left, self._calls):
            self._prolong(left)
        for left in self._left.values():
            left.servers = len(self._calls[left.action].servers)

    def _prolong(self, left: LeftBehind) -> None:
        """Have time enough to await it from now on."""
        if left.awaited:
            until = time.monotonic() + max(self._look, left.takes + AWAIT_LONGER)
            self._awaits_until = max(self._awaits_until, until)

    def _turns_up(self, left: LeftBehind) -> None:
        """A server has it: it tells the end in a status."""
        if left.awaited or left.nothing_left:
            left.turns_up()
            if left.end is End.UNKNOWN:
                self._found(left)

    def _cancel(self, now: float) -> None:
        """Ask the servers to cancel what has not ended, again every second."""
        goals = sorted(self._left.values(), key=lambda goal: goal.asked_at)
        for action, view in self._views.items():
            due = [
                left
                for left in goals
                if left.action == action and not left.is_over and now - left.asked_at >= ASK_AGAIN
            ]
            for left in due[:CANCELS_A_TURN]:
                if (question := view.cancel(left.goal_id)) is not None:
                    left.asked_at = now
                    if left.awaited:
                        self._questions[action, question] = left
                        left.denial.asked(question, self._calls[action].servers, now)
