"""Which of several servers of one action answers: the one that has been there longest.

A server offers a topic on which nothing is published. Its name says since when the server is there
and whose process it is, and the graph shows it as long as the process counts as alive. So all
servers of the action see one order, and nobody asks or waits for the others.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.exceptions import InvalidHandle

from bt_actions.goals.ids import author_of, new_goal_id
from bt_actions.ros import graph
from bt_actions.ros.serving.endpoints import Endpoints
from bt_actions.ros.serving.telling import Telling

LOOK = 1.0
"""Seconds in which a new server is shown one that is there (0.04 to 0.6 measured)."""
_GLANCE = 0.05
"""Seconds between two looks."""
_UNCLAIMED = 2.0
"""Seconds for which a server is in sight until its topic is, too, if it has one;"""
_UNCLAIMED_AT_START = 0.3
"""and before this one has answered anybody, when to yield for a moment costs nothing."""
_CLAIM = re.compile(r"/_since/t(\d{20})_([0-9a-f]{32})$")


class Precedence:
    """Looks once a second whether others come before one server of an action, and says so."""

    def __init__(self, endpoints: Endpoints, action: str, say: Telling) -> None:
        self._node, self._say = endpoints.node, say
        self._lock = threading.Lock()
        self.why = ""
        """Why another server is to answer; "" most often."""
        self.regained: Callable[[], None] = lambda: None
        """Called when another server had to answer, and this one is to answer now."""
        self._action = self._node.resolve_topic_name(action, only_expand=True)
        self._mine = f"/_since/t{time.time_ns():020d}_{new_goal_id().hex()}"
        endpoints.publisher(Time, f"{self._action}{self._mine}", 1)
        self._begun = time.monotonic()
        self._unclaimed_since: float | None = None
        endpoints.timer(LOOK, self.yields)

    def look_first(self) -> None:
        """Look until whoever is there has been discovered, most likely. May take a second."""
        while not self.yields() and time.monotonic() < self._begun + LOOK:
            time.sleep(_GLANCE)

    def yields(self) -> bool:
        """Whether another server is to answer, as seen now; on any thread."""
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
        """Whether a server that comes first has a node of the same name, and so our services."""
        if not self.yields():
            return False
        mine = self._node.get_name(), self._node.get_namespace()
        return int(self._node.get_node_names_and_namespaces().count(mine)) > 1

    def _look(self) -> str:
        """Return why another server is to answer, or "".

        One that was killed on this machine does not count; on another machine, it does until
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
            if who := _claimant(claim):
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


def _claimant(claim: str) -> str:
    """Whose claim it is, in words; "" for a process that is dead."""
    found = _CLAIM.search(claim)
    author = author_of(bytes.fromhex(found[2])) if found else None
    if author is None or not author.here:
        return "a process on another machine"
    return f"process {author.pid}" if author.alive else ""
