"""What a goal means to the server that serves it. Subclasses fill it in; nothing here moves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, Protocol

# Messages are Any in this package: rosidl gives them no common base.


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


class Finish(Enum):
    """Why a goal ended."""

    COMPLETED = "completed"
    CANCELED = "canceled"
    TIMEOUT = "timeout"
    """The server's own limit on how long a goal may take."""
    REPLACED = "replaced"
    """A newer goal took its place."""
    FAULT = "fault"


class GoalMeaning(ABC):
    """The part of a simulated server that knows its action type.

    What these methods raise refuses or aborts the goal; it never reaches the executor.
    """

    action_type: Any

    @abstractmethod
    def refusal(self, goal: Any) -> str | None:
        """Return why `goal` is refused, or None."""

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
        """Return how a goal that is done ends, and why where that is not COMPLETED."""
        return Finish.COMPLETED, ""

    def halt(self, motion: Motion) -> None:  # noqa: B027 - nothing moves everywhere
        """Stand still: the goal has ended before it was done, or the server has died."""

    def drop_part(self) -> None:  # noqa: B027 - not every server has a part
        """Let the part fall, where there is one: the fault drop_part strikes."""

    def state(self, motion: Motion) -> Mapping[str, float]:
        """Return what the journal says of a step."""
        return {"progress": round(motion.progress, 4)}
