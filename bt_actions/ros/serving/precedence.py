"""The choice among several servers of one action: the oldest answers.

A server offers a topic on which nothing is published. The topic's name says since when the server
is there and whose process it is, and the graph shows the topic as long as the process counts as
alive. So all servers of the action see one order, and none asks or waits for the others.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.exceptions import InvalidHandle

from bt_actions.ros import graph
from bt_actions.ros.rosout import Tell
from bt_actions.ros.serving.endpoints import Endpoints
from bt_actions.utilities.ids import author_of, new_id

LOOK = 1.0
"""Seconds in which a new server is shown an older one (0.04 to 0.6 measured)."""
_GLANCE = 0.05
"""Seconds between two looks."""
_UNCLAIMED = 2.0
"""Seconds from the sight of a server to that of its topic, if it has one."""
_UNCLAIMED_AT_START = 0.3
"""The same seconds before this server has answered anybody: to yield for a moment costs nothing
then.
"""
_CLAIM = re.compile(r"/_since/t\d{20}_[0-9a-f]{32}$")


class Precedence:
    """A look once a second for servers with precedence over one server of an action."""

    def __init__(self, endpoints: Endpoints, action: str, say: Tell) -> None:
        self._node, self._say = endpoints.node, say
        self._lock = threading.Lock()
        self.why = ""
        """Why another server is to answer; "" most often."""
        self.regained: Callable[[], None] = lambda: None
        """Called when precedence comes back from another server to this one."""
        self._action = self._node.resolve_topic_name(action, only_expand=True)
        self._mine = f"/_since/t{time.time_ns():020d}_{new_id().hex()}"
        endpoints.publisher(Time, f"{self._action}{self._mine}", 1)
        self._begun = time.monotonic()
        self._unclaimed_since: float | None = None
        endpoints.timer(LOOK, self.yields)

    def look_first(self) -> None:
        """Look until older servers are most likely discovered. May take a second."""
        while not self.yields() and time.monotonic() < self._begun + LOOK:
            time.sleep(_GLANCE)

    def yields(self) -> bool:
        """Return whether another server is to answer, as seen now; on any thread."""
        with self._lock:
            before, self.why = self.why, self._look()
            why = self.why
        if why and not before:
            self._say("error", f"accepts no goals: {why}")
        elif before and not why:
            self._say("info", "accepts goals: no other server comes first any more")
            self.regained()
        return bool(why)

    def is_doubled(self) -> bool:
        """Return whether a server with precedence has a node of our name, and so our services."""
        if not self.yields():
            return False
        mine = self._node.get_name(), self._node.get_namespace()
        return int(self._node.get_node_names_and_namespaces().count(mine)) > 1

    def _look(self) -> str:
        """Return why another server is to answer, or "".

        A server that was killed on this machine does not count; on another machine, it counts until
        discovery drops it.
        """
        try:
            servers = len(graph.servers(self._node, self._action))
            if servers < 2:  # most often, and in a tenth of the time
                self._unclaimed_since = None
                return ""
            names = [name for name, _ in self._node.get_topic_names_and_types()]
        except (InvalidHandle, RuntimeError):  # the node is gone, or its context
            return ""
        here = [name for name in names if name.startswith(f"{self._action}/_since/")]
        claims = sorted(found[0] for found in map(_CLAIM.search, here) if found)
        for claim in claims[: claims.index(self._mine)] if self._mine in claims else claims:
            if who := _claimant(bytes.fromhex(claim[-32:])):
                return f"{who} has served {self._action} for longer"
        if servers <= len(claims):
            self._unclaimed_since = None
            return ""
        now = time.monotonic()
        self._unclaimed_since = self._unclaimed_since or now
        at_start = now < self._begun + LOOK
        if now - self._unclaimed_since < (_UNCLAIMED_AT_START if at_start else _UNCLAIMED):
            return self.why
        return f"another server of {self._action} is in sight, which is no server of trees"


def _claimant(claimed_by: bytes) -> str:
    """Return the owner of an id in words; "" for a dead process."""
    author = author_of(claimed_by)
    if author is None or not author.here:
        return "a process on another machine"
    return f"process {author.pid}" if author.alive else ""
