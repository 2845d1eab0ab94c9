"""Action servers that treat each goal as a recorded run did.

A server sees goals, and no leaves. A goal is treated as the oldest recorded one of its server with
the same fields that was not asked for again yet. Without one, it is treated as the oldest of those
that are left, with a warning. A goal beyond the recorded ones is treated as a script says.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Any

from py_trees.behaviour import Behaviour

from bt_actions.behaviours.action import ActionBehaviour
from bt_actions.events.kinds import Event
from bt_actions.events.snapshot import HIDDEN, Cut, Value, snapshot
from bt_actions.goals.policy import End, Outcome
from bt_actions.messages.conversion import MessageError, fill
from bt_actions.messages.interfaces import interface, short_name
from bt_actions.simulation.battery import Battery
from bt_actions.simulation.fault_plan import FaultPlan, GoalFaults
from bt_actions.simulation.faults import Fault
from bt_actions.simulation.goal_meaning import Finish
from bt_actions.simulation.journal import Journal
from bt_actions.simulation.live_goal import LiveGoal
from bt_actions.simulation.recorded.run import RecordedGoal, RecordedRun, ServerStory, is_whole
from bt_actions.simulation.scripted import Script, ScriptedServer
from bt_actions.simulation.server import RESULT_TIMEOUT, platform_of
from bt_actions.simulation.stepper import Stepper
from bt_actions.simulation.world import World
from bt_actions.utilities.plain_text import clean
from bt_actions.utilities.shorten import shorten
from bt_actions.utilities.suggest import listing

STEP = 0.02
"""Seconds of simulated time between two looks at what is due."""
LINGERS = 0.05
"""Wall seconds in which a last result reaches its client before the server goes."""
_OTHER_EACH_TIME = ("stamp", "caller_run")
"""Fields that differ from run to run: the time in headers, and the run that sends a tree."""
_FINISHES: dict[End | None, Finish] = {End.ABORTED: Finish.FAULT, End.CANCELED: Finish.CANCELED}


class _Rerun:
    """A goal that goes as a recorded one went."""

    def __init__(self, recorded: RecordedGoal, period: float) -> None:
        self.recorded = recorded
        self._period = period
        self._elapsed = 0.0
        self._left = deque(recorded.heard)

    @property
    def progress(self) -> float:
        if self.recorded.outcome is Outcome.SERVER_LOST:  # the fault strikes then, not half-way
            return float(self.done)
        seconds = self.recorded.seconds
        return min(1.0, self._elapsed / seconds) if seconds else 1.0

    @property
    def done(self) -> bool:
        return self._elapsed >= self.recorded.seconds - 1e-9  # the error of adding up periods

    def step(self, share: float) -> None:
        self._elapsed += self._period * share

    def due(self) -> list[Value]:
        """Take the feedback whose time has come; at the end all the rest."""
        now = math.inf if self.done else self._elapsed
        found = []
        while self._left and self._left[0][0] <= now:
            found.append(self._left.popleft()[1])
        return found


class RecordedServer(ScriptedServer):
    """One action server; see the head of this file."""

    def __init__(
        self,
        node: Any,
        action_type: Any,
        name: str,
        goals: Sequence[RecordedGoal],
        script: Script | None = None,
        **settings: Any,
    ) -> None:
        """Serve recorded goals; `script` is for goals beyond those.

        `settings` are those of ScriptedServer.
        """
        self.left = list(goals)
        """The recorded goals that were not asked for again."""
        self.recorded = len(goals)
        self._is_secret = any(each.goal == HIDDEN for each in goals)
        self._taken: dict[int, RecordedGoal] = {}
        """The recorded goals by the id of the message, from its request until it begins."""
        super().__init__(node, action_type, name, script, **settings)

    def strike(self, goal: Any, number: int) -> GoalFaults:
        faults = super().strike(goal, number)
        self._taken.pop(id(goal), None)  # an earlier message with this id never began
        recorded = self._take(snapshot(goal), number)
        if recorded is None:
            return faults
        self._taken[id(goal)] = recorded
        return GoalFaults(recorded.faults | faults)

    def begin(self, goal: Any) -> Any:
        recorded = self._taken.pop(id(goal), None)
        if recorded is None:
            return super().begin(goal)
        return _Rerun(recorded, self.stepper.step_period)

    def due_feedback(self, motion: Any) -> Sequence[Any]:
        if not isinstance(motion, _Rerun):
            return super().due_feedback(motion)
        return [self._message(self.action_type.Feedback, value) for value in motion.due()]

    def verdict(self, motion: Any) -> tuple[Finish, str]:
        if not isinstance(motion, _Rerun):
            return super().verdict(motion)
        finish = _FINISHES.get(motion.recorded.ended, Finish.COMPLETED)
        return finish, "" if finish is Finish.COMPLETED else "as it was recorded"

    def result(self, motion: Any, finish: Finish, reason: str) -> Any:
        if not isinstance(motion, _Rerun):
            return super().result(motion, finish, reason)
        return self._message(self.action_type.Result, motion.recorded.result)

    def ended(self, goal: LiveGoal, result: Any) -> None:
        super().ended(goal, result)
        away = goal.motion.recorded.away if isinstance(goal.motion, _Rerun) else 0.0
        if away:
            go = self.stepper.now() + LINGERS
            self.stepper.call_at(go, lambda now: self._go(away))

    def _go(self, away: float) -> None:
        if math.isinf(away):
            self.abandon("it went away in the recorded run")
        else:
            self.restart(away)

    def _take(self, told: Value, number: int) -> RecordedGoal | None:
        """Return the recorded goal for a new one, and warn where they differ."""
        new = f"{self.name}: goal {number}{'' if self._is_secret else f', {shorten(told)},'}"
        if not self.left:
            self._warn(f"{new} is beyond the {self.recorded} recorded: its answer is made up")
            return None
        key = _key(told)
        found = next((each for each in self.left if _key(each.goal) == key), self.left[0])
        self.left.remove(found)
        if _key(found.goal) != key and is_whole(found.goal):
            self._warn(f"{new} is answered as {shorten(found.goal)} was in the recorded run")
        return found

    def _message(self, kind: type, value: Value) -> Any:
        """Return a message with those fields of a snapshot that its type has and can hold."""
        message, misfits = kind(), []
        fields = _opened(value)
        for name, item in (fields if isinstance(fields, dict) else {}).items():
            try:
                setattr(message, name, getattr(fill(kind, {name: item}), name))
            except MessageError as error:
                misfits.append(str(error))
        if misfits:
            said = "; ".join(misfits)
            self._warn(f"{self.name}: a recorded {short_name(kind)} does not fit: {said}")
        return message

    def _warn(self, text: str) -> None:
        self._log.warning(clean(text))  # names and values of a recording may be a stranger's


class RecordedServers:
    """The action servers of a tree, as they were in a recorded run.

    `events` are those of the run, in order, and `node` is an rclpy node or a VirtualNetwork.
    `script` is for goals beyond the recorded ones; without one they succeed after half a second,
    with empty messages. `speed` shortens the time of goals, and not the time of a server out of
    sight. `remarks` has what cannot be as it was; later differences are in the log. The topic of a
    simulated robot's battery is there, too: the battery is full.

    Raises FaultError for a fault that fits no server.
    """

    def __init__(
        self,
        node: Any,
        tree: Behaviour,
        events: Iterable[Event],
        *,
        speed: float = 1.0,
        faults: Iterable[Fault | str] = (),
        seed: int | None = None,
        journal: str | os.PathLike[str] | None = None,
        script: Script | None = None,
        result_timeout: float = RESULT_TIMEOUT,
    ) -> None:
        """Serve each action of `tree`."""
        platform = platform_of(node)
        self.run = RecordedRun(events)
        self.servers: list[RecordedServer] = []
        """The servers that are, or have been, in sight."""
        self._log = platform.log
        self._stepper = Stepper(platform, speed=speed, step_period=STEP)
        self._journal = Journal(journal, clock=platform.now, on_error=self._log.error)
        plan = FaultPlan.of(faults, seed)
        self._settings: dict[str, Any] = {
            "script": script,
            "stepper": self._stepper,
            "faults": plan,
            "journal": self._journal,
            "result_timeout": result_timeout,
        }
        types = {
            platform.expand(leaf.action_name): interface(leaf.action_type, "action")
            for leaf in tree.iterate()
            if isinstance(leaf, ActionBehaviour)
        }
        plan.check(types)
        self.seed = plan.seed
        self._batteries = [
            Battery(self._stepper, World(), name.removesuffix("move_robot"))
            for name in types
            if name.endswith("/move_robot")
        ]
        self.remarks = [clean(each) for each in (*self.run.remarks, *self._told(types))]
        """A line for each thing that cannot be as it was."""
        for name, kind in types.items():
            self._open(kind, name, self.run.servers.get(name, ServerStory()))

    def __repr__(self) -> str:
        return f"<RecordedServers {listing(each.name for each in self.servers)}>"

    def describe(self) -> str:
        """Say how many of the recorded goals were asked for again."""
        counts = [
            f"{each.recorded - len(each.left)} of {each.recorded} of {each.name}"
            for each in self.servers
        ]
        return f"Recorded goals that were asked for again: {', '.join(counts) or 'none'}."

    def close(self) -> None:
        """Destroy servers, timer and topics; the node stays."""
        self._stepper.close()
        for server in self.servers:
            server.close()
        for battery in self._batteries:
            battery.close()
        self._journal.close()

    def _told(self, types: Iterable[str]) -> list[str]:
        known = {name: story for name, story in self.run.servers.items() if story.goals}
        said = []
        if new := sorted(set(types) - set(self.run.servers)):
            said.append(f"the recorded run has no goals for {listing(new)}: answers are made up")
        if old := sorted(set(known) - set(types)):
            said.append(f"the tree has no leaf for {listing(old)}: its goals are not asked for")
        return said

    def _open(self, kind: type, name: str, story: ServerStory) -> None:
        if story.away == 0.0:
            self.servers.append(
                RecordedServer(self._stepper.platform, kind, name, story.goals, **self._settings)
            )
        elif math.isfinite(story.away):
            came = ServerStory(story.goals)
            when = self._stepper.now() + story.away
            self._stepper.call_at(when, lambda now: self._open(kind, name, came))


def _key(goal: Value) -> Value:
    """Return the part of a goal that is the same in another run."""
    if isinstance(goal, dict):
        return {name: _key(each) for name, each in goal.items() if name not in _OTHER_EACH_TIME}
    return tuple(map(_key, goal)) if isinstance(goal, tuple) else goal


def _opened(value: Value) -> Value:
    """Return a snapshot with the beginnings of cut values."""
    if isinstance(value, Cut):
        return _opened(value.head)
    if isinstance(value, dict):
        return {name: _opened(item) for name, item in value.items()}
    if isinstance(value, tuple):
        return tuple(map(_opened, value))
    return value
