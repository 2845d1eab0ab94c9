"""What watches a run: told every event after the state has taken it in, on the main thread.

A view only writes; it decides nothing. This one shows nothing.
"""

from __future__ import annotations

from bt_actions.events import Event


class View:
    """What watches a run."""

    @property
    def fileno(self) -> int:
        """A file descriptor whose data the view passes on at its next frame, or -1."""
        return -1

    def due(self, now: float) -> None:
        """Show what is shown because it has lasted until `now`, on the steady clock."""

    def event(self, event: Event) -> None:
        """Show one event."""

    def frame(self, now: float) -> None:
        """Show what changes without an event, `now` on the steady clock; ten times a second."""

    def say(self, text: str) -> None:
        """Tell the user something about the run itself."""

    def finish(self) -> None:
        """Show how it ended; nothing is shown after it."""

    def close(self) -> None:
        """Give the terminal back, whether or not `finish` was called; may be called twice."""
