"""An action server for any action type that does what a script says: for tests, and for users.

It has no world: a goal takes its time, gives feedback, and ends. The faults are those of the robot.
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
    """What a ScriptedServer does with a goal, unless a fault strikes it."""

    duration: float | Callable[[Any], float] = 0.5
    """Seconds of simulated time a goal takes, or a function of the goal."""
    feedback: Callable[[Any, float], Any] | None = None
    """From the goal and its progress (0 to 1) to the feedback message; None: an empty one."""
    result: Callable[[Any], Any] | None = None
    """From the goal to the result message of a goal that succeeds; None: an empty one."""
    refuse: Callable[[Any], str | None] | None = None
    """From the goal to why it is refused, or None; None: nothing is."""
    aborts: Callable[[Any], str | None] | None = None
    """From the goal to why it is aborted at its end, or None; None: nothing is."""
    preempts: bool = False
    """A newer goal aborts the older ones. Otherwise goals run beside each other."""


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
        return self._elapsed >= self._duration - 1e-9  # of adding up periods

    def step(self, share: float) -> None:
        self._elapsed += self._period * share


class ScriptedServer(SimulatedServer):
    """Serves any action type; see Script for what it does with a goal."""

    def __init__(
        self,
        node: Any,
        action_type: Any,
        name: str,
        script: Script | None = None,
        **settings: Any,
    ) -> None:
        """Serve `action_type` under `name` on `node`; `settings` are those of SimulatedServer.

        What a script's functions raise refuses or aborts the goal, with the exception as the reason
        in log and journal.
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
