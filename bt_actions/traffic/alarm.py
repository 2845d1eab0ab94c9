"""The alarm: one plain thread that minds every open goal's deadlines and servers, ticks or not.

It sleeps until the earliest deadline, ends when no goal has been open for a while, and starts again
with the next. As it never sleeps for long, it notices when the whole process stood still; whether
it did while no goal was open, nobody knows. It knows endpoints only by their `attend`.
"""

from __future__ import annotations

import math
import threading
import time
from typing import Protocol

from bt_actions.ros.log import log
from bt_actions.servers.stalls import Stalls
from bt_actions.traffic.shared import lock
from bt_actions.utilities.plain_text import raised

AT_LEAST_EVERY = 0.2
"""Seconds; a clock that is not the steady one may run faster than the alarm can know."""
SHORTEST = 0.001
"""Seconds that it sleeps in any case, should what is due stay due."""
LINGER = 5.0
"""Seconds without an open goal until the thread ends; to start one for each goal costs more."""


class Attended(Protocol):
    """What the alarm minds."""

    def attend(self, now: float) -> float:
        """Do what is due and return the seconds until there is more."""


_SINCE_BOOT = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)


def _idle(_: float) -> float:
    """Return the seconds without work, also those in which the machine was suspended."""
    return time.clock_gettime(_SINCE_BOOT) - time.process_time()


stalls = Stalls(_idle)
"""Of this process while a goal is open; under the lock."""
_open: set[Attended] = set()
_bell = threading.Condition(lock)
_thread: threading.Thread | None = None
_wakes_at = 0.0


def mind(endpoint: Attended) -> None:
    """Mind this endpoint until it is forgotten; the caller holds the lock."""
    global _thread
    _open.add(endpoint)
    if _thread is None or not _thread.is_alive():
        stalls.lives(time.monotonic())
        _thread = threading.Thread(target=_attend, name="bt_actions-alarm", daemon=True)
        _thread.start()


def forget(endpoint: Attended) -> None:
    """Stop minding this endpoint; the caller holds the lock."""
    _open.discard(endpoint)


def minded() -> list[Attended]:
    """Return the endpoints with open goals."""
    with lock:
        return list(_open)


def disown() -> None:
    """In the child of a fork: nothing that is minded is ours, and the thread is not here."""
    global _thread
    _open.clear()
    _thread = None
    stalls.rests(time.monotonic())


def appears() -> None:
    """Take note that this process begins to see others now; the caller holds the lock."""
    if _thread is None:
        stalls.lives(time.monotonic())  # who was there before has rested until now
        stalls.rests(time.monotonic())


def wake_by(moment: float) -> None:
    """See to it that the alarm is awake at `moment` (steady clock); the caller holds the lock."""
    global _wakes_at
    if moment < _wakes_at:
        _wakes_at = moment
        _bell.notify()


def _attend() -> None:
    global _thread, _wakes_at
    with lock:
        busy_at = time.monotonic()
        while _open or time.monotonic() - busy_at < LINGER:
            wait, _wakes_at = AT_LEAST_EVERY, math.inf  # who asks to be woken meanwhile is heard
            if _open:
                busy_at = time.monotonic()
            for endpoint in list(_open):
                stalls.lives(time.monotonic())  # each look takes its time
                try:
                    wait = min(wait, endpoint.attend(time.monotonic()))
                except Exception as error:  # noqa: BLE001 - the last guard of every deadline
                    log.error(f"{endpoint!r}: {raised(error)}")
            now = time.monotonic()
            stalls.lives(now)
            _wakes_at = max(now + SHORTEST, min(now + wait, _wakes_at))
            stalls.sleeps(now, _wakes_at)
            _bell.wait(_wakes_at - now)
            stalls.lives(time.monotonic())
        stalls.rests(time.monotonic())
        _thread = None
