"""One goal as its server executes it: what each step does, and when and how it ends.

The faults act here, once for all servers. No ROS, no clock: steps and times are passed in, and what
is to be done comes back as a value. An execution never reports an end twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Protocol

from bt_actions.simulation.fault_plan import NO_FAULTS, GoalFaults
from bt_actions.simulation.faults import FaultKind

FLOOD_AT_ONCE = 1000
"""A flood never gives more feedback than this in one step."""


class Motion(Protocol):
    """What a goal makes its server do."""

    @property
    def progress(self) -> float:
        """How much of the way is behind it, 0 to 1."""

    @property
    def done(self) -> bool:
        """It has arrived: nothing moves any more."""

    def step(self, share: float) -> None:
        """Move for one step of simulated time; with `share` under 1, by so much less."""


class Finish(StrEnum):
    """Why an execution ended."""

    COMPLETED = "completed"
    CANCELED = "canceled"
    TIMEOUT = "timeout"
    """The server's own limit on how long a goal may take."""
    REPLACED = "replaced"
    """A newer goal took its place."""
    FAULT = "fault"


class CancelAnswer(Enum):
    """What the server does with a request to cancel."""

    ACCEPT = "accept"
    REJECT = "reject"
    DROP = "drop"
    """No answer at all."""
    DIE = "die"


@dataclass(frozen=True, slots=True)
class Happened:
    """What the server has to carry out now."""

    feedback: int = 0
    """How many feedback messages to send."""
    finish: Finish | None = None
    reason: str = ""
    drop_part: bool = False
    die: bool = False
    restart_after: float | None = None
    """Die, and be back after so many seconds."""


NOTHING = Happened()


class Execution:
    """A goal from its acceptance to its end.

    Call `step` every step of simulated time while `moving`, and `poll` when `due` has come and
    after the server has agreed to a cancel; `now` is in seconds of one steady clock.
    """

    def __init__(
        self,
        motion: Motion,
        faults: GoalFaults = NO_FAULTS,
        *,
        now: float,
        time_limit: float | None = None,
    ) -> None:
        """Begin at `now`; `time_limit` is in seconds of simulated time."""
        self.motion = motion
        self.faults = faults
        self.over = False
        self._accepted = now
        self._last_feedback = now
        self._limit = time_limit
        self._elapsed = 0.0
        self._stalled = False
        self._part_dropped = False
        self._cancel_asked = False
        self._cancel_at: float | None = None

    def __repr__(self) -> str:
        state = "over" if self.over else "moving" if self.moving else "standing"
        return f"<Execution {state} {self.motion.progress:.0%} {self.faults}>"

    @property
    def moving(self) -> bool:
        """It wants to be stepped."""
        return not (self.over or self._stalled or self._cancel_at is not None)

    @property
    def due(self) -> float | None:
        """When `poll` has to be called although nothing moves; None: never."""
        return None if self.over else self._cancel_at

    def step(self, now: float, period: float) -> Happened:
        """Move for one step of `period` seconds of simulated time."""
        if not self.moving:
            return NOTHING
        self._elapsed += period
        if not self.motion.done:
            self.motion.step(1.0 / (self.faults.number(FaultKind.SLOW) or 1.0))
        if self.faults:
            struck = self._strike(now)
            if struck is not NOTHING:
                return struck
        feedback = self._feedback(now)
        if self.motion.done:
            return self._end(Finish.COMPLETED, feedback=feedback)
        if self._limit is not None and self._elapsed > self._limit - period / 2:
            reason = f"not finished within {self._limit:g} s of simulated time"
            return self._end(Finish.TIMEOUT, reason, feedback=feedback)
        return Happened(feedback)

    def cancel(self, now: float) -> CancelAnswer:
        """Answer a request to cancel. After ACCEPT, call `poll` once the goal is being canceled."""
        if self.faults.dies("cancel"):
            return CancelAnswer.DIE
        if FaultKind.DROP_CANCEL in self.faults:
            return CancelAnswer.DROP
        if self.over or FaultKind.REJECT_CANCEL in self.faults:
            return CancelAnswer.REJECT
        if not self._cancel_asked:
            self._cancel_asked = True
            if FaultKind.IGNORE_CANCEL not in self.faults:
                self._cancel_at = now + (self.faults.number(FaultKind.DELAY_CANCEL) or 0.0)
        return CancelAnswer.ACCEPT

    def poll(self, now: float) -> Happened:
        """Return the end that a cancel brings, once its time has come."""
        if self.over or self._cancel_at is None or now < self._cancel_at:
            return NOTHING
        if FaultKind.SUCCEED_ON_CANCEL in self.faults:
            return self._end(Finish.COMPLETED, "finished before it could be canceled")
        if FaultKind.ABORT_ON_CANCEL in self.faults:
            return self._end(Finish.FAULT, "fault: abort_on_cancel")
        return self._end(Finish.CANCELED)

    def replace(self) -> Happened:
        """End, because a newer goal takes its place."""
        return NOTHING if self.over else self._end(Finish.REPLACED, "replaced by a newer goal")

    def give_up(self, reason: str) -> Happened:
        """End, because the server cannot go on."""
        return NOTHING if self.over else self._end(Finish.FAULT, reason)

    def _strike(self, now: float) -> Happened:
        if self._time_for(FaultKind.DIE, now) and self.faults.dies("execute"):
            return Happened(die=True)
        if FaultKind.RESTART in self.faults and self._half_way:
            return Happened(die=True, restart_after=self.faults.number(FaultKind.RESTART))
        if self._time_for(FaultKind.ABORT, now):
            return self._end(Finish.FAULT, "fault: abort")
        dropped = self._time_for(FaultKind.DROP_PART, now) and not self._part_dropped
        self._part_dropped = self._part_dropped or dropped
        if self._time_for(FaultKind.STALL, now):
            self._stalled = True
            return Happened(drop_part=dropped)
        if not dropped:
            return NOTHING
        # The goal itself goes on; one feedback less is not missed.
        return Happened(drop_part=True)

    def _time_for(self, kind: FaultKind, now: float) -> bool:
        if kind not in self.faults:
            return False
        seconds = self.faults.number(kind)
        if seconds is not None and now - self._accepted >= seconds:
            return True
        return self.motion.done if seconds is not None else self._half_way

    @property
    def _half_way(self) -> bool:
        return self.motion.done or self.motion.progress >= 0.5

    def _feedback(self, now: float) -> int:
        if FaultKind.NO_FEEDBACK in self.faults:
            return 0
        hertz = self.faults.number(FaultKind.FLOOD)
        if hertz is None:
            return 1
        wanted = max(1, min(FLOOD_AT_ONCE, int((now - self._last_feedback) * hertz)))
        self._last_feedback = now
        return wanted

    def _end(self, finish: Finish, reason: str = "", *, feedback: int = 0) -> Happened:
        self.over = True
        return Happened(feedback, finish, reason)
