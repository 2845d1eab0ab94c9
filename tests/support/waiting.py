"""Waiting for a condition, with a deadline. Nothing here waits for time alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar

Value = TypeVar("Value")


def until(
    condition: Callable[[], Value],
    within: float = 10.0,
    *,
    what: str = "",
    meanwhile: Callable[[], object] = lambda: None,
) -> Value:
    """Return the first true value of `condition`, calling `meanwhile` before each look at it.

    Fails the test when there was none within so many seconds.
    """
    deadline = time.monotonic() + within
    while True:
        meanwhile()
        value = condition()
        if value:
            return value
        if time.monotonic() >= deadline:
            raise AssertionError(f"not within {within:g} s: {what or condition.__name__}")
        threading.Event().wait(0.005)


def holds_for(condition: Callable[[], bool], seconds: float) -> bool:
    """Return whether `condition` holds at each look for so many seconds."""
    deadline = time.monotonic() + seconds
    while condition():
        if time.monotonic() >= deadline:
            return True
        threading.Event().wait(0.005)
    return False
