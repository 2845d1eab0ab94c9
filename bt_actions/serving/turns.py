"""The turns of goals: running, waiting, and refused ones. Pure; no ROS, no thread.

The caller holds a lock around each call.
"""

from __future__ import annotations

import enum
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Policy(enum.StrEnum):
    """The ways to treat a goal that comes while another runs."""

    REJECT = "reject"
    QUEUE = "queue"
    """The newer goal waits; at most `most` do."""
    REPLACE = "replace"
    """The older goal is halted, and the newer begins when all goals of the older have ended."""
    PARALLEL = "parallel"
    """The goals run beside each other, at most `most`."""


class Turns(Generic[T]):
    """The goals that were admitted and have not ended."""

    def __init__(self, policy: Policy, most: int) -> None:
        if most < 1:
            raise ValueError(f"most must be 1 at least, not {most!r}")
        self.policy, self.most = policy, most
        self.expected = 0
        """Goals that were admitted and have not come yet."""
        self.running: list[T] = []
        self.waiting: deque[T] = deque()

    def refusal(self) -> str:
        """Return why no more goal can be admitted at this moment; or ""."""
        there = len(self.running) + len(self.waiting) + self.expected
        if self.policy is Policy.REJECT and there:
            return "another tree runs here"
        if self.policy is Policy.QUEUE and there > self.most:
            return f"{self.most} goals wait already"
        if self.policy is Policy.PARALLEL and there >= self.most:
            return f"{self.most} trees run already"
        return ""

    def come(self, goal: T) -> tuple[list[T], list[T]]:
        """Take a goal that was admitted. Return the goals to begin, and the goals to halt.

        A halted goal still has to `leave`, also one that only waited.
        """
        self.expected = max(0, self.expected - 1)
        self.waiting.append(goal)
        halted = []
        if self.policy is Policy.REPLACE:
            halted = [*self.running, *list(self.waiting)[:-1]]
        return self._next(), halted

    def leave(self, goal: T) -> list[T]:
        """Take note that a goal has ended, waiting or not. Return the goals to begin."""
        if goal in self.running:
            self.running.remove(goal)
        elif goal in self.waiting:
            self.waiting.remove(goal)
        return self._next()

    def _next(self) -> list[T]:
        room = self.most if self.policy is Policy.PARALLEL else 1
        begun = []
        while self.waiting and len(self.running) < room:
            begun.append(self.waiting.popleft())
            self.running.append(begun[-1])
        return begun
