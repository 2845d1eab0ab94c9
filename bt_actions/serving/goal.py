"""One accepted goal: its client, its run, and the feedback so far. Ends nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bt_actions.serving.messages import feedback
from bt_actions.serving.run import Run

FASTEST, SLOWEST = 0.1, 1.0
"""Seconds between two messages of feedback: after a change, and without one."""


@dataclass(slots=True, eq=False)
class ServedGoal:
    """A goal that runs, or waits for its turn."""

    client: Any
    """rclpy's handle of the goal."""
    run: Run
    tree: str
    begins: str = ""
    """The line in the log when the goal begins."""
    begun_at: float | None = None
    """The moment of its beginning, on the steady clock; None while it waits for its turn."""
    _told: int = -1
    _told_at: float = 0.0

    @property
    def id(self) -> bytes:
        """The goal id."""
        return bytes(self.client.goal_id.uuid)

    @property
    def begun(self) -> bool:
        """Whether its turn has come."""
        return self.begun_at is not None

    @property
    def label(self) -> str:
        """A name that tells its run from other runs of the tree."""
        return f"{self.tree} {self.id.hex()}"

    def tell(self, now: float) -> None:
        """Send feedback to its client, if it is time; to be called every FASTEST seconds."""
        with self.run.told() as state:
            if state.changes == self._told and now - self._told_at < SLOWEST - FASTEST / 2:
                return
            self._told, self._told_at = state.changes, now
            message = feedback(state, paused=self.run.paused, begun=self.begun)
        self.client.publish_feedback(message)
