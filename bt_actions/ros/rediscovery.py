"""A fresh look at the ROS graph, for servers that our own participant may never be shown again.

Our participant drops a process that was stopped, or cut off, for longer than its lease, while that
process may have kept ours. Where it had announced endpoints shortly before, Fast DDS then waits for
ever for announcements that are not sent again: the process runs, and stays invisible. A participant
made after the process is back sees it within a second (docs/reliability-settings.md).

So while a wanted server is out of sight, a new participant looks for it every now and then, on a
thread of its own. Where a client is ready there, and ours is not, the endpoint goes on with that
one (`watcher.move_to`); a participant that finds nothing is closed. Nothing is sent here, and
nothing decided about goals.
"""

from __future__ import annotations

import atexit
import contextlib
import math
import os
import threading
import time
from typing import Any

from bt_actions.ros.action_transport import RosTransport
from bt_actions.ros.graph import servers
from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.ros.naming import own_node
from bt_actions.ros.workarounds import participant
from bt_actions.traffic import route, watcher
from bt_actions.traffic.state import Endpoint
from bt_actions.traffic.transport import ActionTransport, Listener
from bt_actions.utilities.plain_text import raised

FIRST_AFTER = 1.5
"""Seconds until the first look for a wait, and after a look with a find; a restarted server is seen
before.
"""
LONGEST_PAUSE = 60.0
"""The longest pause in seconds: each pause is twice the last."""
GOES_ON = 1.0
"""Seconds between two questions whether any server is still missed."""
LASTS = 5.0
"""Seconds of a look; a server comes in sight in 0.1 to 1.0, or when Fast DDS announces the next
time, which is after 3 s (both measured).
"""
GLANCE = 0.05
"""Seconds between two questions to the graph in a look."""
AHEAD = 0.7
"""Seconds by which a new participant may be ahead of one that is not blind (0.1 measured)."""

_by_domain: dict[tuple[int, str], Rediscovery] = {}
_bell = threading.Condition(host.lock)
"""Rings for a missed server, an unused participant, and the end of the process."""
_closing = False  # the process ends


class SecondParticipant:
    """A participant of our own, and its users."""

    def __init__(self, domain: int, enclave: str) -> None:
        """Make the participant. Raises what rclpy raises where that fails."""
        self.node = own_node(
            f"bt_actions_rediscovery_{os.getpid()}",
            args=["--ros-args", "--enclave", enclave],
            domain=domain,
            use_global_arguments=False,
        )
        self.made_at = time.monotonic()
        self.users: set[ActionTransport] = set()
        """The transports that endpoints go on with."""

    def open_transport(self, action_type: Any, name: str, listener: Listener) -> RosTransport:
        """Open a client of an action here."""
        return RosTransport(self.node, action_type, name, listener, self.made_at, self._left_by)

    def _left_by(self, transport: ActionTransport) -> None:
        self.users.discard(transport)
        _bell.notify_all()

    def close(self) -> None:
        """Take the participant away."""
        participant.close(self.node)


def look_for(endpoint: Endpoint, domain: int, enclave: str) -> None:
    """Look for the servers that an endpoint misses, until none is; the caller holds the lock.

    The look is in the enclave of the endpoint's node, which may be allowed to look where others are
    not. The pause between two looks begins anew.
    """
    rediscovery = _by_domain.setdefault((domain, enclave), Rediscovery(domain, enclave))
    rediscovery.add(endpoint)


