"""A fresh look at the ROS graph, for servers that our own participant may never be shown again.

A process that was stopped, or cut off, for longer than its lease is dropped by our participant, and
may have kept ours. If it had announced endpoints shortly before, Fast DDS then waits for ever for
announcements that are not sent again: the process runs, and stays invisible. A participant that is
made after the process is back sees it within a second (docs/reliability-settings.md).

So while a server that was in sight is wanted and is not, a new participant looks for it every now
and then, on a thread of its own. What it finds, the line moves to it (`Line.move_to`); one that
finds nothing is closed. Nothing is sent and nothing is decided here.
"""

from __future__ import annotations

import atexit
import itertools
import os
import threading
import time
import weakref
from collections.abc import Callable
from typing import Protocol

from rclpy.context import Context
from rclpy.node import Node

from bt_actions.ros.log import log
from bt_actions.ros.shared import lock

FIRST_AFTER = 0.5
"""Seconds out of sight until the first look."""
PAUSE = 1.0
"""Seconds between two looks while somebody waits for a server;"""
LONGEST_PAUSE = 30.0
"""while only the return of a lost goal would matter, each pause is twice the last, up to this."""
LASTS = 2.5
"""Seconds that a look lasts; what is there comes in sight in 0.1 to 1.0 (measured)."""
GLANCE = 0.05
"""Seconds between two questions to the graph in a look."""
AHEAD = 0.5
"""Seconds by which a new participant may be ahead of one that is not blind (0.1 measured)."""

_number = itertools.count(1)
_sights: weakref.WeakSet[Sight] = weakref.WeakSet()
_threads: weakref.WeakSet[threading.Thread] = weakref.WeakSet()
_lookouts: dict[int, Lookout] = {}
_closing = False  # the process ends


class Seeker(Protocol):
    """Who has lost sight of a server (ros/line.py)."""

    status_topic: str

    def misses(self) -> bool:
        """Whether a server is wanted, and none is in sight, by now."""

    def is_waited_for(self) -> bool:
        """Whether somebody wants to send a goal."""

    def move_to(self, sight: Sight) -> None:
        """Go on from the participant that sees the server."""


class Sight:
    """A participant of our own, and who uses it."""

    def __init__(self, domain: int) -> None:
        """Raises what rclpy raises where it cannot be made."""
        self._context = Context()
        self._context.init(domain_id=domain)
        name = f"bt_actions_lookout_{os.getpid()}_{next(_number)}"
        try:
            self.node = Node(
                name,
                context=self._context,
                use_global_arguments=False,
                enable_rosout=False,
                start_parameter_services=False,
            )
        except BaseException:
            self._context.try_shutdown()
            raise
        self.users: set[Seeker] = set()
        self._closed = False
        _sights.add(self)

    def shows(self, topic: str) -> frozenset[bytes]:
        """The GIDs of who publishes a topic."""
        return publishers(self.node, topic)

    def left_by(self, user: Seeker) -> None:
        """Close it when nobody uses it any more; on another thread, as the caller has the lock."""
        self.users.discard(user)
        if not self.users:
            _start(self.close)

    def close(self) -> None:
        """Take the participant away."""
        with lock:
            if self._closed:
                return
            self._closed = True
        self.node.destroy_node()
        self._context.try_shutdown()


def look_for(line: Seeker, domain: int) -> None:
    """Look for what this line misses, until it misses nothing; the caller holds the lock."""
    lookout = _lookouts.get(domain)
    if lookout is None:
        lookout = _lookouts[domain] = Lookout(domain)
    lookout.add(line)


class Lookout:
    """Looks for the servers that lines of one ROS domain miss."""

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._missing: set[Seeker] = set()
        self._bell = threading.Condition(lock)
        self._thread: threading.Thread | None = None
        self._told = False

    def add(self, line: Seeker) -> None:
        """Look for what this line misses, too."""
        if line in self._missing:
            return
        self._missing.add(line)
        self._bell.notify_all()
        if self._thread is None or not self._thread.is_alive():
            self._thread = _start(self._run)

    def wake(self) -> None:
        """See whether there is still something to look for; the caller holds the lock."""
        self._bell.notify_all()

    def _run(self) -> None:
        pause = FIRST_AFTER
        while True:
            with lock:
                self._wait(pause)
                if not self._still_missing():
                    self._thread = None
                    return
            try:
                found = self._look()
            except Exception as error:  # noqa: BLE001 - its last user has left meanwhile, or rclpy's
                log.error(f"a second look for lost servers: {error!r}")
                found = False
            pause = PAUSE if found or pause < PAUSE else min(2 * pause, LONGEST_PAUSE)

    def _wait(self, pause: float) -> None:
        """Wait for the next look; no longer than a moment while somebody waits for a server."""
        started = time.monotonic()
        while self._still_missing():
            urgent = any(line.is_waited_for() for line in self._missing)
            left = started + (min(pause, PAUSE) if urgent else pause) - time.monotonic()
            if left <= 0.0:
                return
            self._bell.wait(min(left, PAUSE))

    def _still_missing(self) -> bool:
        self._missing = {line for line in self._missing if not _closing and line.misses()}
        return bool(self._missing)

    def _look(self) -> bool:
        """Make a participant and wait until it shows something that is missed."""
        try:
            sight = Sight(self._domain)
        except Exception as error:  # noqa: BLE001 - no resources, no permission, a closing process
            if not self._told:
                self._told = True
                log.warning(f"no second look for lost servers: {error!r}")
            return False
        try:
            until = time.monotonic() + LASTS
            shown_since: dict[Seeker, float] = {}
            while time.monotonic() < until and self._find(sight, shown_since):
                time.sleep(GLANCE)
        finally:
            with lock:
                unused = not sight.users
            if unused:
                sight.close()
        return not unused

    def _find(self, sight: Sight, shown_since: dict[Seeker, float]) -> bool:
        """Move the lines over whose servers are in sight; return whether any is missing still."""
        with lock:
            lines = list(self._missing) if self._still_missing() else []
        shown = [line for line in lines if sight.shows(line.status_topic)]
        with lock:
            now = time.monotonic()
            since = [shown_since.setdefault(line, now) for line in shown if line.misses()]
            if since and now - min(since) >= AHEAD:
                for line in shown:  # all at once: what one has lost may be in the way of another
                    if line.misses():
                        line.move_to(sight)
                        self._missing.discard(line)
        return bool(lines)


def publishers(node: Node, topic: str) -> frozenset[bytes]:
    """Return the GIDs of who publishes a topic, as far as this node knows; raises InvalidHandle."""
    infos = node.get_publishers_info_by_topic(topic)
    return frozenset(bytes(info.endpoint_gid) for info in infos)


def _start(what: Callable[[], None]) -> threading.Thread:
    thread = threading.Thread(target=what, name="bt_actions-lookout", daemon=True)
    thread.start()
    _threads.add(thread)
    return thread


@atexit.register
def _close_at_exit() -> None:
    """Let no thread of ours be within Fast DDS, and no participant be open, when Python goes."""
    global _closing
    _closing = True
    with lock:
        for lookout in _lookouts.values():
            lookout.wake()
    for thread in list(_threads):
        thread.join(LASTS)
    for sight in list(_sights):
        sight.close()


os.register_at_fork(after_in_child=lambda: atexit.unregister(_close_at_exit))
