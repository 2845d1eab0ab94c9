"""The deadlines of one goal, on two clocks.

Answers of the server are awaited on the steady clock. The work of the robot is awaited on the ROS
clock, which may stand still or jump back: the rest of a deadline then remains. No clock of its own,
and no knowledge of a deadline's meaning (goal.py).
"""

from __future__ import annotations

from operator import itemgetter

from bt_actions.goals.terms import NEVER, ON_ROS_CLOCK, Event, Now


class Deadlines:
    """The deadlines by name: each is named by the event that comes when it passes."""

    def __init__(self, now: Now) -> None:
        self.now = now
        """The last moment that was told."""
        self._due: dict[Event, float] = {}
        self._not_before = NEVER

    def arm(self, event: Event, seconds: float | None) -> None:
        """Let `event` fall due in so many seconds, whatever was set before.

        None changes nothing.
        """
        if seconds is not None:
            now = self.now.ros if event in ON_ROS_CLOCK else self.now.steady
            self._due[event] = now + seconds

    def __contains__(self, event: Event) -> bool:
        """Return whether this deadline is set."""
        return event in self._due

    def disarm(self, *events: Event) -> None:
        """Forget these deadlines."""
        for event in events:
            self._due.pop(event, None)

    def clear(self) -> None:
        """Forget all deadlines."""
        self._due.clear()

    def left(self, now: Now) -> list[tuple[float, Event]]:
        """Return the seconds until each deadline, the earliest first.

        Negative where one has passed.
        """
        suspended = self._not_before - now.steady
        waits = [(self._left(event, now), event) for event in self._due]
        waits.sort(key=itemgetter(0))
        return [(max(left, suspended), event) for left, event in waits]

    def take_passed(self, event: Event, now: Now) -> bool:
        """Return whether this deadline has passed, and forget one that has."""
        if event not in self._due or now.steady < self._not_before or self._left(event, now) > 0.0:
            return False
        del self._due[event]
        return True

    def postpone(self, seconds: float) -> None:
        """Give all deadlines so much more time."""
        for event in self._due:
            self._due[event] += seconds

    def suspend(self, seconds: float, now: Now) -> None:
        """Let no deadline take effect within so many seconds: an answer may be on its way."""
        self._not_before = now.steady + seconds

    def follow(self, now: Now) -> None:
        """Take the moment; deadlines on the ROS clock jump back with that clock."""
        back = self.now.ros - now.ros
        if back > 0.0:
            for event in ON_ROS_CLOCK & self._due.keys():
                self._due[event] -= back
        self.now = now

    def _left(self, event: Event, now: Now) -> float:
        if event in ON_ROS_CLOCK:  # after a jump back, no more than the rest
            return self._due[event] - max(now.ros, self.now.ros)
        return self._due[event] - now.steady
