"""A fresh look at the ROS graph, for servers that our own participant may never be shown again.

A process that was stopped, or cut off, for longer than its lease is dropped by our participant, and
may have kept ours. If it had announced endpoints shortly before, Fast DDS then waits for ever for
announcements that are not sent again: the process runs, and stays invisible. A participant that is
made after the process is back sees it within a second (docs/reliability-settings.md).

So while a server that was in sight is wanted and is not, a new participant looks for it every now
and then, on a thread of its own. Where a client is ready there, and ours is not, the endpoint goes
on with that one (`Route.move_to`); a participant that finds nothing is closed. Nothing is sent
here, and nothing decided about goals.
"""

from __future__ import annotations

import atexit
import itertools
import os
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.node import Node

from bt_actions.ros.action_transport import RosTransport
from bt_actions.ros.graph import servers
from bt_actions.ros.host import host
from bt_actions.ros.log import log
from bt_actions.ros.workarounds import participant
from bt_actions.traffic.transport import ActionTransport, Listener, Seeker
from bt_actions.utilities.plain_text import raised

FIRST_AFTER = 1.5
"""Seconds until a look after somebody begins to wait; a server that was restarted is seen before.
Also after a look that found one;"""
LONGEST_PAUSE = 60.0
"""else each pause is twice the last, up to this."""
GOES_ON = 1.0
"""Seconds between two questions whether anything is still missed."""
LASTS = 5.0
"""Seconds that a look lasts; what is there comes in sight in 0.1 to 1.0, or when Fast DDS announces
the next time, which is after 3 s (both measured)."""
GLANCE = 0.05
"""Seconds between two questions to the graph in a look."""
AHEAD = 0.7
"""Seconds by which a new participant may be ahead of one that is not blind (0.1 measured)."""

_number = itertools.count(1)
_participants: set[SecondParticipant] = set()
_threads: set[threading.Thread] = set()
_by_domain: dict[tuple[int, str], Rediscovery] = {}
_closing = False  # the process ends


class SecondParticipant:
    """A participant of our own, and who uses it."""

    def __init__(self, domain: int, enclave: str) -> None:
        """Raises what rclpy raises where it cannot be made."""
        context = Context()
        context.init(args=["--ros-args", "--enclave", enclave], domain_id=domain)
        name = f"bt_actions_rediscovery_{os.getpid()}_{next(_number)}"
        try:
            self.node = Node(
                name,
                context=context,
                use_global_arguments=False,
                enable_rosout=False,
                start_parameter_services=False,
            )
        except BaseException:
            context.try_shutdown()
            raise
        self.made_at = time.monotonic()
        self.users: set[ActionTransport] = set()
        """Those that somebody goes on with."""
        self.looking = True
        """A look goes on in it, which must not find it closed."""
        self.closed = False
        self._context = context
        with host.lock:
            _participants.add(self)

    def shows(self, action: str) -> frozenset[bytes]:
        """The GIDs of the servers of an action."""
        return servers(self.node, action)

    def open_transport(self, action_type: Any, name: str, listener: Listener) -> RosTransport:
        """Become a client of an action here."""
        return RosTransport(self.node, action_type, name, listener, self.made_at, self._left_by)

    def _left_by(self, transport: ActionTransport) -> None:
        """Close it when nobody uses it any more; on another thread, as the caller has the lock."""
        if transport not in self.users:
            return
        self.users.discard(transport)
        if not self.users and not self.looking:
            _start(self.close)  # or else at exit

    def close(self) -> None:
        """Take the participant away, unless somebody uses it by now."""
        with host.lock:
            if self.closed or ((self.users or self.looking) and not _closing):
                return
            self.closed = True
            _participants.discard(self)
        participant.close(self.node, self._context)


def look_for(
    seeker: Seeker, action: str, domain: int, enclave: str, *, at_once: bool = False
) -> None:
    """Look for the servers that it misses, until it misses none; the caller holds the lock.

    In the enclave of its node, which may be allowed to look where others are not.
    With `at_once`, whatever pause between two looks for others has been reached begins anew.
    """
    rediscovery = _by_domain.get((domain, enclave))
    if rediscovery is None:
        rediscovery = _by_domain[domain, enclave] = Rediscovery(domain, enclave)
    rediscovery.add(seeker, action, at_once=at_once)


