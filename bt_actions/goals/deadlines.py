"""The deadlines of one goal, on two clocks.

Answers of the server are waited for on the steady clock; what the robot does, on the ROS clock,
which may stand still or jump back: then what remained of a deadline still remains. It has no clock
of its own, and does not know what a deadline means (goal.py).
"""

from __future__ import annotations

from operator import itemgetter

from bt_actions.goals.terms import NEVER, ON_ROS_CLOCK, Event, Now


class Deadlines:
    """Moments by which something must have happened, each named by the event that it is if not."""

    def __init__(self, now: Now) -> None:
        self.now = now
        """The last moment of which it was told."""
        self._due: dict[Event, float] = {}
        self._not_before = NEVER

    def arm(self, event: Event, seconds: float | None) -> None:
        """Let `event` fall due in so many seconds, not earlier or later; None leaves it alone."""
        if seconds is not None:
            now = self.now.ros if event in ON_ROS_CLOCK else self.now.steady
            self._due[event] = now + seconds

    def __contains__(self, event: Event) -> bool:
        """Return whether this deadline is set."""
        return event in self._due

    def disarm(self, *events: Event) -> None:
        """Forget these."""
        for event in events:
            self._due.pop(event, None)

    def clear(self) -> None:
        """Forget all."""
        self._due.clear()

    def left(self, now: Now) -> list[tuple[float, Event]]:
        """Return the seconds until each, the earliest first; negative where it has passed."""
        suspended = self._not_before - now.steady
        waits = [(self._left(event, now), event) for event in self._due]
        waits.sort(key=itemgetter(0))
        return [(max(left, suspended), event) for left, event in waits]

    def take_passed(self, event: Event, now: Now) -> bool:
        """Return whether this deadline has passed; it is forgotten then."""
        if event not in self._due or now.steady < self._not_before or self._left(event, now) > 0.0:
            return False
        del self._due[event]
        return True

    def postpone(self, seconds: float) -> None:
        """Give all of them so much more time."""
        for event in self._due:
            self._due[event] += seconds

    def suspend(self, seconds: float, now: Now) -> None:
        """Let none take effect within so many seconds: what is awaited may be on its way."""
        self._not_before = now.steady + seconds

    def follow(self, now: Now) -> None:
        """Take the moment; where the ROS clock has jumped back, deadlines on it jump with it."""
        back = self.now.ros - now.ros
        if back > 0.0:
            for event in ON_ROS_CLOCK & self._due.keys():
                self._due[event] -= back
        self.now = now

    def _left(self, event: Event, now: Now) -> float:
        if event in ON_ROS_CLOCK:  # where the clock has jumped back, no more than what remained
            return self._due[event] - max(now.ros, self.now.ros)
        return self._due[event] - now.steady
