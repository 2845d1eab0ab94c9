"""The host of this process (traffic/state.py): its clock, its one lock, the log, and the alarm.

The alarm is one plain thread that runs the scheduler while goals are open, ticks or not. It ends
when none has been open for a while, and starts again with the next. Knows of no node.
"""

from __future__ import annotations

import threading
import time

from bt_actions.ros.log import log
from bt_actions.traffic.scheduler import Scheduler
from bt_actions.traffic.stalls import Stalls
from bt_actions.traffic.state import Domain, Record, Trace
from bt_actions.utilities.ids import new_id
from bt_actions.utilities.plain_text import raised

LINGER = 5.0
"""Seconds without an open goal until the thread ends; one for each goal would cost more."""
_SINCE_BOOT = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


class RosHost:
    """The common ground of all goals of this process."""

    def __init__(self) -> None:
        self.steady, self.new_goal_id = time.monotonic, new_id
        self.lock = threading.RLock()
        """Taken before a lock of rclpy's, or of a transport's, never after."""
        changed = threading.Condition(self.lock)
        self.wait, self.notify_all = changed.wait, changed.notify_all
        self.log = log
        self.record = Record()
        """The record; wiring.py puts one that is kept in its place."""
        self.stalls = Stalls(_idle, lambda _: time.monotonic())
        self.scheduler = Scheduler(
            self.steady,
            self.stalls,
            self._wake,
            lambda endpoint, error: log.error(f"{endpoint!r}: {raised(error)}"),
        )
        self.trace = Trace()
        self.forks = 0
        self.closing = False
        self.domains: dict[int, Domain] = {}
        """The domains of ROS that goals were ever begun in, by their numbers."""
        self._bell = threading.Condition(self.lock)
        self._thread: threading.Thread | None = None

    wall = staticmethod(time.time)

    def domain(self, number: int) -> Domain:
        with self.lock:
            return self.domains.setdefault(number, Domain())

    def appears(self) -> None:
        """Take note that this process begins to see others now; the caller holds the lock."""
        if self._thread is None:
            self.stalls.lives(self.steady())  # the process has rested until now
            self.stalls.rests(self.steady())

    def disown(self) -> None:
        """Let go of all goals in the child of a fork: they and their guards are the parent's."""
        self.forks += 1
        self.lock._at_fork_reinit()  # type: ignore[attr-defined]  # noqa: SLF001 - as threading does
        self.scheduler.clear()
        self._thread = None
        self.stalls.rests(self.steady())
        self.domains.clear()
        self.record.disown()

    # The alarm

    def _wake(self) -> None:
        if self._thread is None or not self._thread.is_alive():
            self.stalls.lives(self.steady())
            self._thread = threading.Thread(target=self._run, name="bt_actions-alarm", daemon=True)
            self._thread.start()
        else:
            self._bell.notify()

    def _run(self) -> None:
        with self.lock:
            busy_at = self.steady()
            while self.scheduler.scheduled or self.steady() - busy_at < LINGER:
                if self.scheduler.scheduled:
                    busy_at = self.steady()
                self.scheduler.run()
                self._bell.wait(self.scheduler.wakes_at - self.steady())
                self.stalls.lives(self.steady())
            self.stalls.rests(self.steady())
            self._thread = None


def _idle(_: float) -> float:
    """Return the seconds without work, also those in which the machine was suspended."""
    return time.clock_gettime(_SINCE_BOOT) - time.process_time()


host = RosHost()
"""The host of this process."""
