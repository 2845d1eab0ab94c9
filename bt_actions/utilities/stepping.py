"""The results of a step, for work that goes on in steps: the time of the next step, or the end.

The caller brings the clock and the wait: a thread, or a test in virtual time. Values only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Sleep:
    """Another step in so many seconds, or at a wake-up before."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Done(Generic[T]):
    """The end: no step follows."""

    result: T
