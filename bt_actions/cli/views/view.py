"""What watches a run: told every event after the report has taken it in, on the main thread.

A view only writes; it decides nothing.
"""

from __future__ import annotations

from typing import Protocol

from bt_actions.cli.views.words import Closing
from bt_actions.events import Event


class View(Protocol):
    """What watches a run."""

    @property
    def fileno(self) -> int:
        """A file descriptor whose data the view passes on at its next frame, or -1."""

    def event(self, event: Event) -> None:
        """Show one event."""

    def frame(self) -> None:
        """Show what changes without an event; called about ten times a second."""

    def say(self, text: str) -> None:
        """Tell the user something about the run itself."""

    def finish(self, closing: Closing) -> None:
        """Show how it ended; nothing is shown after it."""

    def close(self) -> None:
        """Give the terminal back, whether or not `finish` was called; may be called twice."""
