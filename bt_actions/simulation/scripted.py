"""An action server for any action type that follows a script: for tests, and for users.

The server has no world: a goal takes its time, gives feedback, and ends. The faults are those of
the robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bt_actions.simulation.goal_meaning import Finish
from bt_actions.simulation.server import SimulatedServer

# Messages are Any here: rosidl gives them no common base.


@dataclass(frozen=True, slots=True)
class Script:
    """The treatment of a goal by a ScriptedServer, unless a fault strikes it."""

    duration: float | Callable[[Any], float] = 0.5
    """Seconds of simulated time that a goal takes, or a function of the goal."""
    feedback: Callable[[Any, float], Any] | None = None
    """From the goal and its progress (0 to 1) to the feedback message; None: an empty one."""
    result: Callable[[Any], Any] | None = None
    """From the goal to the result message of a goal that succeeds; None: an empty one."""
    refuse: Callable[[Any], str | None] | None = None
    """From the goal to the reason to refuse it, or None; None refuses nothing."""
    aborts: Callable[[Any], str | None] | None = None
    """From the goal to the reason to abort it at its end, or None; None aborts nothing."""
    preempts: bool = False
    """Whether a newer goal aborts the older ones; otherwise goals run beside each other."""


class _Wait:
    def __init__(self, goal: Any, duration: float, period: float) -> None:
        if not math.isfinite(duration) or duration < 0:
            raise ValueError(f"the duration must be zero or more and finite, not {duration!r}")
        self.goal = goal
        self._duration = duration
        self._period = period
        self._elapsed = 0.0

    @property
    def progress(self) -> float:
        return min(1.0, self._elapsed / self._duration) if self._duration else 1.0

    @property
    def done(self) -> bool:
        return self._elapsed >= self._duration - 1e-9  # the error of adding up periods

    def step(self, share: float) -> None:
        self._elapsed += self._period * share


class ScriptedServer(SimulatedServer):
    """A server of any action type; Script has the treatment of a goal."""

    def __init__(
        self,
        node: Any,
        action_type: Any,
        name: str,
        script: Script | None = None,
        **settings: Any,
    ) -> None:
        """Serve `action_type` under `name` on `node`; `settings` are those of SimulatedServer.

        An error in a script's functions refuses or aborts the goal, and is the reason in log and
        journal.
        """
        self.script = script or Script()
        defaults = {"step_period": 0.05, "preempts": self.script.preempts}
        super().__init__(node, action_type, name, **defaults | settings)

    def refusal(self, goal: Any) -> str | None:
        return self.script.refuse(goal) if self.script.refuse else None

    def begin(self, goal: Any) -> _Wait:
        duration = self.script.duration
        seconds = duration(goal) if callable(duration) else duration
        return _Wait(goal, seconds, self.stepper.step_period)

    def verdict(self, motion: Any) -> tuple[Finish, str]:
        why = self.script.aborts(motion.goal) if self.script.aborts else None
        return (Finish.FAULT, why) if why else (Finish.COMPLETED, "")

    def feedback(self, motion: Any) -> Any:
        if self.script.feedback:
            return self.script.feedback(motion.goal, motion.progress)
        return self.action_type.Feedback()

    def result(self, motion: Any, finish: Finish, reason: str) -> Any:
        if finish is not Finish.COMPLETED:
            return self.action_type.Result()
        return self.script.result(motion.goal) if self.script.result else self.action_type.Result()
