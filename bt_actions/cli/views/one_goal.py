"""One goal, watched: a line a change; on a terminal, feedback is rewritten in place."""

from __future__ import annotations

from dataclasses import replace
from typing import TextIO

from bt_actions.cli.views.view import View
from bt_actions.events import Event, GoalChanged
from bt_actions.goals.policy import End, Outcome
from bt_actions.story.actions import ActionStory
from bt_actions.story.state import State
from bt_actions.story.values import feedback_text
from bt_actions.story.words import goal_text, left_open, result_lines
from bt_actions.utilities.shorten import fit


class GoalView(View):
    """One line a change of the goal; on a terminal, feedback is rewritten in place."""

    def __init__(self, state: State, out: TextIO, *, feedback: bool) -> None:
        self._state = state
        self._out = out
        self._feedback = feedback
        self._last = ""
        self._last_feedback = ""
        self._in_place = out.isatty() and feedback
        self._drawn = False

    def event(self, event: Event) -> None:
        """Write the state of the goal, where that has changed."""
        if not isinstance(event, GoalChanged) or event.outcome is not None:
            return
        text = goal_text(self._state.action(event.node))
        if text != self._last:
            self._last = text
            self.say(text)

    def frame(self, now: float) -> None:
        """Show the latest feedback."""
        for action in self._state.live if self._feedback else ():
            text = self.feedback_text(action)
            if text and text != self._last_feedback:
                self._last_feedback = text
                self._show_feedback(text)

    def finish(self) -> None:
        """Write the result and the outcome."""
        state, ended = self._state, self._state.ended
        assert ended is not None
        for action in state.actions:
            for line in self.result_lines(action):
                self.say(line)
        for action in state.actions:
            reason = action.latest.latest.reason if action.latest is not None else ""
            if ended.cause and action.outcome is Outcome.CANCELED:
                reason = ended.cause  # here is no tree that could have interrupted it
            told = goal_text(replace(action, reason=reason))  # the result was told above
            self.say(f"{told}, after {action.seconds(state.latest):.2f} s")
        for line in left_open(state):
            self.say(line)

    def feedback_text(self, action: ActionStory) -> str:
        """Return the latest feedback on one line."""
        return feedback_text(action)

    def result_lines(self, action: ActionStory) -> list[str]:
        """Return the lines of the goal's result."""
        if action.end not in (End.SUCCEEDED, End.ABORTED):
            return []  # only these have a result of their own
        return result_lines(action)

    def close(self) -> None:
        """Leave the line that feedback was drawn on."""
        if self._drawn:
            self.say("")

    def _show_feedback(self, text: str) -> None:
        if not self._in_place:
            self.say(f"  {text}")
            return
        self._out.write(f"\r\x1b[K  {text}")
        self._out.flush()
        self._drawn = True

    def say(self, text: str) -> None:
        """Write `text` on a line of its own."""
        start = "\r\x1b[K" if self._drawn else ""
        self._drawn = False
        self._out.write(f"{start}{fit(text)}\n" if text else start)
        self._out.flush()
