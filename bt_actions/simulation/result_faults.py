"""The faults drop_result and delay_result, which keep back answers to result requests. No ROS."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from bt_actions.simulation.fault_plan import GoalFaults
from bt_actions.simulation.faults import FaultKind
from bt_actions.simulation.stepper import Stepper


class _Kept:
    def __init__(self, faults: GoalFaults) -> None:
        dropped = FaultKind.DROP_RESULT in faults
        count = faults.number(FaultKind.DROP_RESULT)
        self.to_drop = 0.0 if not dropped else math.inf if count is None else count
        self.delay = faults.number(FaultKind.DELAY_RESULT) or 0.0
        self.ended: float | None = None
        self.waiting: list[Any] = []


class ResultFaults:
    """The goals whose results are lost or late, from their acceptance until they are forgotten."""

    def __init__(self, stepper: Stepper, answer: Callable[[Any], None]) -> None:
        """Make the register; `answer` is called with a request once its time has come."""
        self._stepper = stepper
        self._answer = answer
        self._goals: dict[str, _Kept] = {}

    def expect(self, goal_id: str, faults: GoalFaults) -> None:
        """Take note that a goal was accepted."""
        if FaultKind.DROP_RESULT in faults or FaultKind.DELAY_RESULT in faults:
            self._goals[goal_id] = _Kept(faults)

    def on_request(self, goal_id: str, taken: Any) -> bool:
        """Return whether to answer a result request now; else the answer is lost or comes later."""
        kept = self._goals.get(goal_id)
        if kept is None:
            return True
        if kept.to_drop > 0:
            kept.to_drop -= 1
            return False
        if not kept.delay:
            return True
        if kept.ended is None:
            kept.waiting.append(taken)
            return False
        due = kept.ended + kept.delay
        if self._stepper.now() >= due:
            return True
        self._answer_at(due, taken)
        return False

    def ended(self, goal_id: str, now: float, remembered: float) -> None:
        """Take note that a goal has ended, and is remembered for so many seconds."""
        kept = self._goals.get(goal_id)
        if kept is None:
            return
        kept.ended = now
        for taken in kept.waiting:
            self._answer_at(now + kept.delay, taken)
        kept.waiting.clear()
        forget = now + kept.delay + remembered
        self._stepper.call_at(forget, partial(self._forget, goal_id))

    def _answer_at(self, when: float, taken: Any) -> None:
        self._stepper.call_at(when, lambda now: self._answer(taken))

    def _forget(self, goal_id: str, now: float) -> None:
        self._goals.pop(goal_id, None)

    def clear(self) -> None:
        """Forget all goals: the server has died."""
        self._goals.clear()
