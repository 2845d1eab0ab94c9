"""The wishes of a user: how long to wait, how often to try, and what to do about a taken resource.

Values only: frozen, checked when made, compared by content. No ROS, no clock, no behaviour. Nothing
here decides the course of a goal (table.py, steps/), or another attempt (attempts.py).
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Outcome(StrEnum):
    """The reason why a leaf stopped."""

    SUCCEEDED = "SUCCEEDED"
    """The server succeeded, and ``expect`` holds."""
    UNEXPECTED_RESULT = "UNEXPECTED_RESULT"
    """The server succeeded, but ``expect`` does not hold."""
    REJECTED = "REJECTED"
    """The server refused the goal."""
    ABORTED = "ABORTED"
    """The server gave up; its result is kept."""
    CANCELED = "CANCELED"
    """This process stopped the goal, whatever status it ended with."""
    CANCELED_BY_OTHER = "CANCELED_BY_OTHER"
    """The goal ended as canceled, and this process had not asked for that."""
    SERVER_UNAVAILABLE = "SERVER_UNAVAILABLE"
    """No server within ``Timeouts.server``."""
    SERVER_AMBIGUOUS = "SERVER_AMBIGUOUS"
    """Two live servers under the name: a goal would be, or may be, executed twice.

    A new process may see one of them first, and so sends no goal in its first second.
    """
    SERVER_BUSY = "SERVER_BUSY"
    """The resource was not free within ``Timeouts.queue``."""
    ACCEPT_TIMEOUT = "ACCEPT_TIMEOUT"
    """The goal request was not answered within ``Timeouts.accept``; the goal may have been
    executed."""
    RESULT_TIMEOUT = "RESULT_TIMEOUT"
    """The goal was not finished within ``Timeouts.result``."""
    STALLED = "STALLED"
    """No feedback for ``Timeouts.feedback``."""
    SERVER_LOST = "SERVER_LOST"
    """The server died or was restarted under the goal."""
    INVALID_GOAL = "INVALID_GOAL"
    """The goal message could not be built; nothing was sent."""


class End(StrEnum):
    """The standing of a goal on its server."""

    SUCCEEDED = "SUCCEEDED"
    """The word of the server, as are the next two."""
    ABORTED = "ABORTED"
    CANCELED = "CANCELED"
    NEVER_STARTED = "NEVER_STARTED"
    """The goal was not sent, or refused, or denied by its server; within 30 s of a denial it may
    turn up."""
    SERVER_GONE = "SERVER_GONE"
    """The server went away with the goal; should it come back, the goal is canceled first."""
    UNKNOWN = "UNKNOWN"
    """The goal may still be running."""


class Busy(StrEnum):
    """The ways to treat a goal whose resource is taken."""

    @classmethod
    def _missing_(cls, value: object) -> Busy:
        raise ValueError(f"busy must be one of {', '.join(cls)}, not {value!r}")

    WAIT = "wait"
    """Queue for the resource, first come first served."""
    REPLACE = "replace"
    """Send at once, or when an older goal's request is answered; the older goal must end."""
    FAIL = "fail"
    """Give up at once with SERVER_BUSY."""
    SHARE = "share"
    """Send at once, beside the other goals."""


RETRIED_BY_DEFAULT = frozenset(
    {
        Outcome.UNEXPECTED_RESULT,
        Outcome.REJECTED,
        Outcome.ABORTED,
        Outcome.SERVER_UNAVAILABLE,
        Outcome.SERVER_BUSY,
        Outcome.RESULT_TIMEOUT,
        Outcome.STALLED,
    }
)
RETRIED_IF_NAMED = frozenset({Outcome.ACCEPT_TIMEOUT, Outcome.SERVER_LOST})
"""Outcomes after which the goal may have been executed, in part or whole: another attempt is the
user's decision."""
RETRYABLE = RETRIED_BY_DEFAULT | RETRIED_IF_NAMED


