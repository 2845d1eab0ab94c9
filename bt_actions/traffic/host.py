"""The seam to what a process gives: its clock, its lock, ids, the log, the record, the wake-up.

One host a process with rclpy (ros/host.py), or one a simulated run (testing/host.py). All that
goals share beyond their endpoints hangs on it, so that nothing hangs on a module.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

from bt_actions.goals.terms import Command, Event
from bt_actions.traffic.handle import Domain, GoalHandle
from bt_actions.traffic.scheduler import Scheduler
from bt_actions.traffic.stalls import Stalls


class Log(Protocol):
    """Takes lines from any thread, and never waits."""

    def info(self, text: str) -> None:
        """Log at info level."""

    def warning(self, text: str) -> None:
        """Log at warning level."""

    def error(self, text: str) -> None:
        """Log at error level."""

    def flush(self) -> None:
        """Have what was said written, before more is told by other ways; waits a moment at most."""


@dataclass(frozen=True, slots=True)
class Entry:
    """What is on record of a goal."""

    action: str
    domain: int
    """ROS domain id."""
    servers: frozenset[bytes]
    """GIDs of the servers that were in sight; none where they are not known."""
    accept: float = 0.0
    """Seconds that its server is given to decide; 0: nobody said."""
    lost: bool = False
    """They have gone, as far as is known; but they may only stand still."""


class Record:
    """What was sent and is not answered yet, should the process be killed; this one keeps nothing.

    recovery/ledger.py has one that does.
    """

    def __contains__(self, goal_id: bytes) -> bool:
        """Whether a goal is on record."""
        return False

    def enter(self, goal_id: bytes, entry: Entry) -> None:
        """Put a goal on record that is about to be sent, or what more is known of it."""

    def strike(self, goal_id: bytes) -> None:
        """Take a goal off the record, if it is there."""

    def close(self) -> None:
        """Take note that the process ends."""

    def disown(self) -> None:
        """Let go of it, as the child of a fork: it is the parent's."""


class Trace:
    """Is told of every step of every goal, under the lock; this one takes no note."""

    def tells(self, handle: GoalHandle, event: Event) -> None:
        """A goal is about to be told what happened."""

    def told(
        self, handle: GoalHandle, event: Event, detail: Any, commands: tuple[Command, ...]
    ) -> None:
        """A goal was told what happened, and returned these commands."""

    def shows_time(self, handle: GoalHandle) -> None:
        """A goal is about to be shown the time."""


class Host(Protocol):
    """What the goals of a process, or of one simulated run, have in common."""

    @property
    def lock(self) -> AbstractContextManager[Any]:
        """The one lock; whoever holds it may take it again. Nothing waits under it."""

    @property
    def log(self) -> Log:
        """Where lines go."""

    record: Record
    """Where a goal is put before it is sent."""

    stalls: Stalls
    """When this process stood still, and what it may not conclude yet."""

    scheduler: Scheduler
    """The endpoints with open goals."""

    trace: Trace
    """Who watches the goals' steps."""

    forks: int
    """Forks between the first process and this one: what an older one made is not ours."""

    closing: bool
    """Whether the process ends: a tree that ticks on begins nothing any more."""

    def domain(self, number: int) -> Domain:
        """Return what is shared in the ROS domain of this number."""

    def wait(self, timeout: float) -> bool:
        """Wait for a change of any goal, at most so many seconds; the caller holds the lock."""

    def notify_all(self) -> None:
        """Wake whoever waits, as a goal has changed; the caller holds the lock."""

    def steady(self) -> float:
        """Return seconds that only ever go forward."""

    def new_goal_id(self) -> bytes:
        """Return 16 bytes that no goal has had."""
