"""One accepted goal on its server: its steps, its end, and its lines in the journal.

The faults act here, once for all servers. No ROS and no clock: times are passed in, in seconds of
one steady clock. A goal never ends twice.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from bt_actions.goals.terms import STATUS_ABORTED, STATUS_CANCELED, STATUS_SUCCEEDED
from bt_actions.messages.interfaces import short_name
from bt_actions.simulation.fault_plan import GoalFaults
from bt_actions.simulation.faults import FaultKind
from bt_actions.simulation.goal_meaning import Finish, GoalMeaning, Motion
from bt_actions.simulation.journal import Event
from bt_actions.simulation.platform import Wire
from bt_actions.utilities.plain_text import raised

FLOOD_AT_ONCE = 1000
"""Feedback messages of a flood in one step, at most."""
_STATUSES = {Finish.COMPLETED: STATUS_SUCCEEDED, Finish.CANCELED: STATUS_CANCELED}
_EVENTS = {STATUS_SUCCEEDED: Event.SUCCEEDED, STATUS_CANCELED: Event.CANCELED}


class Owner(GoalMeaning):
    """The server of a live goal, beside the meaning of the goal."""

    @abstractmethod
    def record(self, goal_id: str, event: Event, **more: object) -> None:
        """Write a line into the journal."""

    @abstractmethod
    def broken(self, goal_id: str, reason: str) -> None:
        """Write into the log why a goal is aborted: its script, or subclass, raised."""

    @abstractmethod
    def ended(self, goal: LiveGoal, result: Any) -> None:
        """Send the result of a goal that has reached its terminal state."""

    @abstractmethod
    def die(self, reason: str) -> None:
        """Go away for good: a fault kills the server."""

    @abstractmethod
    def restart(self, seconds: float) -> None:
        """Go away for so many wall seconds."""


class LiveGoal:
    """A goal from its acceptance to its end. Used under the lock of its server's stepper.

    Call `step` every step of simulated time until it returns False, and `poll` when `due` has come
    and after a cancel was granted.
    """

    def __init__(
        self,
        owner: Owner,
        goal_id: str,
        wire: Wire,
        motion: Motion,
        faults: GoalFaults,
        *,
        now: float,
        step_period: float,
        time_limit: float | None,
    ) -> None:
        """Begin at `now`; period and limit are in seconds of simulated time."""
        self.goal_id = goal_id
        self.motion = motion
        self.faults = faults
        self._owner = owner
        self._wire = wire
        self._accepted = self._last_feedback = now
        self._step_period = step_period
        self._limit = time_limit
        self._elapsed = 0.0
        self._over = self._stalled = self._part_dropped = False
        self._cancel_at: float | None = None

    def __repr__(self) -> str:
        state = "over" if self._over else "moving" if self._moving else "standing"
        return f"<LiveGoal {self.goal_id[:8]} {state} {self.motion.progress:.0%} {self.faults}>"

    @property
    def due(self) -> float | None:
        """The moment at which `poll` is due although nothing moves; None: never."""
        return None if self._over else self._cancel_at

    def step(self, now: float) -> bool:
        """Move for one step of simulated time; return whether the goal still moves."""
        problem = self._move() if self._moving else ""
        self._record(Event.STEP)
        if problem:
            self.give_up(problem)
        elif self._moving and not self._strike(now):
            self._send_feedback(now)
            self._end_in_time()
        return self._moving

    def poll(self, now: float) -> None:
        """End the goal, where a cancel's time has come."""
        if self._cancel_at is None or now < self._cancel_at:
            return
        if FaultKind.SUCCEED_ON_CANCEL in self.faults:
            self._end(Finish.COMPLETED, "finished before it could be canceled")
        elif FaultKind.ABORT_ON_CANCEL in self.faults:
            self._end(Finish.FAULT, "fault: abort_on_cancel")
        else:
            self._end(Finish.CANCELED)

    def cancel(self, now: float) -> bool:
        """Return whether a request to cancel is granted; `poll` carries it out."""
        granted = not self._over and FaultKind.REJECT_CANCEL not in self.faults
        if granted and self._cancel_at is None and FaultKind.IGNORE_CANCEL not in self.faults:
            self._cancel_at = now + (self.faults.number(FaultKind.DELAY_CANCEL) or 0.0)
        event = Event.CANCEL_ACCEPTED if granted else Event.CANCEL_REJECTED
        self._owner.record(self.goal_id, event)
        return granted

    def replace(self) -> None:
        """Abort: a newer goal takes its place."""
        self._end(Finish.REPLACED, "replaced by a newer goal")

    def give_up(self, reason: str) -> None:
        """Abort, because the server cannot go on."""
        self._end(Finish.FAULT, reason)

    def abandon(self) -> None:
        """Stop without an end that any client hears of: the server has died."""
        self._over = True
        self._owner.halt(self.motion)

    @property
    def _moving(self) -> bool:
        return not (self._over or self._stalled or self._cancel_at is not None)

    @property
    def _half_way(self) -> bool:
        return self.motion.done or self.motion.progress >= 0.5

    def _move(self) -> str:
        """Move by one step; return the reason why that is impossible, or ""."""
        self._elapsed += self._step_period
        try:
            if not self.motion.done:
                self.motion.step(1.0 / (self.faults.number(FaultKind.SLOW) or 1.0))
        except Exception as error:  # noqa: BLE001 - the goal must end whatever its motion does
            return self._broken(f"it could not go on: {raised(error)}")
        return ""

    def _strike(self, now: float) -> bool:
        """Let the faults strike whose time has come; return whether this step is over with that."""
        if self._time_for(FaultKind.DIE, now) and self.faults.dies("execute"):
            self._owner.die("fault: die")
        elif FaultKind.RESTART in self.faults and self._half_way:
            self._owner.restart(self.faults.number(FaultKind.RESTART) or 0.0)
        elif self._time_for(FaultKind.ABORT, now):
            self.give_up("fault: abort")
        else:
            dropped = self._time_for(FaultKind.DROP_PART, now) and not self._part_dropped
            self._part_dropped |= dropped
            self._stalled = self._time_for(FaultKind.STALL, now)
            if dropped:  # the goal itself goes on, with one feedback less
                self._owner.drop_part()
            return dropped or self._stalled
        return True

    def _time_for(self, kind: FaultKind, now: float) -> bool:
        if kind not in self.faults:
            return False
        seconds = self.faults.number(kind)
        if seconds is None:
            return self._half_way
        return self.motion.done or now - self._accepted >= seconds

    def _send_feedback(self, now: float) -> None:
        hertz = self.faults.number(FaultKind.FLOOD)
        times = 0 if FaultKind.NO_FEEDBACK in self.faults else 1
        if times and hertz is not None:
            times = max(1, min(FLOOD_AT_ONCE, int((now - self._last_feedback) * hertz)))
            self._last_feedback = now
        try:
            messages = self._owner.due_feedback(self.motion) if times else ()
            for message in [each for each in messages for _ in range(times)]:
                self._wire.feedback(self.goal_id, message)
        except Exception as error:  # noqa: BLE001 - the goal must end whatever its script does
            self.give_up(self._broken(f"it has no feedback: {raised(error)}"))

    def _end_in_time(self) -> None:
        if self.motion.done:
            self._end(Finish.COMPLETED)
        elif self._limit is not None and self._elapsed > self._limit - self._step_period / 2:
            reason = f"not finished within {self._limit:g} s of simulated time"
            self._end(Finish.TIMEOUT, reason)

    def _end(self, finish: Finish, reason: str = "") -> None:
        if self._over:
            return
        self._over = True
        action_type = self._owner.action_type
        try:
            if finish is Finish.COMPLETED:
                verdict, why = self._owner.verdict(self.motion)
                finish, reason = verdict, why or reason
            if finish is not Finish.COMPLETED:
                self._owner.halt(self.motion)
            result = self._owner.result(self.motion, finish, reason)
            if not isinstance(result, action_type.Result):
                raise TypeError(f"{result!r} is no {short_name(action_type.Result)}")
        except Exception as error:  # noqa: BLE001 - the goal must end whatever its script does
            finish, reason = Finish.FAULT, self._broken(f"it has no result: {raised(error)}")
            result = action_type.Result()
        status = self._wire.end(self.goal_id, _STATUSES.get(finish, STATUS_ABORTED))
        more = {"reason": reason} if reason else {}
        self._record(_EVENTS.get(status, Event.ABORTED), **more)
        self._owner.ended(self, result)

    def _broken(self, reason: str) -> str:
        self._owner.broken(self.goal_id, reason)
        return reason

    def _record(self, event: Event, **more: object) -> None:
        self._owner.record(self.goal_id, event, **self._owner.state(self.motion), **more)