def _seconds(field: str, value: Any, *, zero: bool) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{field} must be a number of seconds, not {value!r}")
    if not 0 <= value <= sys.float_info.max or (value == 0 and not zero):
        least = "zero or more" if zero else "more than zero"
        raise ValueError(f"{field} must be {least} and finite, not {value!r:.40}")
    return float(value)


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Deadlines of one attempt, in seconds; None means no deadline.

    queue, server, accept and cancel run on the steady clock; result and feedback on the node's
    clock, so that they follow simulated time.

    Raises ValueError when a field is no positive, finite number.
    """

    queue: float | None = 10.0
    """For the resource to become free."""
    server: float | None = 5.0
    """For a server to be there."""
    accept: float | None = 5.0
    """From the goal request to its answer."""
    result: float | None = None
    """From acceptance to the result."""
    feedback: float | None = None
    """Longest silence between acceptance, each feedback and the result."""
    cancel: float | None = 5.0
    """From the wish to cancel an accepted goal to its terminal status."""

    def __post_init__(self) -> None:
        for field in self.__dataclass_fields__:
            value = getattr(self, field)
            if value is not None:
                object.__setattr__(self, field, _seconds(f"timeout.{field}", value, zero=False))

    @classmethod
    def of(cls, value: Timeouts | float | None) -> Timeouts:
        """Return `value` as Timeouts: None means the defaults, a bare number the result."""
        return value if isinstance(value, Timeouts) else cls(result=value)


@dataclass(frozen=True, slots=True)
class Retry:
    """The number of attempts of an action, and the outcomes that allow another.

    `attempts` counts all tries. The pause after try n is ``min(backoff * factor ** (n - 1),
    max_backoff)`` seconds, varied by up to ``jitter`` times itself in both directions. `when` is
    asked with the result of an attempt that has one (a callable, or an expression over ``result``);
    without `when` every outcome in `outcomes` is retried.

    `outcomes` has limits: no attempt begins beside a goal whose end is UNKNOWN, nor, unless
    SERVER_LOST is among them, SERVER_GONE; a goal that has SUCCEEDED is tried again only for
    UNEXPECTED_RESULT.

    Raises ValueError when a field is out of its range, or an outcome can never be retried.
    """

    attempts: int = 1
    backoff: float = 0.0
    factor: float = 2.0
    max_backoff: float = 60.0
    jitter: float = 0.0
    outcomes: Collection[Outcome | str] = RETRIED_BY_DEFAULT
    when: Callable[[Any], bool] | str | None = None

    def __post_init__(self) -> None:
        attempts = self.attempts
        if isinstance(attempts, bool) or not isinstance(attempts, int) or attempts < 1:
            raise ValueError(f"retry.attempts must be a whole number from 1 on, not {attempts!r}")
        for field in ("backoff", "factor", "max_backoff", "jitter"):
            checked = _seconds(f"retry.{field}", getattr(self, field), zero=field != "factor")
            object.__setattr__(self, field, checked)
        if self.factor < 1.0:
            raise ValueError(f"retry.factor must be 1 or more, not {self.factor!r}")
        if self.jitter > 1.0:
            raise ValueError(f"retry.jitter must lie between 0 and 1, not {self.jitter!r}")
        object.__setattr__(self, "outcomes", _outcomes(self.outcomes))
        if self.when is not None and not callable(self.when) and not isinstance(self.when, str):
            raise ValueError("retry.when must be a callable on the result or an expression as text")

    @classmethod
    def of(cls, value: Retry | int) -> Retry:
        """Return `value` as Retry: a bare number means the attempts."""
        return value if isinstance(value, Retry) else cls(attempts=value)

    def pause(self, attempt: int, chance: random.Random | None = None) -> float:
        """Return the seconds to wait after `attempt` (from 1) before the next; or their mean."""
        if self.backoff == 0.0:
            return 0.0
        try:
            pause = min(self.backoff * self.factor ** (attempt - 1), self.max_backoff)
        except OverflowError:
            pause = self.max_backoff
        return pause * (1.0 + self.jitter * chance.uniform(-1.0, 1.0)) if chance else pause


def _outcomes(values: Iterable[Outcome | str]) -> frozenset[Outcome]:
    if isinstance(values, str):
        raise ValueError("retry.outcomes must be a collection of outcomes, not one text")
    named = set()
    for value in values:
        try:
            outcome = Outcome(value)
        except ValueError:
            known = ", ".join(sorted(RETRYABLE))
            raise ValueError(f"retry.outcomes: no outcome {value!r}; there are {known}") from None
        if outcome not in RETRYABLE:
            raise ValueError(f"retry.outcomes: {outcome} is never retried")
        named.add(outcome)
    return frozenset(named)
