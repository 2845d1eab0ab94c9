"""What an action is doing at this moment, for whoever shows it. Values only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Progress:
    """What an action is doing at this moment."""

    state: str
    """A goal's state, or IDLE before the first visit, BACKOFF between two attempts."""
    attempt: int
    attempts: int
    feedback: Any
    """The latest feedback message, or None."""
    seconds_left: float | None
    deadline: str
    """The field of Timeouts that `seconds_left` belongs to, or ``backoff``."""
