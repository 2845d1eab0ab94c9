"""One accepted goal: its client, its run, and what its client has heard of it. Ends nothing."""

from __future__ import annotations

from dataclasses import dataclass

from bt_actions.ros.serving.action_server import AcceptedGoal
from bt_actions.serving.messages import feedback
from bt_actions.serving.run import Run

__all__ = ["FASTEST", "Goal"]

FASTEST, SLOWEST = 0.1, 1.0
"""Seconds between two messages of feedback: where something has changed, and where nothing has."""


@dataclass(slots=True, eq=False)
class Goal:
    """A goal that runs, or waits for its turn."""

    client: AcceptedGoal
    run: Run
    tree: str
    begun: bool = False
    _told: int = -1
    _told_at: float = 0.0

    @property
    def id(self) -> bytes:
        """Its goal id."""
        return self.client.id

    def tell(self, now: float) -> None:
        """Tell its client how far it is; to be called every FASTEST seconds."""
        changes = self.run.changes
        if changes != self._told or now - self._told_at >= SLOWEST - FASTEST / 2:
            self._told, self._told_at = changes, now
            self.client.tell(feedback(self.run.running(), self.run.leaves_ended))
