"""The meaning of a goal to its server. Subclasses define it; nothing here moves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, Protocol

# Messages are Any in this package: rosidl gives them no common base.


class Motion(Protocol):
    """The work that a goal makes its server do."""

    @property
    def progress(self) -> float:
        """The share of the way that is done, 0 to 1."""

    @property
    def done(self) -> bool:
        """Whether the motion has arrived: nothing moves any more."""

    def step(self, share: float) -> None:
        """Move for one step of simulated time, or for `share` of one."""


class Finish(Enum):
    """The reason why a goal ended."""

    COMPLETED = "completed"
    CANCELED = "canceled"
    TIMEOUT = "timeout"
    """The server's own time limit for a goal."""
    REPLACED = "replaced"
    """A newer goal took its place."""
    FAULT = "fault"


class GoalMeaning(ABC):
    """The part of a simulated server that knows its action type.

    An error in these methods refuses or aborts the goal, and never reaches the executor.
    """

    action_type: Any

    @abstractmethod
    def refusal(self, goal: Any) -> str | None:
        """Return the reason to refuse `goal`, or None."""

    @abstractmethod
    def begin(self, goal: Any) -> Motion:
        """Set out for `goal`."""

    @abstractmethod
    def feedback(self, motion: Motion) -> Any:
        """Return the feedback message."""

    @abstractmethod
    def result(self, motion: Motion, finish: Finish, reason: str) -> Any:
        """Return the result message of a goal that has ended."""

    def due_feedback(self, motion: Motion) -> Sequence[Any]:
        """Return the feedback messages of a step."""
        return (self.feedback(motion),)

    def verdict(self, motion: Motion) -> tuple[Finish, str]:
        """Return the end of a goal that is done, and the reason where that is not COMPLETED."""
        return Finish.COMPLETED, ""

    def halt(self, motion: Motion) -> None:  # noqa: B027 - nothing moves everywhere
        """Stand still: the goal has ended before it was done, or the server has died."""

    def drop_part(self) -> None:  # noqa: B027 - not every server has a part
        """Let a held part fall: the fault drop_part strikes."""

    def state(self, motion: Motion) -> Mapping[str, float]:
        """Return the values of a step for the journal."""
        return {"progress": round(motion.progress, 4)}
