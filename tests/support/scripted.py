"""A leaf that does in each visit what a word says, and notes when it begins and is stopped."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

_STATUSES = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}


class Scripted(Behaviour):
    """`visits` are words of R, S and F, a letter a tick; the last is the same for all that follow.

    `log` gets ``a+`` when it begins, ``aS`` and ``aF`` when it ends, ``ax`` when it is stopped.
    """

    def __init__(self, name: str, visits: str, log: list[str]) -> None:
        super().__init__(name)
        self._visits, self._log = visits.split(), log

    def initialise(self) -> None:
        self._left = list(self._visits[0])
        self._visits = self._visits[1:] or self._visits
        self._log.append(f"{self.name}+")

    def update(self) -> Status:
        letter = self._left.pop(0) if len(self._left) > 1 else self._left[0]
        if letter != "R":
            self._log.append(f"{self.name}{letter}")
        return _STATUSES[letter]

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID and self.status is Status.RUNNING:
            self._log.append(f"{self.name}x")