class Rediscovery:
    """The looks for servers that endpoints of one ROS domain, and one enclave, miss.

    One thread makes all looks, and waits for the next missed server: a thread for each look would
    leave another megabyte behind, because glibc keeps what a thread took for later threads. This
    thread also takes participants away, whose last user holds the lock.
    """

    def __init__(self, domain: int, enclave: str) -> None:
        self._where = domain, enclave
        self._missing: list[Endpoint] = []
        self._participants: list[SecondParticipant] = []
        self._thread: threading.Thread | None = None
        self._wanted: set[tuple[Endpoint, bool]] = set()  # and whether for a goal that waits
        self._pause = FIRST_AFTER
        self._look_at = math.inf

    def add(self, endpoint: Endpoint) -> None:
        """Look for the servers that this endpoint misses, too."""
        if endpoint not in self._missing:
            self._missing.append(endpoint)
            _bell.notify_all()
        if self._thread is None or not self._thread.is_alive():
            thread = threading.Thread(target=self._run, name="bt_actions-rediscovery", daemon=True)
            with contextlib.suppress(RuntimeError):  # no more threads are possible
                thread.start()
                self._thread = thread

    def close(self) -> None:
        """End all threads within Fast DDS, and close all participants, before Python goes."""
        if self._thread is not None:
            self._thread.join(LASTS)
        for second in self._participants:
            second.close()

    def _run(self) -> None:
        while not _closing:
            if self._is_time():
                try:
                    found = self._look()
                except Exception as error:  # noqa: BLE001 - no resources, no permission, rclpy's
                    found = False
                    if self._pause == FIRST_AFTER:
                        log.warning(f"no second look for lost servers: {raised(error)}")
                self._pause = FIRST_AFTER if found else min(2 * self._pause, LONGEST_PAUSE)
                self._look_at = time.monotonic() + self._pause
            for second in self._unused():
                self._participants.remove(second)
                second.close()

    def _is_time(self) -> bool:
        """Wait for work, less long for a new wait; return whether the work is a look."""
        with host.lock:
            while not (_closing or self._unused()):
                before, now = self._wanted, time.monotonic()
                if not self._still_missing():
                    self._look_at = math.inf
                self._wanted = {(each, each.has_unsent) for each in self._missing}
                if self._wanted - before:
                    self._pause = FIRST_AFTER
                    self._look_at = min(self._look_at, now + FIRST_AFTER)
                if now >= self._look_at:
                    return True
                _bell.wait(min(self._look_at - now, GOES_ON) if self._missing else None)
        return False

    def _unused(self) -> list[SecondParticipant]:
        return [each for each in self._participants if not each.users]

    def _still_missing(self) -> bool:
        self._missing = [each for each in self._missing if route.misses(each)]
        return bool(self._missing)

    def _look(self) -> bool:
        """Look in a new participant; move all endpoints there whose servers are ready."""
        second = SecondParticipant(*self._where)
        self._participants.append(second)
        tried: dict[Endpoint, ActionTransport] = {}
        ready_since: dict[Endpoint, float] = {}
        until = time.monotonic() + LASTS
        try:
            while (now := time.monotonic()) < until:
                with host.lock:
                    if _closing or not self._still_missing():
                        break
                    for each in self._missing:
                        if each not in tried and servers(second.node, each.name):
                            tried[each] = second.open_transport(*each.action, each)
                            route.begin_trial(each, tried[each])
                        if each in tried and tried[each].ready():
                            ready_since.setdefault(each, now)
                    ready = [
                        each
                        for each in self._missing
                        if each in ready_since and route.is_better(each, tried[each])
                    ]
                    # Together: what one of them has lost may conflict with another's next goal.
                    if any(now - ready_since[each] >= AHEAD for each in ready):
                        for each in ready:
                            transport = tried.pop(each)
                            second.users.add(transport)
                            watcher.move_to(each, transport)
                time.sleep(GLANCE)
        finally:
            with host.lock:
                for transport in tried.values():  # unused ones
                    transport.close()
        return bool(second.users)


@atexit.register
def _close_at_exit() -> None:
    global _closing
    with host.lock:
        _closing = True
        _bell.notify_all()
    for rediscovery in list(_by_domain.values()):
        rediscovery.close()


os.register_at_fork(after_in_child=lambda: atexit.unregister(_close_at_exit))
