"""The attempts of one action until an outcome stands: which is under way, and when the next may be.

The object gets every outcome, keeps the history and answers "again?". No ROS, no thread, no clock
of its own. Nothing here sends anything, or knows a goal's states (goal.py).
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bt_actions.goals.goal import Goal
from bt_actions.goals.policy import RETRYABLE, End, Outcome, Retry
from bt_actions.goals.terms import NEVER, Now
from bt_actions.utilities.plain_text import in_words


@dataclass(slots=True)
class AttemptRecord:
    """One attempt, as `ActionBehaviour.history` shows it.

    Times are seconds on the node's clock. `end` is read from the goal each time, because an end
    that is UNKNOWN when the leaf stops may still become known.
    """

    attempt: int
    outcome: Outcome
    reason: str
    started: float
    ended: float
    result: Any
    goal: Goal

    @property
    def goal_id(self) -> str:
        """The goal's UUID in hexadecimal."""
        return self.goal.id.hex()

    @property
    def end(self) -> End:
        """The end of the goal, as far as is known by now."""
        return self.goal.end

    @property
    def late(self) -> bool:
        """Whether the result came after a deadline, while the goal was being canceled."""
        return self.goal.late

    @property
    def duration(self) -> float:
        """Seconds from the wish to the outcome."""
        return self.ended - self.started


class Attempts:
    """The attempts of one visit to a leaf."""

    def __init__(self, retry: Retry, when: Callable[[Any], bool] | None) -> None:
        """Begin a visit; `when` is `retry.when` made callable, and an error in it means no."""
        self.retry = retry
        self.history: list[AttemptRecord] = []
        self._when = when
        self._resume_at = NEVER
        self._ros_seen = 0.0

    @property
    def attempt(self) -> int:
        """The number of the attempt that is under way or comes next, from 1."""
        return len(self.history) + 1

    def again(self, record: AttemptRecord, chance: random.Random) -> bool:
        """File `record`; return whether another attempt follows after a pause."""
        self.history.append(record)
        why_not = self._why_not(record) if len(self.history) < self.retry.attempts else ""
        if why_not:
            record.reason += f" (not tried again: {why_not})"
        if why_not is not None:
            return False
        self._resume_at = record.ended + self.retry.pause(len(self.history), chance)
        self._ros_seen = record.ended
        return True

    def pause_left(self, now: Now, *, look_only: bool = False) -> float:
        """Return the seconds until the next attempt may begin.

        The rest stays where the clock jumps back.

        `look_only` changes nothing, so that any thread may ask.
        """
        resume_at = self._resume_at - max(0.0, self._ros_seen - now.ros)
        if not look_only:
            self._resume_at, self._ros_seen = resume_at, now.ros
        return max(0.0, resume_at - now.ros)

    def _why_not(self, record: AttemptRecord) -> str | None:
        """Return the reason against another attempt: "" where that is plain.

        None where one follows.
        """
        if record.outcome not in self.retry.outcomes:
            known = record.outcome in RETRYABLE
            return f"{record.outcome} is not among the outcomes of retry" if known else ""
        if record.end is End.UNKNOWN:
            return "it may still be running"
        if record.end is End.SERVER_GONE and Outcome.SERVER_LOST not in self.retry.outcomes:
            return "its server went away, and it may still be running there"
        if record.end is End.SUCCEEDED and record.outcome is not Outcome.UNEXPECTED_RESULT:
            return "it has succeeded, though its result was lost"
        if self._when is not None and record.result is not None:
            try:
                return None if self._when(record.result) else ""
            except Exception as error:  # noqa: BLE001 - the user's: any
                return f"retry.when: {in_words(error)}"
        return None
