"""What a step of something that goes on in steps returns: when to step again, or what came of it.

So whoever steps it brings the clock and the wait: a thread, or a test in virtual time. Values only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Sleep:
    """Step again in so many seconds, or as soon as something wakes it."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Done(Generic[T]):
    """It is over; there is nothing to step any more."""

    result: T
