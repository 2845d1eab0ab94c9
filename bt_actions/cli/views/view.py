"""A view of a run: gets every event after the state has taken it in, on the main thread.

A view only writes; it decides nothing. This one shows nothing.
"""

from __future__ import annotations

from bt_actions.events import Event


class View:
    """A view of a run."""

    @property
    def fileno(self) -> int:
        """A file descriptor whose data the view passes on at its next frame, or -1."""
        return -1

    def due(self, now: float) -> None:
        """Show what has lasted until `now`, on the steady clock."""

    def event(self, event: Event) -> None:
        """Show one event."""

    def frame(self, now: float) -> None:
        """Show changes without an event, `now` on the steady clock; ten times a second."""

    def say(self, text: str) -> None:
        """Tell the user something about the run itself."""

    def finish(self) -> None:
        """Show the end of the run; nothing is shown after it."""

    def close(self) -> None:
        """Give the terminal back, whether or not `finish` was called; may be called twice."""
