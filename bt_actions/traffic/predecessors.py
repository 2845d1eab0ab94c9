"""Goals of dead bt_actions processes that still run at a server: said once, for cleanup.

A process that is killed cancels nothing, and whoever starts the next one may not know. Touches none
of them: `bt-actions cleanup`, or `run --cleanup-first`, does (cleanup.py), when a user wants it.
"""

from __future__ import annotations

from collections.abc import Collection

from bt_actions.goals.ids import author_of
from bt_actions.traffic.host import Log

TOLD_AT_MOST = 10
"""Goals of one action that are named; who left more left them in the same way."""


class Predecessors:
    """Of one action."""

    def __init__(self, action: str, log: Log) -> None:
        self._action, self._log = action, log
        self._told: set[bytes] = set()

    def see(self, running: Collection[bytes]) -> None:
        """Take the ids of all goals that a status shows running, but our own."""
        if len(self._told) >= TOLD_AT_MOST:
            return
        authors = {each: author_of(each) for each in running if each not in self._told}
        dead = {each for each in {*authors.values()} if each and not each.alive}  # reads a file
        for goal_id, author in authors.items():
            if author in dead and len(self._told) < TOLD_AT_MOST:
                self._told.add(goal_id)
                self._log.warning(
                    f"{self._action}: a goal of process {author.pid}, which is dead, still runs "
                    f"there; `bt-actions cleanup` cancels it: {goal_id.hex()}"
                )
