"""What dead processes sent and nobody answered (ledger.py), as a cleanup awaits it.

Each is awaited until a server shows it, or it is sure that none will. Asks nobody: sweep.py does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from bt_actions.recovery.ledger import Sent, left_behind, mark_lost, strike_left
from bt_actions.recovery.left_behind import LeftBehind
from bt_actions.recovery.roll_call import RollCall


class Unanswered:
    """What is on record of one ROS domain."""

    def __init__(self) -> None:
        self.trouble: OSError | None = None
        """Why the records cannot be read."""
        self._read: set[Path] = set()
        self._sent: dict[bytes, Sent] = {}

    def read(self, domain: int) -> Iterator[Sent]:
        """Read the records of those that have died since; return goals that are elsewhere's."""
        troubles: list[OSError] = []
        for sent in left_behind(troubles.append, self._read):
            self._read.add(sent.path)
            if sent.domain == domain and sent.author.here:
                self._sent[sent.goal_id] = sent
            elif sent.domain == domain:
                yield sent
        self.trouble = troubles[0] if troubles else None

    def new(
        self, left: Mapping[bytes, LeftBehind], calls: Mapping[str, RollCall]
    ) -> Iterator[Sent]:
        """Return those that are to be awaited from now on.

        Where its sender had seen its server go, only if that is in sight again.
        """
        for goal_id, sent in self._sent.items():
            if goal_id not in left and not (sent.lost and self._is_gone(sent, calls)):
                yield sent

    def judge(
        self, left: Mapping[bytes, LeftBehind], calls: Mapping[str, RollCall]
    ) -> Iterator[LeftBehind]:
        """See which of them need not be awaited any more; return those that are to be again."""
        for goal_id, sent in self._sent.items():
            awaited = left.get(goal_id)
            if awaited is not None and awaited.server_is_gone and not self._is_gone(sent, calls):
                awaited.is_awaited_again()
                yield awaited
            if awaited is None or not awaited.awaited:
                continue
            if awaited.denial.lasted >= awaited.takes:
                awaited.is_nowhere(f"denied for {awaited.takes:g} s")
            elif calls[sent.action].known and self._is_gone(sent, calls):
                awaited.is_nowhere("its server is gone")
                awaited.server_is_gone = True

    def strike(
        self,
        left: Mapping[bytes, LeftBehind],
        calls: Mapping[str, RollCall],
        *,
        was_looked_for: bool,
    ) -> None:
        """Take off the record what is over, or what a status shows.

        What was looked for to no avail is to be told once; should its server only have stood still,
        and be in sight another time, it is awaited again.
        """
        met = [(sent, left[goal_id]) for goal_id, sent in self._sent.items() if goal_id in left]
        strike_left(
            sent
            for sent, goal in met
            if not (goal.awaited or goal.server_is_gone)
            and (len(sent.servers) <= 1 or goal.nothing_left)  # another may not have decided
        )
        mark_lost(
            sent
            for sent, goal in met
            if goal.server_is_gone
            or (goal.awaited and was_looked_for and not calls[sent.action].sighted)
        )

    @staticmethod
    def _is_gone(sent: Sent, calls: Mapping[str, RollCall]) -> bool:
        """Whether no server that may have got it is in sight, nor was."""
        call = calls.get(sent.action)
        return bool(sent.servers) and not (call is not None and sent.servers & call.servers)
