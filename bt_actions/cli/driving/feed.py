"""The events of a run, fed to its state and its view: the same lines from a run and from a file.

The view's time passes up to each event before the event counts: lines about something that lasts
show the state of their moment, however late the event is read.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from bt_actions.cli.views.view import View
from bt_actions.events import Event, StopWanted
from bt_actions.story.state import State
from bt_actions.story.words import stopping_text, waiting_text

SOON = 1.0
"""Seconds after the end of the tree without a word about goals that have not ended."""


class Feed:
    """The state of a run, and its view."""

    def __init__(
        self,
        state: State,
        view: View,
        show: Callable[[Callable[[], None]], None] = lambda draw: draw(),
    ) -> None:
        """Take state and view; `show` makes each call of the view, to guard it."""
        self.state, self.view, self._show = state, view, show
        self._waits_since: float | None = None
        """The moment at which the tree was first known to have ended."""
        self._has_said = False
        """Whether the open goals were told."""

    def event(self, event: Event) -> None:
        """Take in an event, and show it; drop an event of an unknown node, damaged or late."""
        self._pass(event.at.steady)
        self.state.fold(event)
        node = getattr(event, "node", None)
        if node is None or node in self.state.nodes:
            self._show(partial(self.view.event, event))
        if isinstance(event, StopWanted) and not event.abandons:
            self._show(partial(self.view.say, stopping_text(self.state)))

    def frame(self, now: float) -> None:
        """Show the state at `now`, on the steady clock."""
        self._pass(now)
        self._show(partial(self.view.frame, now))

    def _pass(self, now: float) -> None:
        """Let the time until `now` pass."""
        self._show(partial(self.view.due, now))
        state = self.state
        over = state.finished is not None or state.stop is not None
        if self._has_said or over or not state.decided:
            return
        if self._waits_since is None:
            since = state.nodes[state.root].since
            self._waits_since = now if since is None else since.steady
        if now - self._waits_since >= SOON and (text := waiting_text(state)):
            self._has_said = True
            self._show(lambda: self.view.say(f"{text}; Ctrl-C twice leaves without waiting"))