class Rediscovery:
    """Looks for the servers that endpoints of one ROS domain, and one enclave, miss.

    On one thread, which waits from then on for the next to be missed: looks on threads of their own
    would each leave another megabyte behind, because glibc keeps what a thread took for the threads
    that come later.
    """

    def __init__(self, domain: int, enclave: str) -> None:
        self._domain = domain
        self._enclave = enclave
        self._missing: dict[Seeker, str] = {}  # and the action's name
        self._bell = threading.Condition(host.lock)
        self._thread: threading.Thread | None = None
        self._waiting: set[Seeker] = set()
        self._told = False
        self._is_urgent = False

    def add(self, seeker: Seeker, action: str, *, at_once: bool = False) -> None:
        """Look for what this one misses, too."""
        if seeker not in self._missing:
            self._missing[seeker] = action
            self._is_urgent |= at_once
            self._bell.notify_all()
        if self._thread is None or not self._thread.is_alive():
            self._thread = _start(self._run)

    def wake(self) -> None:
        """See whether there is still something to look for; the caller holds the lock."""
        self._bell.notify_all()

    def _run(self) -> None:
        while True:
            with host.lock:
                self._bell.wait_for(lambda: self._missing or _closing)
                if _closing:
                    return
            self._search()

    def _search(self) -> None:
        """Look now and then, until nothing is missed."""
        pause = FIRST_AFTER
        while self._waits(pause):
            if self._is_urgent:
                pause, self._is_urgent = FIRST_AFTER, False
            try:
                found = self._look()
            except Exception as error:  # noqa: BLE001 - no resources, no permission, rclpy's
                found = False
                if not self._told:
                    self._told = True
                    log.warning(f"no second look for lost servers: {raised(error)}")
            pause = FIRST_AFTER if found else min(2 * pause, LONGEST_PAUSE)

    def _waits(self, pause: float) -> bool:
        """Wait for the next look, less long when somebody begins to wait; is anything missed?"""
        with host.lock:
            until = time.monotonic() + pause
            while self._still_missing():
                waiting = {seeker for seeker in self._missing if seeker.has_unsent}
                self._is_urgent |= bool(waiting - self._waiting)
                self._waiting = waiting
                if self._is_urgent:
                    until = min(until, time.monotonic() + FIRST_AFTER)
                left = until - time.monotonic()
                if left <= 0.0:
                    return True
                self._bell.wait(min(left, GOES_ON))
        return False

    def _still_missing(self) -> bool:
        self._missing = {
            seeker: action
            for seeker, action in self._missing.items()
            if not _closing and seeker.misses()
        }
        return bool(self._missing)

    def _look(self) -> bool:
        """Make a participant, and wait until clients in it are ready that ours are missing."""
        second = SecondParticipant(self._domain, self._enclave)
        look = _Look(second)
        try:
            until = time.monotonic() + LASTS
            while time.monotonic() < until:
                with host.lock:
                    seekers = dict(self._missing) if self._still_missing() else {}
                    look.advance(seekers)
                if not seekers:
                    break
                time.sleep(GLANCE)
        finally:
            with host.lock:
                look.clear_up()
                second.looking = False
                found = bool(second.users)
            second.close()
        return found


class _Look:
    """One look: transports on trial in a new participant. All of it under the lock."""

    def __init__(self, second: SecondParticipant) -> None:
        self._second = second
        self._tried: dict[Seeker, ActionTransport] = {}
        self._ready_since: dict[Seeker, float] = {}

    def advance(self, seekers: dict[Seeker, str]) -> None:
        """Try where a server is shown; move all for whom that is ready, together.

        Together, because what one of them has lost may conflict with another's next goal.
        """
        now = time.monotonic()
        for seeker, action in seekers.items():
            if seeker not in self._tried and self._second.shows(action):
                self._tried[seeker] = seeker.try_in(self._second)
            if seeker in self._tried and self._tried[seeker].ready():
                self._ready_since.setdefault(seeker, now)
        ready = [
            seeker
            for seeker in seekers
            if seeker in self._ready_since and seeker.try_and_compare(self._tried[seeker])
        ]
        if any(now - self._ready_since[seeker] >= AHEAD for seeker in ready):
            for seeker in ready:
                transport = self._tried.pop(seeker)
                self._second.users.add(transport)
                seeker.move_to(transport)

    def clear_up(self) -> None:
        """Close what nobody took."""
        for transport in self._tried.values():
            transport.close()
        self._tried.clear()


def _start(what: Callable[[], None]) -> threading.Thread | None:
    """Start a thread; None where there can be no more."""
    thread = threading.Thread(target=what, name="bt_actions-rediscovery", daemon=True)
    with host.lock:
        _threads.difference_update([each for each in _threads if not each.is_alive()])
        try:
            thread.start()
        except RuntimeError:
            return None
        _threads.add(thread)
    return thread


@atexit.register
def _close_at_exit() -> None:
    """Let no thread of ours be within Fast DDS, and no participant be open, when Python goes."""
    global _closing
    with host.lock:
        _closing = True
        for rediscovery in _by_domain.values():
            rediscovery.wake()
        threads = list(_threads)
    for thread in threads:
        thread.join(LASTS)
    with host.lock:
        sights = list(_participants)
    for second in sights:
        second.close()


os.register_at_fork(after_in_child=lambda: atexit.unregister(_close_at_exit))
