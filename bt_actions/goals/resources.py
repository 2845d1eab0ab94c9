"""The holders of resources, and the queue for them.

A resource is a name ("/r1/move_robot", "base"). A holder asks for a set of names at once and gets
all of them or none, so that two holders can never wait for each other. No ROS, no thread, no clock:
the caller locks, and gives up for a holder whose deadline has passed (`release`).
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

from bt_actions.goals.policy import Busy
from bt_actions.goals.terms import Event

Holder = TypeVar("Holder", bound=Hashable)


class Resources(Generic[Holder]):
    """The table of holders and the queue, first come first served."""

    def __init__(self) -> None:
        self._held: dict[Holder, frozenset[str]] = {}
        self._queue: dict[Holder, frozenset[str]] = {}

    def request(self, holder: Holder, names: frozenset[str], busy: Busy) -> Event | None:
        """Ask, once, for all of `names`.

        Return GRANTED or TAKEN, or None where the holder has to wait.
        """
        taken = self.holders(names) or any(names & wanted for wanted in self._queue.values())
        if busy in (Busy.REPLACE, Busy.SHARE) or not taken:
            self._held[holder] = names
            return Event.GRANTED
        if busy is Busy.FAIL:
            return Event.TAKEN
        self._queue[holder] = names
        return None

    def release(self, holder: Holder) -> list[Holder]:
        """Take `holder` out of the table or the queue.

        Return the holders that are granted thereby.
        """
        self._queue.pop(holder, None)
        self._held.pop(holder, None)
        granted = []
        passed: set[str] = set()
        for waiting, names in list(self._queue.items()):
            if not names & passed and not self.holders(names):
                del self._queue[waiting]
                self._held[waiting] = names
                granted.append(waiting)
            else:
                passed |= names  # no holder overtakes an earlier one on its names
        return granted

    def holders(self, names: frozenset[str]) -> list[Holder]:
        """Return the holders of any of `names`, the oldest first."""
        return [holder for holder, held in self._held.items() if held & names]

    def __len__(self) -> int:
        """Return the number of holders and waiters together."""
        return len(self._held) + len(self._queue)
