"""Goals of dead bt_actions processes that still run at a server: said once, for cleanup.

A process that is killed cancels nothing, and whoever starts the next one may not know. Touches none
of them: `bt-actions cleanup`, or `run --cleanup-first`, does (recovery/sweep.py), when a user wants
it.
"""

from __future__ import annotations

from collections.abc import Collection

from bt_actions.traffic.host import Log
from bt_actions.utilities.ids import author_of

TOLD_AT_MOST = 10
"""Goals of one action that are named; who left more left them in the same way."""


def warn_of_dead(action: str, running: Collection[bytes], told: set[bytes], log: Log) -> None:
    """Name what the dead have left among the ids that a status shows running, but our own.

    `told` are those that were named before.
    """
    if len(told) >= TOLD_AT_MOST:
        return
    authors = {each: author_of(each) for each in running if each not in told}
    dead = {each for each in {*authors.values()} if each and not each.alive}  # reads a file
    for goal_id, author in authors.items():
        if author in dead and len(told) < TOLD_AT_MOST:
            told.add(goal_id)
            log.warning(
                f"{action}: a goal of process {author.pid}, which is dead, still runs "
                f"there; `bt-actions cleanup` cancels it: {goal_id.hex()}"
            )
